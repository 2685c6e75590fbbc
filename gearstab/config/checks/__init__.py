"""Checks beyond each value by itself: files, stiffness levels, whether systems can exist, likely slips."""
