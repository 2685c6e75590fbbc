"""What can be wrong with a result file; messages are one line."""

from gearstab.errors import UserError


class ResultError(UserError, ValueError):
    """A file cannot be read as a result."""
