"""Why a design is good, how firmly, and what limits it."""
