"""Measures of a motion: extremes, spectra, panels, loads of teeth."""
