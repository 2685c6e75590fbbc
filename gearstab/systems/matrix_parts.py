"""Parts of a model of matrices: files and vectors by coordinate, periodic terms, what acts with a speed of rotation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path as FilePath
from typing import Annotated, Any

import numpy as np
from pydantic import Field, StrictStr

from gearstab.config.document import Document, Path, nearest, sequence, value_at
from gearstab.config.model import matrix, vector
from gearstab.config.model.conflicts import Conflict, exactly_one, items, no_direction, within
from gearstab.config.model.fields import (
    AnyRatio,
    ContactRatio,
    Flag,
    NameText,
    Quantity,
    Ratio,
    Section,
    Turns,
    Vector,
    optional,
)
from gearstab.config.model.files import DataFileError, arrays, numbers, present, usable
from gearstab.errors import one_line
from gearstab.mesh import PeriodicTerm, Rotation
from gearstab.system import Array
from gearstab.systems.feasibility import worst_entry
from gearstab.systems.forcing import not_square
from gearstab.waveforms import Constant, Profile, Scaled
from gearstab.waveforms.section import WaveformSection, build_waveform, shape_conflicts, wave_of

REQUIRED = ("mass", "stiffness")
OF_ROTATION = ("gyroscopic", "centripetal", "circulatory")
"""They belong to the first entry of ``rotation``."""
OPTIONAL = ("damping", *OF_ROTATION)
SYMBOLS = {"mass": "M", "stiffness": "K", "damping": "C", "gyroscopic": "G"}
"""Other names of the matrices in a file."""
SUFFIXES = (".npz", ".h5", ".hdf5", ".mat")
MARKET = (".mtx", ".mm")
MOST_COORDINATES = 4000
"""A matrix of so many takes 128 MB."""


class MatrixFiles(Section):
    """A Matrix Market file for each matrix."""

    mass: StrictStr = Field(title="file of the mass matrix")
    """A Matrix Market file (.mtx)."""
    stiffness: StrictStr = Field(title="file of the stiffness matrix")
    """A Matrix Market file (.mtx)."""
    damping: StrictStr | None = optional("file of the damping matrix")
    """A Matrix Market file (.mtx)."""
    gyroscopic: StrictStr | None = optional("file of the gyroscopic matrix")
    """A Matrix Market file (.mtx)."""
    centripetal: StrictStr | None = optional("file of the centripetal matrix")
    """A Matrix Market file (.mtx)."""
    circulatory: StrictStr | None = optional("file of the circulatory matrix")
    """A Matrix Market file (.mtx)."""


def read_market(path: FilePath) -> Array:
    """The matrix ``(n, n)`` of a Matrix Market file, filled. Raises DataFileError."""
    from scipy.io import mminfo, mmread

    usable(path, "Matrix Market (.mtx)", MARKET)
    try:
        rows, columns, _, _, kind, _ = mminfo(path)
        held = mmread(path) if max(rows, columns) <= MOST_COORDINATES and kind != "pattern" else None
    except Exception as error:  # whatever a broken file makes the reader raise
        raise DataFileError(f"cannot be read: {one_line(error)}", "save the matrix again") from None
    if rows != columns or not 0 < rows <= MOST_COORDINATES:
        hint = f"save a square matrix of at most {MOST_COORDINATES} rows"
        raise DataFileError(f"holds a matrix of the shape {(rows, columns)}", hint)
    if held is None:
        raise DataFileError("holds a pattern without numbers", "save real numbers")
    return numbers("the matrix", held)


def read_matrices(path: FilePath) -> dict[str, Array]:
    """Return ``mass``, ``stiffness`` and, if given, OPTIONAL ones as float arrays (n, n).

    They may be called M, K, C and G. Sparse matrices of a .mat file are filled. Raises DataFileError.
    """
    if path.suffix.lower() in MARKET:
        hint = "write files: {mass: M.mtx, stiffness: K.mtx, damping: C.mtx}"
        raise DataFileError("is a Matrix Market file, which holds one matrix", hint)
    usable(path, ".npz, .h5 or .mat", SUFFIXES)
    found = arrays(path, (*REQUIRED, *OPTIONAL, *SYMBOLS.values()), MOST_COORDINATES)
    for name, symbol in SYMBOLS.items():
        if found.get(symbol) is not None:
            if found.get(name) is not None:
                raise DataFileError(f"holds {name} and {symbol}, which mean the same", "keep one of the two")
            found[name] = found[symbol]
    missing = [name for name in REQUIRED if found.get(name) is None]
    if missing:
        message = f"holds no {' and no '.join(missing)}"
        raise DataFileError(message, f"it needs mass and stiffness (or M and K), and holds {present(found)}")
    result = {name: numbers(name, found[name]) for name in REQUIRED + OPTIONAL if found.get(name) is not None}
    check_shapes(result)
    return result


def check_shapes(result: Mapping[str, Array]) -> None:
    """Raise DataFileError unless all matrices are square, of the shape of ``mass`` and with both triangles."""
    for name, values in result.items():
        if values.ndim != 2 or values.shape[0] != values.shape[1] or values.shape[0] == 0:
            raise DataFileError(f"{name} has the shape {values.shape}", "save a square matrix")
        if np.any(np.triu(values, 1)) != np.any(np.tril(values, -1)):
            raise DataFileError(f"{name} has entries on one side of its diagonal alone", "save both triangles")
    shape = result["mass"].shape
    for name, values in result.items():
        if values.shape != shape:
            raise DataFileError(f"{name} has the shape {values.shape}, mass {shape}", "make them equal")


SECTIONS = {"meshes": ("direction",), "forces": ("direction",), "terms": ("left", "right")}
"""Lists of the section ``system`` and the vectors of their entries; ``load`` is one by itself."""


def write_out(document: Document, raw: dict[str, Any], size: int | None) -> None:
    """Replace every such mapping by the list of its entries, zero where it names none; report unknown coordinates.

    size: number of coordinates. If it is unknown, which is reported elsewhere, the entries stand for all.
    """
    named: Any = raw.get("coordinates")
    known = named if len(sequence(named)) == size else default_names(size or 0)
    for holder, key, path in list(_mappings(raw)):
        given = holder[key]
        names = known if size is not None else list(given)
        values: list[Any] = [0.0] * len(names)
        for name, value in given.items():
            if name in names:
                values[names.index(name)] = value
                document.move(("system", *path, name), ("system", *path, names.index(name)))
            else:
                message = "there is no such coordinate"
                hint = nearest(name, map(str, names))
                document.report(("system", *path, name), "unknown_name", message, hint, at_key=True)
        holder[key] = values


def default_names(size: int) -> list[str]:
    """Return the names of coordinates that are given none: q1, q2, ..."""
    return [f"q{i + 1}" for i in range(size)]


def _mappings(raw: dict[str, Any]) -> Iterator[tuple[dict[str, Any], str, Path]]:
    """Yield the section that holds each vector written so, its key there, and its path below ``system``."""
    if isinstance(raw.get("load"), dict):
        yield raw, "load", ("load",)
    for section, keys in SECTIONS.items():
        for i, item in enumerate(sequence(raw.get(section))):
            for key in keys:
                if isinstance(value_at(item, (key,)), dict):
                    yield item, key, (section, i, key)


SKEW = 1e-12
"""Part of the largest entry of a matrix below which what keeps it from being symmetric, or skew, is rounding."""

OfStiffness = Annotated[float, Quantity("N/m", ("N", "N m"), entry=True)]
OfDamping = Annotated[float, Quantity("N s/m", ("N s", "N m s"), entry=True)]


class VaryingNumber(Section):
    """A number that may vary periodically, mean + 2 amplitude w(x)."""

    contact_ratio: ContactRatio | None = optional("contact ratio of a term")
    """c >= 1, of a waveform that has one (1)."""
    waveform: WaveformSection | None = optional("waveform of a term")
    """w, rectangular without, where there is an amplitude."""

    def conflicts(self) -> Iterator[Conflict]:
        """A mean or an amplitude, and a waveform that is complete where anything varies."""
        wave = wave_of(self.waveform)
        amplitude = self["amplitude"]
        if amplitude is None and self.contact_ratio is None and self.waveform is None:
            if self["mean"] is None:
                yield (), "missing", "has neither mean nor amplitude", "add mean, or amplitude and waveform"
            return
        if wave is not None and wave.of_teeth:
            hint = "choose another waveform, such as fourier or sampled"
            yield ("waveform", "kind"), "not_applicable", "a term has no teeth", hint
            return
        if amplitude is None and wave is not None and not wave.own_variation:
            yield ("amplitude",), "missing", "is missing", "add amplitude: half the peak-to-peak of the variation"
        yield from shape_conflicts(self)


class StiffnessPart(VaryingNumber):
    """The stiffness of a term."""

    mean: OfStiffness | None = optional("mean stiffness of a term")
    """Its mean (N/m); 0 or that of the samples without."""
    amplitude: OfStiffness | None = optional("stiffness amplitude of a term")
    """Half the peak-to-peak of its variation (N/m); constant, or that of the samples, without."""


class DampingPart(VaryingNumber):
    """The damping of a term."""

    mean: OfDamping | None = optional("mean damping of a term")
    """Its mean (N s/m); 0 or that of the samples without."""
    amplitude: OfDamping | None = optional("damping amplitude of a term")
    """Half the peak-to-peak of its variation (N s/m); constant, or that of the samples, without."""


class Term(Section):
    """a(x) u v^T in the stiffness matrix and c(x) u v^T in the damping matrix."""

    name: NameText | None = optional("name of the term")
    """Name of the term in paths and messages."""
    left: Vector = Field(title="left vector")
    """u, along which the term acts (1)."""
    right: Vector = Field(title="right vector")
    """v: the term acts on v . q and v . q' (1)."""
    stiffness: StiffnessPart | None = optional("stiffness of a term")
    """a(x): mean, amplitude, waveform."""
    damping: DampingPart | None = optional("damping of a term")
    """c(x): mean, amplitude, waveform."""
    exact: Flag = Field(default=True, title="exact frequency ratio of a term")
    """false: frequency_ratio is a decimal that stands for an irrational number."""
    frequency_ratio: AnyRatio = Field(default=Fraction(1), title="frequency ratio of a term")
    """Its frequency over the mesh frequency of the sweep, exact: 1, 0.5 or "1/2"; see exact."""
    lag: Turns = Field(default=0.0, title="lag of a term")
    """It begins this fraction of its own period late (1)."""

    def conflicts(self, size: int | None) -> Iterator[Conflict]:
        """A stiffness or a damping, and vectors of the size of the system that are not zero."""
        parts = ("stiffness", "damping")
        if all(self[key] is None for key in parts):
            hint = "add stiffness: {mean: ..}, or damping: {mean: ..}"
            yield (), "missing", "has neither stiffness nor damping", hint
        for key in parts:
            yield from within(self, key, lambda part: part.conflicts())
        for key in ("left", "right"):
            yield from no_direction(self, key, size, "let the term act on at least one coordinate")


