"""Histories and periodic steady states of linear systems."""
