"""Field of a cylinder magnet: the same formulas in NumPy, in plain Python for single points, and compiled."""
