"""What can go wrong with a sweep; every message is one line for the user."""


class SweepError(RuntimeError):
    """The sweep could not be finished; what is finished is kept."""


class OutputError(ValueError):
    """The result cannot go where it should; nothing was computed."""


class Interrupted(RuntimeError):
    """The user or the system asked the sweep to stop; what is finished is kept."""
