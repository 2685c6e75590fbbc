"""Variables of a result file: one line per variable, with its dimensions, type, units and long name.

Units are SI, as everywhere inside the program; :mod:`gearstab.results.display` replaces them by what the coordinates of
a system have, and by 1 in a model without units (``system.units: none``). ``1`` is dimensionless.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import nan
from typing import Any

import numpy as np

from gearstab.system import Array

GRID = "(all axes of the sweep)"
"""In ``dims``: all axes, in the order of the configuration."""

ROWS = "(all axes of the sweep but the mesh frequency)"
"""In ``dims``: all axes but the mesh frequency."""

SPEED = "(mesh frequency or input speed)"
"""In ``dims``: in what a response is given its speed."""

STRETCH, PIECE = "stretch", "piece"
"""In ``dims``: parts of the range of mesh frequencies, as many as the row with most of them has."""

TEXT = "text"
"""In ``dtype``: UTF-8 text of any length."""


class Flags(dict[str, int]):
    """Bits by name, of which the integers of a variable are sums (CF conventions); empty for a variable without any."""

    @classmethod
    def of(cls, attributes: Mapping[Any, Any]) -> Flags:
        """Return the flags that the attributes of a variable name, in a table or in a result that somebody changed."""
        names = str(attributes.get("flag_meanings", "")).split()
        return cls(zip(names, np.ravel(attributes.get("flag_masks", ())).tolist(), strict=False))

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of a variable that has these flags."""
        return {"flag_masks": list(self.values()), "flag_meanings": " ".join(self)}

    @property
    def every(self) -> int:
        """Sum of all bits."""
        return int(np.bitwise_or.reduce([*self.values()], dtype=np.int64))

    def counted(self, values: Array) -> dict[str, int]:
        """Return how many values carry each flag; nothing of flags that none carries.

        Most flags are set nowhere, or everywhere, and few values carry any.
        """
        values = np.ravel(values, order="K")
        anywhere = int(np.bitwise_or.reduce(values))
        everywhere = int(np.bitwise_and.reduce(values)) if anywhere else 0
        marked = values[values != 0] if anywhere else values
        return {
            name: len(values) if everywhere & bit else int(np.count_nonzero(marked & values.dtype.type(bit)))
            for name, bit in self.items()
            if anywhere & bit
        }


@dataclass(frozen=True)
class Variable:
    """One variable of a result file.

    dims: names of its dimensions. dtype: a NumPy type with its size, or TEXT.
    units, long_name: as in the CF conventions; attributes: further ones.
    coordinate: whether it describes points of a dimension and is no result itself.
    missing: what stands where nothing was computed; default NaN, or 0 for integers.
    index_of: the dimension along which the values are positions, "" for none.
    """

    name: str
    dims: tuple[str, ...]
    dtype: str
    units: str
    long_name: str
    attributes: Mapping[str, Any] = field(default_factory=dict)
    coordinate: bool = False
    missing: float | int | None = None
    index_of: str = ""

    @property
    def fill(self) -> float | int:
        """Value where nothing was computed."""
        return self.missing if self.missing is not None else nan if self.dtype[0] in "fc" else 0

    @property
    def of_parts(self) -> bool:
        """Whether its first dimension are parts of the range, of which rows have different numbers."""
        return not {STRETCH, PIECE}.isdisjoint(self.dims) or self.dims[:1] == ("branch",)

    @property
    def listed(self) -> bool:
        """Whether its first dimension is a list that differs from row to row: of tongues, or of parts of the range."""
        return "tongue" in self.dims or self.of_parts

    @property
    def lead(self) -> int:
        """Number of dimensions before the axes of the sweep."""
        return next((k for k, dim in enumerate(self.dims) if dim in (GRID, ROWS)), 0)

    def over(self, grid: Sequence[str], rows: Sequence[str]) -> Variable:
        """The variable with GRID and ROWS replaced by the names of a sweep's axes."""
        known = {GRID: tuple(grid), ROWS: tuple(rows)}
        return replace(self, dims=tuple(name for dim in self.dims for name in known.get(dim, (dim,))))


def flagged(variables: Sequence[Variable], flags: Mapping[str, int]) -> tuple[Variable, ...]:
    """The variables of a table, those of flags (``status``, ``notices``) with their names and bits."""
    said = Flags(flags).attributes
    return tuple(replace(v, attributes=said) if v.name in ("status", "notices") else v for v in variables)


def coordinate(name: str, dim: str, dtype: str, units: str, long_name: str) -> Variable:
    """A variable that describes the points of a dimension; the dimension's own coordinate if it has its name."""
    return Variable(name, (dim,), dtype, units, long_name, coordinate=True)


DOF = (
    coordinate("dof", "dof", TEXT, "1", "coordinate of the model"),
    coordinate("dof_units", "dof", TEXT, "1", "unit of the coordinate"),
)

