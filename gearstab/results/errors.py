"""What can be wrong with a result file; messages are one line."""


class ResultError(ValueError):
    """A file cannot be read as a result."""
