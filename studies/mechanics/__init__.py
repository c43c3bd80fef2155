"""Mechanics for all studies: finite elements through the store, formulas, the surrogate, and what solves them."""
