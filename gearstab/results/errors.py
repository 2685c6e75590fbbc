"""What can be wrong with a result or an output file; messages are one line."""

from gearstab.errors import UserError


class ResultError(UserError, ValueError):
    """A file cannot be read as a result."""


class OutputError(UserError, ValueError):
    """A file must not be written, for what is there or for its name. Nothing was computed or written."""
