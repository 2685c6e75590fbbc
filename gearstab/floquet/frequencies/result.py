"""What every way through many mesh frequencies gives."""

from __future__ import annotations

from dataclasses import dataclass

from gearstab.system import Array


@dataclass(frozen=True)
class ManyFrequencies:
    """Stability at mesh frequencies that need not have a common period.

    growth_rate, stable, status: ``(rows, P)``, as in :class:`~gearstab.floquet.Floquet`.

    interval: ``(rows, P)`` or None, half-width of the confidence interval of the growth rate, 1/time.
    by_mesh: ``(rows, P, groups)`` or None, the growth rate with one mesh frequency alone, in the order of
        :func:`~gearstab.floquet.frequencies.groups`.
    error_estimate: ``(rows, P)`` or None, as in :class:`~gearstab.floquet.Floquet`; the largest of all groups.
    """

    growth_rate: Array
    stable: Array
    status: Array
    interval: Array | None = None
    by_mesh: Array | None = None
    error_estimate: Array | None = None
