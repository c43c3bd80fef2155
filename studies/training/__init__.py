"""The study that builds the surrogate from finite elements and tests it on beams that it has not seen."""