def periodic_terms(sections: Sequence[Term]) -> tuple[PeriodicTerm, ...]:
    """Return terms.

    Each has ``left`` u, ``right`` v, ``stiffness`` a(x) and ``damping`` c(x) (``mean``, ``amplitude``, ``waveform``,
    ``contact_ratio``: mean + 2 amplitude w(x)), ``frequency_ratio`` and ``lag``, in periods of its own.
    """
    return tuple(
        PeriodicTerm(
            part.name or f"term{i + 1}", vector(part.left), vector(part.right),
            _profile(part.stiffness), _profile(part.damping), part.frequency_ratio, np.asarray(part.lag, dtype=float),
        )
        for i, part in enumerate(sections)
    )  # fmt: skip


def symmetric(matrix: Array) -> Array:
    """Return the symmetric part of a matrix."""
    return 0.5 * (matrix + matrix.T)


def antisymmetric_terms(name: str, part: str, matrix: Array) -> list[dict[str, Any]]:
    """Return the antisymmetric part of a matrix as constant terms s u v^T in plain data; none of rounding.

    name: of the terms. part: ``stiffness`` or ``damping``. Source: the singular value decomposition of a real matrix.
    """
    skew = 0.5 * (matrix - matrix.T)
    if np.abs(skew).max(initial=0.0) <= SKEW * np.abs(matrix).max(initial=0.0):
        return []
    left, sizes, right = np.linalg.svd(skew)
    return [
        {"name": f"{name} {k + 1}", "left": left[:, k], "right": right[k], part: {"mean": sizes[k]}}
        for k in np.flatnonzero(sizes > SKEW * sizes[0])
    ]