MODES = (
    coordinate("mode", "mode", "i4", "1", "number of the mode, by ascending natural frequency"),
    *DOF,
    coordinate("mesh", "mesh", TEXT, "1", "tooth mesh"),
    Variable("natural_frequency", ("mode",), "f8", "rad/s", "natural frequency of the mean system"),
    Variable("mode_shape", ("mode", "dof"), "f8", "kg^-1/2", "mode shape, normalised by the mass matrix"),
    Variable("mesh_deflection", ("mode", "mesh"), "f8", "kg^-1/2", "modal mesh deflection"),
    Variable("mode_type", ("mode",), TEXT, "1", "type of the mode"),
)

NATURAL_FREQUENCIES = (
    coordinate("mode", "mode", "i4", "1", "number of the mode, by ascending natural frequency"),
    *DOF,
    Variable("natural_frequency", (ROWS, "mode"), "f8", "rad/s", "natural frequency of the mean system"),
    Variable("mode_shape", (ROWS, "mode", "dof"), "f8", "kg^-1/2", "mode shape, normalised by the mass matrix"),
)
"""The same over the axes of a sweep."""

DAMPED = "damped natural frequency of the whole mean system, with damping and the means of its terms"
SYMMETRIC_PART = "natural frequency of the symmetric mean system, without damping and terms"


def _with_terms(table: Sequence[Variable]) -> tuple[Variable, ...]:
    """Return a table of modes of a system with terms: damped frequencies, and those that belong to the shapes."""
    damped = tuple(replace(v, long_name=DAMPED) if v.name == "natural_frequency" else v for v in table)
    known = next(v for v in table if v.name == "natural_frequency")
    return (*damped, replace(known, name="symmetric_frequency", long_name=SYMMETRIC_PART))


MODES_WITH_TERMS = _with_terms(MODES)
NATURAL_FREQUENCIES_WITH_TERMS = _with_terms(NATURAL_FREQUENCIES)

WHIRL = (
    coordinate("mode", "mode", "i4", "1", "number of the mode, by ascending natural frequency at the lowest speed"),
    Variable("natural_frequency", (GRID, "mode"), "f8", "rad/s", "damped natural frequency of the mean system, followed"
             " over the speed by shape"),
    Variable("growth_rate", (GRID, "mode"), "f8", "1/s", "growth rate of the motion without any variation"),
    Variable("damping_ratio", (GRID, "mode"), "f8", "1", "damping ratio of the motion"),
    Variable("whirl", (GRID, "mode"), "i1", "1", "sense of the orbits of bodies, in the coordinates of the model",
             {"flag_values": [-1, 0, 1], "flag_meanings": "backward neither forward"}),
    Variable("veering", (GRID, "mode"), "i1", "1", "whether the motion is nearest to another one and takes its shape",
             {"flag_values": [0, 1], "flag_meanings": "no yes"}),
)  # fmt: skip
"""Motions of a system whose speeds of rotation follow the mesh frequency."""

MODES_OVER_SPEED = (
    coordinate("speed", "speed", "f8", "rad/s", "mesh frequency"),
    *(
        replace(v, name=v.name.removeprefix("natural_"), dims=("speed", "mode"))
        for v in WHIRL
        if v.name in ("natural_frequency", "damping_ratio", "whirl")
    ),
)
"""The same in the group ``/modes``, for the base values of the configuration."""

DEFLECTION_TYPE = Variable(
    "mesh_deflection_type", ("mode",), "i4", "1", "T of mesh deflections that go round as cos T psi, else -1"
)
"""Variable of systems with cyclic symmetry."""

STABLE_FLAGS = {"flag_values": [-1, 0, 1], "flag_meanings": "failed unstable stable"}

FLOQUET = (
    Variable("growth_rate", (GRID,), "f8", "1/s", "largest real part of the characteristic exponents"),
    Variable("stable", (GRID,), "i1", "1", "stability, rigid-body modes that do not grow left out", STABLE_FLAGS),
    Variable("status", (GRID,), "i2", "1", "how the stability was decided"),
)

CERTIFIED = Variable("certified", (GRID,), "i1", "1", "whether the stability is proved in ball arithmetic")
"""With ``certificate``."""

EXPONENTS = (
    coordinate("exponent", "exponent", "i4", "1", "number of the characteristic exponent, by descending real part"),
    Variable("exponent_real", (GRID, "exponent"), "f8", "1/s", "real part of the characteristic exponent"),
    Variable("exponent_imag", (GRID, "exponent"), "f8", "rad/s", "imaginary part of the characteristic exponent"),
)

ERROR_ESTIMATE = Variable(
    "error_estimate", (GRID,), "f8", "1",
    "estimated error of the Floquet multipliers, relative to the largest of them or 1",
)  # fmt: skip
"""Where propagation over a period is not exact: of waves that are not piecewise constant, and of further terms."""

