"""The table of variables in docs/methods.md names everything that a result can hold, and nothing else."""

from __future__ import annotations

import re
from fnmatch import fnmatch

import pytest
from scenes import DOCS

import gearstab as gs
from gearstab.floquet import STATUS_FLAGS
from gearstab.floquet.boundaries.regions import BOUNDARY_FLAGS
from gearstab.floquet.required_damping import FLAGS as DAMPING_FLAGS
from gearstab.mesh import MachineElement
from gearstab.passage import STATUS_FLAGS as PASSAGE_FLAGS
from gearstab.response.backlash import BACKLASH_FLAGS
from gearstab.response.rotating_pair.stability import FLAGS as ORBIT_FLAGS
from gearstab.response.steady import STATUS_FLAGS as RESPONSE_FLAGS
from gearstab.results import variables
from gearstab.results.variables import Variable, design, responses

DOCUMENT = DOCS / "methods.md"
OF_BENCH = {name for name in vars(variables) if "BENCH" in name}
FLAGS = {*STATUS_FLAGS, *DAMPING_FLAGS, *BACKLASH_FLAGS, *ORBIT_FLAGS, *RESPONSE_FLAGS, *PASSAGE_FLAGS}


def section() -> str:
    text = DOCUMENT.read_text()
    return text[text.index("## What a result holds") : text.index("## Sources")]


def declared() -> dict[str, Variable]:
    found: dict[str, Variable] = {}
    for name, table in (*vars(variables).items(), *vars(design).items(), *vars(responses).items()):
        if name.isupper() and name not in OF_BENCH:
            entries = table if isinstance(table, tuple) else (table,)
            found |= {item.name: item for item in entries if isinstance(item, Variable)}
    for part in MachineElement:
        made = (*responses.connections(part.value, "N"), *responses.history_of_connections(part.value, "N"))
        found |= {item.name: item for item in made}
    return found


def test_every_variable_and_flag_is_in_the_table() -> None:
    quoted = set(re.findall(r"`([\w*]+)`", section()))
    missing = {name for name in declared() if not any(fnmatch(name, pattern) for pattern in quoted)}
    # Coordinates that are numbers or times of their own dimension.
    assert missing <= {"dof", "mode", "time", "frequency", "side", "tongue"}, missing
    # `overflow` is of histories; what it says is in the text above the table.
    assert not FLAGS - quoted - {"overflow"}


def test_the_table_names_nothing_else() -> None:
    rows = [line.split("|")[2] for line in section().splitlines() if line.startswith("|")][2:]
    named = {name for row in rows for name in re.findall(r"`([\w*]+)`", row)}
    known = declared()
    assert {name for name in named if not any(fnmatch(other, name) for other in known)} == set()


# --- the flags ``cut_below`` and ``cut_above`` name the end of the range at which a region is cut off


@pytest.mark.parametrize("damping", [0.0, 0.01])
@pytest.mark.parametrize(
    ("lower", "upper", "flags"),
    [(2.0, 2.6, {"cut_below"}), (1.6, 2.0, {"cut_above"}), (1.98, 2.02, {"cut_below", "cut_above"}), (1.6, 2.6, set())],
)
def test_the_end_at_which_a_region_goes_on(damping: float, lower: float, upper: float, flags: set[str]) -> None:
    mesh = {"mean_stiffness": 1.0, "epsilon": 0.3, "contact_ratio": 1.5}
    pair = {"kind": "gear_pair", "equivalent_mass": 1.0, "damping_ratio": damping, "meshes": [mesh]}
    # The region at twice the natural frequency 1 has the half width epsilon 2/pi = 0.19 to first order.
    found = gs.boundaries(pair, lower, upper)
    region = list(found.label).index("2w1")
    low, high = found.boundary_frequency[region, :]
    status = int(found.status[region])
    assert {name for name in ("cut_below", "cut_above") if status & BOUNDARY_FLAGS[name]} == flags
    # What is cut off ends at the end of the range, and there the motion grows.
    assert (low == lower, high == upper) == ("cut_below" in flags, "cut_above" in flags)
    ends = gs.floquet(pair, [lower, upper]).growth_rate > 0
    assert ends.tolist() == ["cut_below" in flags, "cut_above" in flags]
