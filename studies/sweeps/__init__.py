"""Studies of many designs: sweeps over fields of the design and the load."""
