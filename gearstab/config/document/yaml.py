"""YAML 1.2, read into documents and written."""

from __future__ import annotations

import math
import re
import stat
import warnings
from pathlib import Path as FilePath
from typing import Any

from gearstab.config.document import DEEPEST, NO_CHARACTER, Code, ConfigError, Document, Path, Problem, Where, dotted

Node = Any
"""A node of ruamel.yaml's, whose types leave out what its kinds have."""

LARGEST_TEXT = 4_000_000
"""Bytes of a file that is read as text; 1 MB of YAML takes some seconds."""
NO_REGULAR = "is no regular file"
"""A pipe or a device, which may never end."""
ESCAPE = re.compile(r"\\U(?!000|0010)[0-9a-fA-F]{8}")
"""One that names no character."""
TAG = "tag:yaml.org,2002:"
LONGEST_NUMBER = 400
"""Digits; what has more is beyond double precision anyway, and beyond what Python prints of an integer."""
MOST_COPIES = 1_000_000
"""Values that the aliases of a document may add to those it writes out."""
TAGS = ("str", "null", "bool", "int", "float", "timestamp")
"""Tags of scalars; what is no number stays the text it is."""


def read_yaml(path: FilePath) -> Document:
    """Read a configuration file.

    Raises ConfigError for a file that is missing, unreadable, no text or no YAML 1.2.
    """
    name = str(path)
    try:
        state = path.stat()
        if not stat.S_ISREG(state.st_mode) and not stat.S_ISDIR(state.st_mode):
            raise _failed(name, None, "file", NO_REGULAR, "save the configuration in a file")
        if state.st_size > LARGEST_TEXT:
            message = f"has {state.st_size / 1e6:,.0f} MB, more than the {LARGEST_TEXT / 1e6:.0f} MB of a configuration"
            raise _failed(name, None, "file", message, "keep matrices and samples in files of their own")
        raw = path.read_bytes()
    except FileNotFoundError:
        raise _failed(name, None, "file", "there is no such file", "check the path") from None
    except IsADirectoryError:
        raise _failed(name, None, "file", "is a folder", "name a configuration file in it") from None
    except OSError as error:
        raise _failed(name, None, "file", f"cannot be read: {(error.strerror or str(error)).lower()}", "") from None
    return decoded(raw, name)


def decoded(raw: bytes, name: str) -> Document:
    """Parse the bytes of a configuration. Raises ConfigError for what is no text or no YAML 1.2."""
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        raise _failed(name, line, "encoding", "is not UTF-8 text", "save the file in UTF-8") from None
    return parse(text, name)


def parse(text: str, name: str) -> Document:
    """Parse YAML 1.2; duplicate keys are collected in ``problems``, broken syntax raises ConfigError."""
    node = _compose(text, name)
    document = Document(name)
    if node is not None:
        _check_aliases(node, name)
        _Reader(document).read(node)
    return document


def parse_value(text: str, option: str) -> Any:
    """The plain value of a YAML text, for ``--set``."""
    try:
        document = parse(text, option)
        found = document.problems
    except ConfigError as error:
        found = error.problems
    if found:
        raise ConfigError(Problem(option, None, "", "", p.code, p.message, p.hint) for p in found)
    return document.data


def _failed(name: str, line: int | None, code: Code, message: str, hint: str) -> ConfigError:
    return ConfigError([Problem(name, line, "", "", code, message, hint)])


