"""Newton's method, contact within a step, sparse direct solution, and loads applied in increments."""
