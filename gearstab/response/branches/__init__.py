"""Periodic motions with backlash as branches: multipliers, continuation, folds and doublings."""
