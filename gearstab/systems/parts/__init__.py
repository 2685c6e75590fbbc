"""Parts of systems: each file holds the sections of the configuration and what they build."""