def _profile(p: StiffnessPart | DampingPart | None) -> Profile | None:
    if p is None:
        return None
    mean: Any = p.mean
    amplitude: Any = p.amplitude
    if amplitude is None and p.contact_ratio is None and p.waveform is None:
        return Constant(np.asarray(mean, dtype=float))
    wave = build_waveform(p.waveform, p.contact_ratio)
    mean = wave.mean_stiffness if mean is None else mean
    amplitude = wave.amplitude if amplitude is None else amplitude
    return Scaled(wave, np.asarray(mean, dtype=float), 2 * np.asarray(amplitude, dtype=float))


RotatingInertia = Annotated[float, Quantity("kg", ("kg m", "kg m^2"), entry=True)]
Drag = Annotated[float, Quantity("N s/m", ("N s", "N m s"), entry=True)]


class RotationSection(Section):
    """A speed of rotation W, and matrices that act with it: W G q' + (W H + W^2 K) q."""

    speed_ratio: Annotated[Fraction, Ratio(signed=True)] | None = optional("speed ratio of a rotation")
    """W/Omega, exact: "1/25", or -1 for the other sense; or give speed."""
    speed: Annotated[float, Quantity("rad/s")] | None = optional("speed of a rotation")
    """W, held whatever the mesh frequency (rad/s, "1500 rpm"); or give speed_ratio."""
    gyroscopic: list[list[RotatingInertia]] | None = optional("gyroscopic matrix")
    """G in W G q', skew (kg, or kg m^2 of rotations)."""
    centripetal: list[list[RotatingInertia]] | None = optional("centripetal matrix")
    """K in W^2 K q, symmetric and added, so negative where rotation softens (kg, or kg m^2)."""
    circulatory: list[list[Drag]] | None = optional("circulatory matrix")
    """H in W H q, of rotating damping (N s/m, or N m s)."""

    def conflicts(self, size: int | None, of_file: bool) -> Iterator[Conflict]:
        """One speed, and matrices of the size of the system; of_file: whether a file may hold the matrices."""
        yield from exactly_one(self, ("speed_ratio", "speed"))
        if not of_file and all(self[name] is None for name in OF_ROTATION):
            yield (), "missing", "has no matrix", f"add {', '.join(OF_ROTATION[:-1])} or {OF_ROTATION[-1]}"
        for name in OF_ROTATION:
            yield from not_square(self, name, size)


