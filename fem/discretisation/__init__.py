"""Elements and their integrals, the rigid magnet, symmetries, and the discrete residual and tangent."""
