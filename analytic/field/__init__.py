"""The field of a cylinder magnet: its formulas in NumPy, point by point, and compiled."""
