"""Figures of responses: histories, spectra, phase planes, steady states over speed."""
