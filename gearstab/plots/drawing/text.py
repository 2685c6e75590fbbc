"""Axis labels, units and tongue labels as mathematical text."""

from __future__ import annotations

import re
from collections.abc import Mapping
from textwrap import wrap

import matplotlib as mpl

FORMULA = 0xE000
"""First character of the private use area, which stands for formulas while lines are broken."""

SYMBOLS = {
    "mesh_frequency": r"\Omega",
    "epsilon": r"\varepsilon",
    "amplitude": r"k_a",
    "contact_ratio": "c",
    "phasing": "h",
    "lag": r"\alpha",
    "phase": r"\gamma",
    "sun_ring": r"\gamma_{sr}",
    "mean_stiffness": "k_g",
    "max_stiffness": r"k_{\max}",
    "damping_ratio": r"\zeta",
    "tooth_ratio": "R",
    "input_shaft_stiffness": "k_0",
    "inertias": "m",
    "equivalent_mass": "m",
    "time": "t",
}
"""The field's symbol of a parameter or variable, by the last name of its path."""


LATEX = str.maketrans(
    {**{sign: "\\" + sign for sign in "$&%#_{}"}, "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
     "\\": r"\textbackslash{}"}
)  # fmt: skip
"""Signs that mean something to LaTeX, as it prints them."""


def plain(text: str) -> str:
    """Return text that is printed as it stands (a lone dollar would start mathematics)."""
    return text.translate(LATEX) if mpl.rcParams["text.usetex"] else text.replace("$", r"\$")


def symbol(name: str, meshes: Mapping[str, int] | None = None) -> str | None:
    r"""The symbol of an axis, with the element's number: ``meshes.second.epsilon`` gives ``\varepsilon_{2}``.

    meshes: number (from 1) of each mesh by name. Elements of lists count from 0 in paths and from 1 in symbols.
    """
    parts = name.split(".")
    words = [part for part in parts if not part.isdigit()]
    base = SYMBOLS.get(parts[-1]) or (SYMBOLS.get(words[-1]) if words else None)
    if base is None:
        return None
    if len(parts) == 1:
        return base
    element = parts[-1] if parts[-1].isdigit() else parts[-2]
    number = (meshes or {}).get(element)
    if element.isdigit():
        number = int(element) + 1
    if number is None:
        if element in ("meshes", "phases", "system"):
            return base
        return with_index(base, rf"\mathrm{{{element.replace('_', '~')}}}")
    return with_index(base, str(number))


def with_index(base: str, index: str) -> str:
    """A symbol with one more subscript, ``k_g`` and ``2`` to ``k_{g,2}``."""
    stem, _, old = base.partition("_")
    old = old.strip("{}") if not old.startswith("{\\") else old[1:-1]
    return f"{stem}_{{{old + ',' if old else ''}{index}}}"


def unit_text(units: str) -> str:
    """``1/s`` to s^-1, ``kg*m**2`` to kg m^2; empty for dimensionless."""
    units = units.strip().replace("%", plain("%"))
    if units in ("", "1", "dimensionless"):
        return ""
    if units.startswith("1/") and re.fullmatch(r"\w+", units[2:]):
        return rf"$\mathrm{{{units[2:]}}}^{{-1}}$"
    raised = re.sub(r"(\w+)\s*(?:\*\*|\^)\s*\(?(-?\d+(?:/\d+)?)\)?", r"\1$^{\2}$", units)
    return re.sub(r"\s*\*\s*", " ", raised)


def bracketed(units: str) -> str:
    """The unit behind a label, `` (rad/s)``; empty for dimensionless."""
    unit = unit_text(units)
    return f" ({unit})" if unit else ""


def axis_label(name: str, long_name: str, units: str, meshes: Mapping[str, int] | None = None) -> str:
    r"""``mesh frequency $\Omega$ (rad/s)``."""
    math = symbol(name, meshes)
    words = plain(long_name or name.replace("_", " "))
    return words + (f" ${math}$" if math else "") + bracketed(units)


def path_words(path: str) -> str:
    """``meshes.second.phasing`` as ``phasing of second``; what a list holds by its number from 1."""
    *above, name = path.split(".")
    if name.isdigit() and above:
        return f"{above[-1].replace('_', ' ')} {int(name) + 1}"
    words = name.replace("_", " ")
    return f"{words} of {above[-1].replace('_', ' ')}" if len(above) > 1 and not above[-1].isdigit() else words


def short_label(name: str, meshes: Mapping[str, int] | None = None) -> str:
    r"""``$\varepsilon$``, or the plain name of an axis without a symbol."""
    math = symbol(name, meshes)
    return f"${math}$" if math else plain(path_words(name))


def fitted(text: str, inches: float, points: float) -> str:
    """Text broken into the fewest lines of ``inches``, of about equal length; mathematics is never broken."""
    # A Times-like letter is about 0.43 of its size wide.
    letters = max(int(inches * 72 / (0.43 * points)), 8)
    formulas = re.findall(r"(?<!\\)\$[^$]*\$", text)
    words = text
    for number, formula in enumerate(formulas):
        words = words.replace(formula, chr(FORMULA + number) * printed_length(formula), 1)
    most, narrow = len(wrap(words, letters, break_long_words=False)), letters
    while narrow > 8 and len(wrap(words, narrow - 1, break_long_words=False)) == most:
        narrow -= 1
    broken = "\n".join(wrap(words, narrow, break_long_words=False))
    for number, formula in enumerate(formulas):
        broken = broken.replace(chr(FORMULA + number) * printed_length(formula), formula, 1)
    return broken


def printed_length(formula: str) -> int:
    """About how many letters wide a formula prints."""
    return max(len(re.sub(r"\\[a-zA-Z]+", "x", re.sub(r"[${}_^ ]|\\mathrm", "", formula))), 1)


def number_text(value: float) -> str:
    """A number for titles and messages: six digits, no tail of rounding."""
    return f"{value:.6g}"


def tongue_label(label: str, meshes: Mapping[str, int] | None = None) -> str:
    r"""A tongue's plain label as mathematics: ``(w2+w3)/2`` to ``$(\omega_{2}+\omega_{3})/2$``.

    A mesh named behind it is the one whose own frequency that is: ``2w3 (second)`` to ``$\Omega_{2}=2\omega_{3}$``.
    A label with other characters than such a formula needs is left as plain text.
    """
    found = re.fullmatch(r"([\w+\-*/()]+)(?: \((.+)\))?", label.strip())
    if not found or not re.search(r"w_?\d", found[1]):
        return plain(label)
    formula = re.sub(r"w_?(\d+)", r"\\omega_{\1}", found[1]).replace("*", "")
    if found[2] is None:
        return f"${formula}$"
    number = (meshes or {}).get(found[2].split("+")[0])
    return rf"$\Omega_{{{number}}}={formula}$" if number else f"${formula}$ ({plain(found[2])})"
