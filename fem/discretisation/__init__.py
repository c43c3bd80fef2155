"""From the continuum to unknowns: elements and their integrals, the rigid magnet, symmetries, residual, tangent."""
