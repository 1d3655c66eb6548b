"""Grips that serve every world of an uncertainty set, and proofs that none does."""
