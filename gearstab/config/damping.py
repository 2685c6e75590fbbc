"""The forms of damping a linear system takes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import Field

from gearstab.config.mesh import Conflict, exactly_one
from gearstab.config.model.fields import NonNegative, Quantity, Section

MatrixEntry = Annotated[float, Quantity("N s/m", ("N s", "N m s"), entry=True)]


class Damping(Section):
    """Damping of the whole system, in one of three forms."""

    modal: list[NonNegative] | None = Field(
        default=None,
        title="modal damping ratios",
        description="One damping ratio a mode, by ascending natural frequency (1).",
    )
    rayleigh: (
        tuple[Annotated[float, Field(ge=0), Quantity("1/s")], Annotated[float, Field(ge=0), Quantity("s")]] | None
    ) = Field(
        default=None,
        title="Rayleigh damping",
        description="[alpha (1/s), beta (s)]: C = alpha M + beta K of the mean system.",
    )
    matrix: list[list[MatrixEntry]] | None = Field(
        default=None, title="damping matrix", description="C, one row a coordinate (N s/m); symmetric."
    )

    @classmethod
    def conflicts(cls, raw: dict[str, Any], size: int | None) -> Iterator[Conflict]:
        """Exactly one form, of the size of the system."""
        yield from exactly_one(raw, ("modal", "rayleigh", "matrix"))
        modal, matrix = raw.get("modal"), raw.get("matrix")
        if size is None:
            return
        if isinstance(modal, list) and len(modal) != size:
            yield ("modal",), f"has {len(modal)} entries", f"give {size}, one a mode"
        if isinstance(matrix, list):
            yield from not_square(matrix, size, ("matrix",))


def not_square(rows: list[Any], size: int, path: tuple[str | int, ...]) -> Iterator[Conflict]:
    """A conflict unless nested lists are ``size`` rows of ``size`` entries."""
    if len(rows) != size:
        yield path, f"has {len(rows)} rows", f"give {size} rows of {size} numbers"
    for i, row in enumerate(rows):
        if isinstance(row, list) and len(row) != size:
            yield (*path, i), f"has {len(row)} entries", f"give {size}, one a coordinate"
