"""What can go wrong with a sweep; every message is one line for the user."""


class SweepError(RuntimeError):
    """The sweep could not be finished; what is finished is kept."""


class RequestError(ValueError):
    """What was asked for cannot be done: no place for the result, no such kernel. Nothing was computed."""


class Interrupted(RuntimeError):
    """The user or the system asked the sweep to stop; what is finished is kept."""