BY_MESH = (
    coordinate("mesh", "mesh", TEXT, "1", "tooth mesh; meshes of one frequency vary together"),
    Variable("growth_rate_mesh", (GRID, "mesh"), "f8", "1/s", "growth rate while all meshes of other frequencies keep "
             "their mean stiffness"),
)  # fmt: skip
"""Variables of one mesh frequency at a time."""

INTERVAL = (
    Variable("growth_rate_interval", (GRID,), "f8", "1/s", "half-width of the confidence interval of the growth rate"),
)
"""Variables of estimated growth rates."""

ORBITS = (
    Variable("speed_exponent", (GRID,), "f8", "1/s", "characteristic exponent of the mean speed of the orbit, left out "
             "of the growth rate"),
    Variable("holding_torque", (GRID,), "f8", "N m", "unbalanced torque that holds the mean speed of the orbit"),
)  # fmt: skip
"""Variables of periodic orbits of gear pairs."""

REQUIRED_DAMPING = (
    Variable("required_damping", (GRID,), "f8", "1", "damping from which on the system is stable"),
    Variable("status", (GRID,), "i2", "1", "how the required damping was found"),
)
"""Damping ratio of all modes, or factor on the damping."""

PROBABILITY = (
    Variable("probability", (GRID,), "f8", "1", "probability of instability"),
    Variable("probability_lower", (GRID,), "f8", "1", "lower end of the 95 % interval of the probability"),
    Variable("probability_upper", (GRID,), "f8", "1", "upper end of the 95 % interval of the probability"),
    Variable("status", (GRID,), "i2", "1", "how the stability of any of the samples was decided"),
)
"""Variables of a system whose parameters are uncertain."""

SOBOL = (
    coordinate("parameter", "parameter", TEXT, "1", "uncertain parameter"),
    Variable("sobol_first", (GRID, "parameter"), "f8", "1", "first-order Sobol index of instability"),
    Variable("sobol_total", (GRID, "parameter"), "f8", "1", "total Sobol index of instability"),
    Variable("sobol_first_interval", (GRID, "parameter"), "f8", "1", "half-width of the 95 % interval of sobol_first"),
    Variable("sobol_total_interval", (GRID, "parameter"), "f8", "1", "half-width of the 95 % interval of sobol_total"),
)
"""Which parameter is to blame; NaN where the probability is near 0 or 1."""

PASSAGE = (
    coordinate("rate", "rate", "f8", "rad/s^2", "change of the mesh frequency, or input speed, in time"),
    Variable("growth", (ROWS, "rate"), "f8", "1", "e-folds of the amplitude between any two moments, by growth rates"),
    Variable("growth_exact", (ROWS, "rate"), "f8", "1", "e-folds of the amplitude between any two moments, exactly"),
    Variable("growth_error", (ROWS, "rate"), "f8", "1", "estimated difference of growth and growth_exact"),
    Variable("growth_through", (ROWS, "rate"), "f8", "1", "e-folds of the amplitude from the first moment to the last"),
    Variable("status", (ROWS, "rate"), "i2", "1", "what became of the passage; 0: nothing to say"),
    Variable("slowest_rate", (ROWS,), "f8", "rad/s^2", "least rate that passes with the given amplification"),
    Variable("slowest_rate_exact", (ROWS,), "f8", "rad/s^2", "the same of the exact motion"),
    Variable("growth_by_tongue", ("tongue", ROWS, "rate"), "f8", "1", "e-folds gained in the instability region"),
    Variable("dwell_frequency", ("tongue", ROWS), "f8", "rad/s", "mesh frequency of the fastest growth in the region"),
    Variable("dwell_growth_rate", ("tongue", ROWS), "f8", "1/s", "growth rate there"),
)
"""Variables of run-ups and coast-downs."""

TONGUE = (
    coordinate("mode_p", "tongue", "i4", "1", "first mode of the instability"),
    coordinate("mode_q", "tongue", "i4", "1", "second mode of the instability"),
    coordinate("harmonic", "tongue", "i4", "1", "harmonic of the mesh stiffness that drives the instability"),
    coordinate("mesh", "tongue", TEXT, "1", "meshes that drive the instability"),
    coordinate("kind", "tongue", TEXT, "1", "kind of the instability"),
    coordinate("label", "tongue", TEXT, "1", "mesh frequency at the root of the instability region"),
    coordinate("frequency_ratio", "tongue", "f8", "1", "excitation frequency over mesh frequency"),
)
"""Which instability region a point of the dimension ``tongue`` is."""

SIDE = coordinate("side", "side", TEXT, "1", "lower or upper boundary")

BOUNDARY = Variable("boundary_frequency", ("tongue", "side", ROWS), "f8", "rad/s", "mesh frequency at the boundary")