def _compose(text: str, name: str) -> Node:
    from ruamel.yaml import YAML
    from ruamel.yaml.composer import ComposerError
    from ruamel.yaml.error import MarkedYAMLError
    from ruamel.yaml.reader import ReaderError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # an anchor used again is allowed in YAML 1.2
            return YAML(typ="safe", pure=True).compose(text)
    except ReaderError as error:
        line = text[: error.position].count("\n") + 1
        raise _failed(
            name, line, "character", f"holds the control character {error.character:#x}", "remove it"
        ) from None
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        row = mark.line + 1 if mark else None
        if isinstance(error, ComposerError) and "another document" in (error.problem or ""):
            raise _failed(name, row, "syntax", "a second document begins", "keep one configuration a file") from None
        message = f"is no valid YAML: {error.problem or error.context}"
        if error.context and error.context_mark and row != error.context_mark.line + 1:
            message += f", {error.context} that begins in line {error.context_mark.line + 1}"
        raise _failed(name, row, "syntax", message, _syntax_remedy(text, row, error.problem or "")) from None
    except RecursionError:
        raise _failed(name, None, "nesting", "is nested too deeply", "write a flatter document") from None
    except (ValueError, OverflowError, AttributeError, LookupError, TypeError) as error:
        # Of the parser itself, on what it does not foresee.
        found = ESCAPE.search(text)
        row = text[: found.start()].count("\n") + 1 if found else None
        message = f"{found[0]} names no character" if found else f"is no valid YAML: {error}"
        raise _failed(name, row, "syntax", message, "check quotes and escapes") from None


def _check_aliases(root: Node, name: str) -> None:
    """Refuse, before anything is copied, aliases that lead in a circle, too deep or to too many values."""
    extents: dict[int, tuple[int, int]] = {}
    unfinished = (0, 0)

    def extent(node: Node) -> tuple[int, int]:
        """Return the number of values in a node and their depth, aliases followed."""
        known = extents.get(id(node))
        if known is unfinished:
            line = node.start_mark.line + 1
            raise _failed(name, line, "alias", "an alias stands inside what it refers to", "write the values out")
        if known is not None:
            return known
        extents[id(node)] = unfinished
        items = () if node.id == "scalar" else node.value if node.id == "sequence" else [v for _, v in node.value]
        inner = [extent(item) for item in items]
        extents[id(node)] = 1 + sum(size for size, _ in inner), 1 + max((depth for _, depth in inner), default=0)
        return extents[id(node)]

    try:
        size, depth = extent(root)
    except RecursionError:
        depth, size = DEEPEST + 1, 0
    if depth > DEEPEST:
        raise _failed(name, None, "nesting", "is nested too deeply", "write a flatter document")
    if size - len(extents) > MOST_COPIES:
        message = f"has aliases that stand for more than {MOST_COPIES:,} values"
        raise _failed(name, None, "alias", message, "write the values out, or refer to less")


def _syntax_remedy(text: str, line: int | None, problem: str) -> str:
    lines = text.splitlines()
    shown_line = lines[line - 1] if line and line <= len(lines) else ""
    if "\t" in shown_line[: len(shown_line) - len(shown_line.lstrip())] or "'\\t'" in problem:
        return "indent with spaces, not tabs"
    if "mapping values" in problem or "could not find expected ':'" in problem:
        return "check the indentation, and quote texts that hold ': '"
    if "alias" in problem:
        return "define it before with &"
    if "cannot start any token" in problem:
        return "put the text in quotes"
    if re.search(r"(?m)^%", text) and ("directive" in problem or "document start" in problem):
        return "remove the line that begins with %, or quote the text"
    return "check brackets, quotes and indentation here and in the line before"


