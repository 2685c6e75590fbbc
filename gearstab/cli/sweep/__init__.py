"""``gearstab sweep``: from a configuration to a result file."""
