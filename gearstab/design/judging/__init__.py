"""Value of a design: its quantities over the operating ranges, its objective and its constraints."""
