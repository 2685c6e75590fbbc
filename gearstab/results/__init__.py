"""Result files: what they hold, how they are written, how they are opened."""

from gearstab.errors import OutputError, ResultError
from gearstab.results.read import open_result
from gearstab.results.tree import Chunked, Field, Group, ResultTree, fields_of
from gearstab.results.variables import Variable, coordinate
from gearstab.results.write import write_result

__all__ = [
    "Chunked", "Field", "Group", "OutputError", "ResultError", "ResultTree", "Variable", "coordinate", "fields_of",
    "open_result", "write_result",
]  # fmt: skip
