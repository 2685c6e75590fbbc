"""The fast tests as other machines would run them: other processors, other instructions, another order, side by side.

python scripts/portable.py [--core NAME]... [--seed SEED] [PYTEST OPTIONS]

What is computed must not hang on how a processor rounds. OpenBLAS has kernels for many and can be told which to take,
and so can the kernel of gearstab. Not every combination runs, but each value of either does once:

    OPENBLAS_CORETYPE   Haswell   Zen    Prescott
    kernel              avx512    avx2   plain

What this processor does not offer is left to its default and said so.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time

COMBINATIONS = {
    "Haswell": {"GEARSTAB_SIMD": "avx512"},
    "Zen": {"GEARSTAB_SIMD": "avx2"},
    "Prescott": {"GEARSTAB_SIMD": "plain"},
}
CORE = "OPENBLAS_CORETYPE"
PROBE = {
    # Instructions that a processor does not have end a process.
    CORE: "import numpy as np; a = np.eye(200) + 1e-3; np.linalg.eigh(a @ a); np.linalg.solve(a, a)",
    "GEARSTAB_SIMD": "from gearstab import ckernel; ckernel.check()",
}
"""Programs that fail where a setting is not possible."""


def possible(name: str, value: str) -> bool:
    """Whether this machine can run with a setting."""
    done = subprocess.run(
        [sys.executable, "-c", PROBE[name]], env=os.environ | {name: value}, capture_output=True, text=True, check=False
    )
    return done.returncode == 0


def run(core: str, seed: int, options: list[str]) -> tuple[str, bool]:
    """Run the tests in one combination: the settings, and whether all tests passed."""
    wanted = {CORE: core} | COMBINATIONS[core]
    settings = {name: value for name, value in wanted.items() if possible(name, value)}
    said = " ".join(f"{name}={value}" for name, value in settings.items())
    if left := [f"{name}={value}" for name, value in wanted.items() if name not in settings]:
        print(f"not possible on this machine, the default is taken: {', '.join(left)}", flush=True)
    arguments = ["-m", "pytest", "-q", "-n", "auto", "--dist", "worksteal", "-p", "randomly"]
    arguments += [f"--randomly-seed={seed}", *options]
    print(f"\n{said} {sys.executable} {' '.join(arguments)}", flush=True)
    done = subprocess.run([sys.executable, *arguments], env=os.environ | settings, check=False)
    return said, done.returncode == 0


def main() -> int:
    """Run all combinations, or some; 1 if a test failed in any of them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--core", action="append", choices=COMBINATIONS, help="only this one; may be repeated")
    parser.add_argument("--seed", type=int, default=int(time.time()), help="of the order; default: another every time")
    asked, options = parser.parse_known_args()
    for name in (CORE, "GEARSTAB_SIMD"):
        os.environ.pop(name, None)
    outcomes = []
    for core in asked.core or COMBINATIONS:
        start = time.monotonic()
        said, passed = run(core, asked.seed, options)
        outcomes.append((said, passed, time.monotonic() - start))
    print(f"\nseed {asked.seed}")
    for said, passed, seconds in outcomes:
        print(f"{'passed' if passed else 'FAILED'} in {seconds:4.0f} s: {said or 'defaults'}")
    return 0 if all(passed for _, passed, _ in outcomes) else 1


if __name__ == "__main__":
    sys.exit(main())
