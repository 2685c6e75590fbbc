"""From gear systems to patterns of constant stiffness: reduction, decoupling, blocks."""
