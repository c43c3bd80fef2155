"""One design: under load, vibrating, beside the formulas, and its material from a test."""
