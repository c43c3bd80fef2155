"""Newton's method, contact within a step, sparse direct solution, and steps along a path of loads."""
