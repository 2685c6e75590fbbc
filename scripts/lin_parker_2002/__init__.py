"""The statements of Lin & Parker, "Mesh stiffness variation instabilities in two-stage gear systems" (2002)."""

from collections.abc import Callable, Iterator

from lin_parker_2002 import example, four_gears, three_gears, unequal
from statements import Runs, Statement

SECTIONS: dict[str, list[Callable[[Runs], Iterator[Statement]]]] = {
    "2 The model, and 3.1 three gears, equal stiffness variations": three_gears.STATEMENTS,
    "3.2 Four gears": four_gears.STATEMENTS,
    "3.3 Unequal stiffness variations": unequal.STATEMENTS,
    "4 The example, and 5 the discussion": example.STATEMENTS,
}
