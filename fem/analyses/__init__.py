"""What is computed along or about equilibria: force targets, stability, small shears, modes, vibration, time."""
