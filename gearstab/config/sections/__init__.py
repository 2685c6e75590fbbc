"""The sections ``sweep``, ``methods`` and ``respond``, and the axes and targets that a sweep sets."""
