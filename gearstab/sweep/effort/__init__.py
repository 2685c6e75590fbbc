"""Forecast of a sweep: time, memory, size of the file; and whether that is too much to begin unasked."""
