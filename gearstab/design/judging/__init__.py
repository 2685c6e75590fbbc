"""What a design is worth: its quantities over the operating ranges, its objective and its constraints."""
