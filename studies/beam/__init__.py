"""One beam under presses and shears, dimensionless, by any source of its answers."""
