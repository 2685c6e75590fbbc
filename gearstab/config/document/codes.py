"""Codes of mistakes: what kind of mistake it is, for programs. Their text may change, their code does not."""

from __future__ import annotations

from typing import Any, Literal, cast

Code = Literal[
    "alias", "already_given", "ambiguous_unit", "bad_name", "character", "data_file", "decimal_comma",
    "duplicate_key", "empty", "encoding", "equal_values", "file", "impossible", "inconsistent", "looks_like_range",
    "matrix", "missing", "needs_other", "nesting", "no_range", "no_unit", "not_a_number", "not_an_axis",
    "not_applicable", "not_exact", "not_finite", "not_whole", "only_zeros", "option", "out_of_range", "override",
    "repeated_name", "reserved_name", "revolutions", "set_twice", "syntax", "tag", "too_large", "unavailable",
    "unknown_choice", "unknown_key", "unknown_name", "unknown_target", "unknown_unit", "unusual", "wrong_count",
    "wrong_dimension", "wrong_order", "wrong_type",
]  # fmt: skip

CODES: dict[Code, str] = {
    "alias": "a YAML alias refers to itself, or stands for too many values",
    "already_given": "another key gives the same, or what follows from it",
    "ambiguous_unit": "the unit may count radians or turns",
    "bad_name": "a name cannot be used in a path",
    "character": "a character that no text can hold",
    "data_file": "a file of matrices, samples or choices cannot be used",
    "decimal_comma": "a comma in a number",
    "duplicate_key": "a key stands twice in a mapping",
    "empty": "nothing stands after a key, or in a file",
    "encoding": "a file is not UTF-8 text",
    "equal_values": "a value is given more than once",
    "file": "a configuration file cannot be read",
    "impossible": "no such gears exist, or their stiffness is not positive, or numbers go beyond double precision",
    "inconsistent": "several values contradict each other",
    "looks_like_range": "three values look like start, stop and number of values (doubt)",
    "matrix": "a matrix is not symmetric or not positive",
    "missing": "a key or section is missing",
    "needs_other": "something else must be given as well, or is of another form",
    "nesting": "mappings and lists are nested too deeply",
    "no_range": "a range where there can be none, or one that leads nowhere",
    "no_unit": "a quoted number without a unit",
    "not_a_number": "something else where a number or a ratio is expected",
    "not_an_axis": "a parameter that an axis cannot set",
    "not_applicable": "a key that means nothing together with the others",
    "not_exact": "a ratio that must be exact is not",
    "not_finite": "an infinite number, or none (.nan)",
    "not_whole": "a number that must be whole is not, or is too small",
    "only_zeros": "a vector without an entry other than zero",
    "option": "an option of a method does not fit the system",
    "out_of_range": "a number outside its limits",
    "override": "`--set` is not PATH=VALUE, or its path leads nowhere",
    "repeated_name": "two entries have the same name",
    "reserved_name": "an axis cannot have this name",
    "revolutions": "a mesh frequency in revolutions (doubt)",
    "set_twice": "two axes, cases, distributions or overrides set the same parameter",
    "syntax": "a text is not valid YAML",
    "tag": "an unknown YAML tag",
    "too_large": "more than can be computed or stored",
    "unavailable": "not available in this version",
    "unknown_choice": "none of the words that are allowed",
    "unknown_key": "a key that the section does not have",
    "unknown_name": "a name of a rotor, mesh, coordinate or other entry that does not exist",
    "unknown_target": "a path that leads to no parameter of the system",
    "unknown_unit": "a unit that does not exist",
    "unusual": "a number far from what gears have (doubt)",
    "wrong_count": "a list with too many or too few entries",
    "wrong_dimension": "a unit of another quantity",
    "wrong_order": "values in the wrong order",
    "wrong_type": "a mapping, list, text, number or truth value where another is expected",
}

PYDANTIC: dict[str, Code] = {
    "missing": "missing",
    "extra_forbidden": "unknown_key",
    **dict.fromkeys(("greater_than", "greater_than_equal", "less_than", "less_than_equal"), "out_of_range"),
    **dict.fromkeys(("list_type", "tuple_type", "model_type", "dict_type", "bool_type", "string_type"), "wrong_type"),
    **dict.fromkeys(("too_short", "too_long"), "wrong_count"),
}
"""Types of pydantic's own errors; those that gearstab raises in a validator are codes themselves."""


def code_of(kind: Any) -> Code:
    """Return the code of an error of pydantic from its type."""
    return PYDANTIC.get(kind) or cast("Code", kind)