OCCURRENCE = coordinate("occurrence", "tongue", "i4", "1", "number, from 0, of a region among those with the same root")

TONGUE_PROBABILITY = (
    Variable("tongue_probability", ("tongue", ROWS), "f8", "1", "probability that the region reaches into the range"),
    Variable("tongue_probability_lower", ("tongue", ROWS), "f8", "1", "lower end of the 95 % interval of it"),
    Variable("tongue_probability_upper", ("tongue", ROWS), "f8", "1", "upper end of the 95 % interval of it"),
)  # fmt: skip

SAMPLED = (
    Variable(
        "sampled_step", (ROWS,), "f8", "1", "distance of samples in what is neither proved nor counted, relative to it",
        {"comment": "0 where everything is proved or counted"},
    ),
    Variable("coarse", (ROWS,), "i4", "1", "number of systems that were sampled there in equal steps only"),
)  # fmt: skip

EXACT = (
    SIDE,
    BOUNDARY,
    Variable("tolerance", ("tongue", ROWS), "f8", "1", "half of the bracket around the boundaries, relative to them"),
    Variable("status", ("tongue", ROWS), "i2", "1", "what became of the tongue"),
    Variable(
        "holder", ("tongue", ROWS), "i4", "1", "tongue under which the region stands that this tongue lies in",
        {"comment": "position along the dimension tongue, from 0, or -1; the region of merged tongues stands once"},
        missing=-1, index_of="tongue",
    ),
    Variable("contacts", (ROWS,), "i4", "1", "collisions of multipliers without a region as wide as the width floor"),
    Variable("evaluations", (ROWS,), "i4", "1", "monodromy matrices computed, and proofs tried"),
    Variable(
        "proved_share", (ROWS,), "f8", "1", "share of the stable mesh frequencies that is proved stable",
        {"comment": "by Lyapunov functions, in floating point, without interval arithmetic"},
    ),
    Variable(
        "counted_share", (ROWS,), "f8", "1", "share of them that is searched by counting only",
        {"comment": "collisions of multipliers, or bumps of the growth rate with a step that damping sets"},
    ),
    Variable(
        "proved_frequency", (STRETCH, "side", ROWS), "f8", "rad/s", "ends of a stretch proved stable",
        {"comment": "gaps narrower than the width floor are bridged"},
    ),
    *SAMPLED,
)  # fmt: skip

CERTIFICATES = (
    coordinate("entry", "entry", TEXT, "1", "number of a certificate"),
    Variable("certificate_frequency", (PIECE, "side", ROWS), "f8", "rad/s", "ends of a piece with a certificate"),
    Variable(
        "certificate", (PIECE, ROWS, "entry"), "f4", "1", "what proves a piece, see docs/certificates.md",
        {"comment": "outside 0: stable, else unstable; rate 0: by an invariant form, else by one that grows or decays"},
    ),
    Variable("certified_share", (ROWS,), "f8", "1", "share of the mesh frequencies with a certificate"),
    Variable("uncertified_width", (ROWS,), "f8", "1", "widest part without one, relative to the mesh frequency"),
    Variable(
        "uncertified_at_boundary", ("tongue", "side", ROWS), "f8", "1", "width without one around a boundary, relative"
    ),
)  # fmt: skip
"""Claims that ``gearstab verify`` proves."""

FIRST_ORDER = (
    SIDE,
    BOUNDARY,
    Variable(
        "center_frequency", ("tongue", ROWS), "f8", "rad/s", "mesh frequency at the root of the instability region"
    ),
    Variable("half_width", ("tongue", ROWS), "f8", "rad/s", "half of the unstable range of mesh frequency"),
    Variable("threshold", ("tongue", ROWS), "f8", "1", "factor on every epsilon at which the region opens"),
)

SECOND_ORDER = (
    *FIRST_ORDER,
    Variable(
        "first_order_boundary_frequency", ("tongue", "side", ROWS), "f8", "rad/s",
        "mesh frequency at the boundary to first order",
    ),
    Variable(
        "boundary_error", ("tongue", "side", ROWS), "f8", "rad/s", "estimated error of the boundary",
        {"comment": "of the size of the third-order terms; no bound"},
    ),
    Variable("status", ("tongue", ROWS), "i2", "1", "whether the boundaries can be trusted"),
)  # fmt: skip

BENCH = (
    coordinate("method", "setting", TEXT, "1", "method"),
    coordinate("tolerance", "setting", "f8", "1", "relative tolerance asked for (NaN: an exact method)"),
    Variable("seconds", ("setting",), "f8", "s", "median time per point"),
    Variable("error", ("setting",), "f8", "1", "largest error of the growth over one common period"),
    Variable("wrong_flags", ("setting",), "i4", "1", "reference points with a wrong stability flag"),
)
"""Variables of a benchmark."""
