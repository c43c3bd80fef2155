"""From requirements to a variant that finite elements confirm."""
