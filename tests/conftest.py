"""Settings and fixtures that all tests share."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

os.environ.setdefault("MPLBACKEND", "Agg")
# Thousands of small matrix products: threads of the linear algebra library only wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Examples are the same in every run, and a slow machine is no failure: nothing is timed.
settings.register_profile("gearstab", deadline=None, derandomize=True)
settings.load_profile("gearstab")


@pytest.fixture(scope="session")
def root() -> Path:
    """The root of the source tree."""
    return Path(__file__).resolve().parents[1]


def pytest_configure(config: pytest.Config) -> None:
    """Generate many examples where slow tests are run; see :func:`scenes.examples`."""
    if "slow" in config.option.markexpr.replace("not slow", ""):
        os.environ["GEARSTAB_THOROUGH"] = "1"
