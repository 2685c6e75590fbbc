"""What systems are made of: each file holds the sections of the configuration and what they build."""
