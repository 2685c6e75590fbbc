"""Proofs that need no coordinates: where multipliers are, by the characteristic polynomial on whole intervals."""
