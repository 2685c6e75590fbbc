"""What is measured on a motion: extremes, spectra, panels, loads of teeth."""
