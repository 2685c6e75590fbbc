"""From teeth to mesh stiffness and friction."""
