"""Tooth meshes: the sections that describe their stiffness, how much it varies and when, and what they build."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from gearstab.config.model.conflicts import Conflict, at_most_one, exactly_one, within
from gearstab.config.model.fields import (
    AnyRatio,
    ByCoordinate,
    Choice,
    ContactRatio,
    Flag,
    NameText,
    NonNegative,
    NonNegativeLength,
    Quantity,
    Section,
    ShortName,
    Stiffness,
    Turns,
    optional,
)
from gearstab.config.model.reading import known
from gearstab.mesh import Mesh
from gearstab.system import Array
from gearstab.systems.forcing import TransmissionError
from gearstab.waveforms.section import (
    WaveformSection,
    build_waveform,
    has_no_ratio,
    has_own_mean,
    shape_conflicts,
    wave_of,
)

MeshStiffness = Annotated[float, Field(gt=0), Quantity("N/m", ("N m",))]
"""Mesh stiffness of a model in coordinates of its own, where a mesh may deflect as an angle."""
Direction = Annotated[list[Annotated[float, Quantity("m", entry=True)]], Field(min_length=1), ByCoordinate()]

WHERE_PHASINGS = "two_stage has a phasing of its second mesh, matrices have lags, planetary has phases"
WHERE_LAGS = "matrices have lags, two_stage has a phasing of its second mesh, planetary has phases"
Lag = Annotated[Turns, ShortName(but_first=True, hint=WHERE_LAGS)]

MEANS = ("mean_stiffness", "max_stiffness", "stiffness_per_width")
"""Ways to give the mean stiffness, of which a mesh takes one."""
DAMPINGS = ("damping", "damping_ratio")
"""Ways to give the damping."""
ZEROS = ("middle", "drive_side")
"""Where in its backlash the deflection of a mesh is zero."""


class Named(Section):
    """Something in a list that is called by a name."""

    name: NameText
    """Name of the mesh in paths, labels and messages; unique."""


class ToothMesh(Section):
    """A tooth mesh: a spring whose stiffness alternates between floor(c) and floor(c) + 1 pairs of teeth."""

    mean_stiffness: Stiffness | None = optional("mean mesh stiffness")
    """Mean stiffness k_g, kept (N/m); or give max_stiffness."""
    max_stiffness: Stiffness | None = optional("stiffer level of the mesh stiffness")
    """The stiffer level k_max, kept (N/m), so that k_g falls as k_a grows; or give mean_stiffness."""
    epsilon: Annotated[NonNegative, ShortName(rival="amplitude")] | None = optional("relative mesh stiffness variation")
    """epsilon = k_a/k_g, where 2 k_a is the peak-to-peak of the variation (1); or give amplitude."""
    amplitude: Annotated[float, Field(ge=0), Quantity("N/m"), ShortName(rival="epsilon")] | None = optional(
        "mesh stiffness amplitude"
    )
    """k_a, half the peak-to-peak of the variation (N/m); or give epsilon."""
    contact_ratio: Annotated[ContactRatio, ShortName(hint="their waveforms have none")] | None = None
    """c >= 1: floor(c) + 1 pairs of teeth carry for the fraction c - floor(c) of the period (1)."""
    waveform: WaveformSection = WaveformSection(kind="rectangular")
    """The shape of the variation over a mesh period."""
    damping: Annotated[float, Field(ge=0), Quantity("N s/m")] | None = optional("mesh damping")
    """Viscous damping along the line of action (N s/m)."""
    damping_follows_stiffness: Flag = False
    """The mesh damping d varies as the mesh stiffness does, d k(t)/k_g, instead of being constant."""
    transmission_error: TransmissionError | None = None
    """Unloaded static transmission error e: the mesh is without force where its deflection is e (m)."""
    backlash: NonNegativeLength | None = None
    """2 b, the play between the flanks along the line of action (m), for respond; none without."""
    backlash_zero: Annotated[str, Choice("zero of the deflection", ZEROS)] = Field(
        default="middle", title="zero of the deflection in the backlash"
    )
    """middle of the backlash, or drive_side: where the flank that carries the load just touches."""

    def conflicts(self, from_teeth: bool = False) -> Iterator[Conflict]:
        """One of the two ways to give the stiffness, and of the two to give its variation, unless the wave does.

        from_teeth: whether teeth give what the mesh does not.
        """
        wave = wave_of(self.waveform)
        if from_teeth:
            yield from given_by_teeth(self)
        elif wave is not None and wave.of_teeth:
            message = "the teeth are unknown: a gearbox, or a planetary gear with gears, has them"
            hint = "choose another waveform, or describe the gears in a gearbox"
            yield ("waveform", "kind"), "not_applicable", message, hint
            return
        known_keys, variation = type(self).model_fields, ("epsilon", "amplitude")
        means, dampings = (tuple(key for key in keys if key in known_keys) for keys in (MEANS, DAMPINGS))
        yield from (at_most_one if from_teeth or has_own_mean(self) else exactly_one)(self, means)
        yield from at_most_one(self, dampings)
        varies = from_teeth or (wave is not None and wave.own_variation)
        yield from (at_most_one if varies else exactly_one)(self, variation)
        yield from shape_conflicts(self, complete=not from_teeth)
        hint = f"add {' or '.join(dampings)}, the mean of the damping that follows the stiffness"
        yield from known(following_conflicts(self, dampings, hint))
        yield from within(self, "transmission_error", TransmissionError.conflicts)


class StiffnessOfTeeth(Section):
    """Measured features of a stiffness that follows from the teeth, and how their pairs add up."""

    double_contact_factor: Annotated[float, Field(gt=0.5, le=1), Quantity()] | None = None
    """Stiffness of two pairs of teeth over the sum of theirs (1), as teeth on one body deflect each other; 1
    without."""
    single_pair_stiffness: Stiffness | None = optional("measured stiffness of a pair")
    """Stiffness of a pair of teeth in contact at the pitch point (N/m); of an internal gear, all along the path."""
    variation: NonNegative | None = optional("measured variation")
    """Variation (max k - min k)/mean k of the mesh stiffness of teeth (1)."""


def given_by_teeth(mesh: ToothMesh) -> Iterator[Conflict]:
    """Yield what the wave of the teeth gives by itself."""
    wave = wave_of(mesh.waveform)
    if wave is None or not wave.of_teeth:
        return
    for key in ("mean_stiffness", "max_stiffness", "stiffness_per_width", "epsilon", "amplitude", "contact_ratio"):
        if getattr(mesh, key, None) is not None:
            remedy = "remove it, or choose waveform: {kind: rectangular}; measured values are "
            yield (key,), "already_given", "the teeth give it", f"{remedy}single_pair_stiffness and variation"


def following_conflicts(mesh: ToothMesh, keys: Sequence[str], hint: str) -> Iterator[Conflict]:
    """Yield what contradicts a damping that follows the stiffness.

    keys: those that may give the damping; hint: what to do where none does.
    """
    if mesh.damping_follows_stiffness is not True:
        return
    if all(mesh[key] is None for key in keys):
        yield ("damping",), "missing", "is missing", hint
    if mesh.transmission_error is not None:
        message = "is given, and a damping that follows the stiffness"
        yield ("transmission_error",), "needs_other", message, "keep one of the two, or make the damping constant"


class NamedToothMesh(ToothMesh, Named):
    """A tooth mesh with a name of its own."""

    misplaced: ClassVar[dict[str, str]] = {
        "phasing": "only the second mesh of a two_stage train has a phasing; in matrices give a lag",
        "lag": "only a mesh of matrices has a lag; the second mesh of a two_stage train has a phasing (a lead)",
    }


class SecondMesh(NamedToothMesh):
    """The second mesh of a two-stage train."""

    misplaced: ClassVar[dict[str, str]] = {"lag": "give a phasing, which is a lead: phasing = -lag"}

    phasing: Annotated[Turns, ShortName(but_first=True, hint=WHERE_PHASINGS)] = Field(default=0.0, title="mesh phasing")
    """h: this mesh leads the first one by h of its own period (1; Lin & Parker 2002)."""


class MatrixMesh(NamedToothMesh):
    """A tooth mesh of a model given as matrices."""

    misplaced: ClassVar[dict[str, str]] = {"phasing": "give a lag, the opposite of a lead: lag = -phasing"}

    mean_stiffness: MeshStiffness | None = optional("mean mesh stiffness")
    """Mean stiffness k_g, kept (N/m, or N m/rad of an angle); or give max_stiffness."""
    max_stiffness: MeshStiffness | None = optional("stiffer level of the mesh stiffness")
    """The stiffer level k_max, kept (N/m, N m/rad), so that k_g falls with k_a; or give mean_stiffness."""
    amplitude: Annotated[float, Field(ge=0), Quantity("N/m", ("N m",))] | None = optional("mesh stiffness amplitude")
    """k_a, half the peak-to-peak of the variation (N/m or N m/rad); or give epsilon."""
    damping: Annotated[float, Field(ge=0), Quantity("N s/m", ("N m s",))] | None = optional("mesh damping")
    """Viscous damping of the mesh deflection (N s/m or N m s/rad)."""
    backlash: Annotated[float, Field(ge=0), Quantity("m", ("rad",))] | None = None
    """2 b, the play of the mesh deflection (m, or rad of an angle), for respond; none without."""
    direction: Direction
    """g, the mesh deflection is g . q: 1 for a translation, a base radius (m) for a rotation."""
    exact: Flag = Field(default=True, title="exact frequency ratio")
    """false: frequency_ratio is a decimal that stands for an irrational number."""
    frequency_ratio: AnyRatio = Field(default=Fraction(1), title="mesh frequency ratio")
    """Frequency of this mesh over that of the sweep, exact: 1, 0.5 or "1/2"; see exact."""
    lag: Lag = Field(default=0.0, title="mesh lag")
    """The wave begins this fraction of its own period late (1)."""


def may_have(name: str, short: ShortName, place: str | int, mesh: ToothMesh) -> bool:
    """Return whether a mesh, at an index or key, may have the number of a short name."""
    if place == 0 and short.but_first:
        return False
    return getattr(mesh, short.rival, None) is None and not (name == "contact_ratio" and has_no_ratio(mesh))


def build_mesh(p: Any, direction: Array, frequency_ratio: Fraction | float = Fraction(1), lag: Any = 0.0) -> Mesh:
    """Return the mesh of the given parameters.

    The stiffness is given by ``mean_stiffness`` k_g or ``max_stiffness`` k_max (the stiffer level is kept, Lin & Parker
    2002 section 4: k_g = k_max - 2 k_a (1 - d)), its variation by ``epsilon`` = k_a/k_g or ``amplitude`` = k_a; what is
    not given is that of a ``waveform`` made from stiffnesses, or of the ``wave`` itself, which teeth give.
    """
    wave = getattr(p, "wave", None) or build_waveform(p.waveform, p.contact_ratio)
    epsilon, amplitude, maximum = p.epsilon, p.amplitude, p.max_stiffness
    if epsilon is None and amplitude is None:
        # 0 where the mean is, which is an error that the configuration reports.
        divisor = np.where(wave.mean_stiffness != 0, wave.mean_stiffness, np.inf)
        epsilon = wave.amplitude / divisor
    if maximum is not None:
        # A wave that keeps its stiffer level does so for an integer contact ratio too, where it is never reached.
        maximum, above = np.asarray(maximum, dtype=float), wave.stiffer_level
        if amplitude is not None:
            mean = maximum - 2 * np.asarray(amplitude) * above
        else:
            mean = maximum / (1 + 2 * np.asarray(epsilon) * above)
    elif p.mean_stiffness is not None:
        mean = np.asarray(p.mean_stiffness, dtype=float)
    else:
        mean = wave.mean_stiffness
    if amplitude is not None:
        epsilon = np.asarray(amplitude) / mean
    return Mesh(getattr(p, "name", ""), direction, mean, np.asarray(epsilon, dtype=float), wave, frequency_ratio, lag)
