"""Models put to the test: closed forms, published numbers, extremes, error estimates, other models."""
