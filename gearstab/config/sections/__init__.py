"""The sections ``sweep``, ``methods`` and ``design``, and what an axis or a variable may set."""
