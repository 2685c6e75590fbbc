"""Numbers by which the compiled search and the one in NumPy decide stand in both: a drift would change verdicts."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from gearstab import ckernel
from gearstab.floquet.boundaries.counting import krein, points
from gearstab.floquet.boundaries.names import labels
from gearstab.floquet.boundaries.undamped import search

SOURCES = Path(ckernel.__file__).parent / "boundaries"

SHARED = [
    ("actions.h", "BAND", labels.BAND), ("actions.h", "LEADING", labels.LEADING), ("actions.h", "LEAST", labels.LEAST),
    ("actions.h", "LARGEST_MATRIX", points.LARGEST), ("search.h", "LARGEST", points.LARGEST),
    ("index.c", "LONGEST", points.LONGEST), ("letters.c", "TIE", krein.TIE), ("letters.c", "MIRROR", krein.MIRROR),
    ("names.c", "REACH", labels.REACH), ("names.c", "DISTANCE", labels.DISTANCE), ("names.c", "SURE", labels.SURE),
    ("names.c", "NEARNESS", labels.NEARNESS), ("names.c", "TURN", labels.TURN),
    ("names.c", "BELOW", labels.BELOW), ("names.c", "FORBIDDEN", labels.FORBIDDEN),
    ("search.c", "COARSEST", search.COARSEST), ("search.c", "PATIENCE", search.PATIENCE),
    ("search.c", "ATTEMPTS", search.ATTEMPTS),
]  # fmt: skip


@pytest.mark.parametrize(("file", "name", "value"), SHARED, ids=[f"{file}:{name}" for file, name, _ in SHARED])
def test_constants_of_both_searches_agree(file: str, name: str, value: float) -> None:
    found = re.findall(rf"^#define {name} (\S+)", (SOURCES / file).read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert [float(text) for text in found] == [value]