class _Reader:
    """Turns the nodes of a YAML document into plain data and places."""

    def __init__(self, document: Document) -> None:
        self.document = document

    def read(self, node: Node) -> None:
        self.document.data = self.value(node, (), None)

    def value(self, node: Node, path: Path, key: Node) -> Any:
        # The mark of an empty value is that of whatever comes next.
        away = node.value == "" and not node.style if node.id == "scalar" else not node.flow_style
        self.document.values[path] = self.place(key if away and key is not None else node)
        if node.id != "scalar" and str(node.tag) not in (TAG + "map", TAG + "seq"):
            self.document.report(path, "tag", f"the tag {node.tag} is not known", "remove it")
        if node.id == "mapping":
            return self.mapping(node, path)
        if node.id == "sequence":
            return [self.value(item, (*path, i), None) for i, item in enumerate(node.value)]
        return self.scalar(node, path)

    def place(self, node: Node) -> Where:
        return Where(self.document.file, node.start_mark.line + 1)

    def mapping(self, node: Node, path: Path) -> dict[str, Any]:
        result: dict[str, Any] = {}
        merged: dict[str, Any] = {}
        for key, item in node.value:
            if key.id != "scalar":
                self.problem(key, path, "syntax", "a key is a list or a mapping", "use plain text as a key")
            elif key.tag == TAG + "merge":
                merged |= self.merge(item, path)
            else:
                self.entry(key, item, path, result)
        return {**merged, **result} if merged else result

    def entry(self, key: Node, item: Node, path: Path, result: dict[str, Any]) -> None:
        if NO_CHARACTER.search(key.value):
            self.problem(key, path, "character", f"the key {key.value!a} holds what is no character", "remove it")
            return
        here = (*path, key.value)
        if key.value in result:
            first = self.document.keys[here].line
            self.problem(
                key, here, "duplicate_key", f"duplicate key, given in line {first} already", "remove one of the two"
            )
            return
        self.document.keys[here] = self.place(key)
        result[key.value] = self.value(item, here, key)

    def problem(self, node: Node, path: Path, code: Code, message: str, hint: str) -> None:
        place = self.place(node)
        self.document.problems.append(Problem(place.file, place.line, dotted(path), "", code, message, hint))

    def merge(self, node: Node, path: Path) -> dict[str, Any]:
        """``<<: *anchor`` or ``<<: [*a, *b]``, where the first one wins."""
        if node.id == "sequence":
            merged: dict[str, Any] = {}
            for item in node.value:
                merged = {**self.merge(item, path), **merged}
            return merged
        if node.id == "mapping":
            return self.mapping(node, path)
        self.document.report(path, "syntax", "'<<' merges mappings only", "refer to a mapping: <<: *anchor")
        return {}

    def scalar(self, node: Node, path: Path) -> Any:
        tag, text = str(node.tag), str(node.value)
        if tag == TAG + "null":
            return None
        if tag == TAG + "bool" and text.lower() in ("true", "false"):
            return text.lower() == "true"
        if tag in (TAG + "int", TAG + "float"):
            return number(text)
        if tag.removeprefix(TAG) not in TAGS or not tag.startswith(TAG):
            self.document.report(path, "tag", f"the tag {tag} is not known", "remove it", value=text)
        elif NO_CHARACTER.search(text):
            self.document.report(path, "character", "holds what is no character", "remove it", value=ascii(text))
        return NO_CHARACTER.sub("", text)


def number(text: str) -> int | float | str:
    """The number that YAML 1.2 reads in a text; the text itself where Python cannot."""
    plain = text.replace("_", "").lower()
    if len(plain) > LONGEST_NUMBER:
        return math.inf if plain.isalnum() else text
    try:
        if plain.lstrip("+-").startswith(("0o", "0x", "0b")):
            return int(plain, 0)
        if plain.lstrip("+-") in (".inf", ".nan"):
            return float(plain.replace(".", ""))
        return int(plain) if plain.lstrip("+-").isdecimal() else float(plain)
    except ValueError:
        return text


def _represent_float(representer: Any, value: float) -> Node:
    """Every digit, and a point before the exponent: readers of YAML 1.1 take 1e-09 for a text."""
    text = repr(value) if math.isfinite(value) else f"{value}".replace("inf", ".inf").replace("nan", ".nan")
    mantissa, letter, exponent = text.partition("e")
    if letter and "." not in mantissa:
        text = f"{mantissa}.0e{exponent}"
    return representer.represent_scalar(TAG + "float", text)


def write(tree: dict[str, Any]) -> str:
    """Plain data as YAML 1.2, in the order given; short lists stay on one line."""
    text = _written(tree, unicode=True)
    # Other separators of lines are written as they are, and read as blanks.
    return _written(tree, unicode=False) if re.search("[\x85\u2028\u2029]", text) else text


def _written(tree: dict[str, Any], *, unicode: bool) -> str:
    from io import StringIO

    from ruamel.yaml import YAML

    yaml: Any = YAML(typ="safe", pure=True)
    yaml.default_flow_style = None
    yaml.sort_base_mapping_type_on_output = False
    yaml.width = 120
    yaml.allow_unicode = unicode
    yaml.representer.add_representer(float, _represent_float)
    text = StringIO()
    yaml.dump(tree, text)
    return text.getvalue()
