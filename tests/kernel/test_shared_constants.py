"""Numbers by which both the compiled search and Python decide: a drift would change verdicts."""

import re
from pathlib import Path

import pytest

from gearstab import ckernel
from gearstab.floquet.boundaries.counting import points
from gearstab.floquet.boundaries.names import labels

SOURCES = Path(ckernel.__file__).parent / "boundaries"

SHARED = [
    ("actions.h", "BAND", labels.BAND), ("actions.h", "LEADING", labels.LEADING), ("actions.h", "LEAST", labels.LEAST),
    ("actions.h", "LARGEST_MATRIX", points.LARGEST), ("search.h", "LARGEST", points.LARGEST),
]  # fmt: skip


@pytest.mark.parametrize(("file", "name", "value"), SHARED, ids=[f"{file}:{name}" for file, name, _ in SHARED])
def test_constants_agree(file: str, name: str, value: float) -> None:
    found = re.findall(rf"^#define {name} (\S+)", (SOURCES / file).read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert [float(text) for text in found] == [value]
