"""Uncertain parameters: their distributions, the samples drawn of them, and what these say of a probability."""
