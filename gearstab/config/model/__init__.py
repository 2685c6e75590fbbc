"""Parts of the sections: kinds of values, units, rules across fields, the schema for editors."""
