"""Which input matters most, and how much made sensors differ: Sobol indices, Morris effects, tolerances."""
