"""What the sections are made of: kinds of values, units, rules across fields, the schema for editors."""
