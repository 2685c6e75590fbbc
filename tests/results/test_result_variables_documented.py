"""The table of variables in docs/methods.md names everything that a result can hold, and nothing else."""

from __future__ import annotations

import re
from fnmatch import fnmatch

from scenes import DOCS

from gearstab.floquet import STATUS_FLAGS
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
