"""A document in YAML: where everything stands in it, changes for one run, and what is wrong with it."""