def rotations(sections: Sequence[RotationSection]) -> tuple[Rotation, ...]:
    """Return the rotations that sections describe; a speed ratio of 0 is none."""
    return tuple(
        Rotation(
            part.speed_ratio,
            np.asarray(0.0 if part.speed is None else part.speed, dtype=float),
            **{name: matrix(part[name]) for name in OF_ROTATION if part[name] is not None},
        )
        for part in sections
        if part.speed_ratio != 0
    )


def check_rotation(document: Document, system: Any) -> None:
    """Report gyroscopic matrices that are not skew, and centripetal ones that are not symmetric."""
    table = (("gyroscopic", 1.0, "skew", "-"), ("centripetal", -1.0, "symmetric", ""))
    for place, part in items(system.rotation):
        for name, sign, kind, minus in table:
            if part[name] is None:
                continue
            full = matrix(part[name])
            values = full.reshape(-1, *full.shape[-2:])[0]
            wrong = np.abs(values + sign * values.T)
            if np.max(wrong) <= SKEW * np.max(np.abs(values)):
                continue
            i, j, entries = worst_entry(values, wrong)
            path: Path = ("system", "rotation", place, name, i, j)
            message = f"must be {kind}: {entries}, so {wrong[i, j]:.3g} too much"
            remedy = f"make one {minus}1 times the other; what is left belongs in damping, stiffness or circulatory"
            written = value_at(document.data, path) is not None
            document.report(path if written else ("system", "rotation"), "matrix", message, remedy)
