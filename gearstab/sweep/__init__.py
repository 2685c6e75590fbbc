"""Sweeps: the plan of a grid, its computation on many processors, parts that survive a crash, the result file."""

from gearstab.errors import Interrupted, RequestError, SweepError
from gearstab.sweep.plan import Plan, plan
from gearstab.sweep.progress import Reporter
from gearstab.sweep.run import MOST_FAILURES, run, run_in_memory
from gearstab.sweep.storage.merge import Summary

__all__ = [
    "MOST_FAILURES", "Interrupted", "Plan", "Reporter", "RequestError", "Summary", "SweepError", "plan", "run",
    "run_in_memory",
]  # fmt: skip
