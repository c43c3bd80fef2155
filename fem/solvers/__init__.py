"""Newton's method, contact within a step, sparse direct solution, and paths of loads followed in increments."""
