"""Read off a solution: diagnostics, stability of the material, lateral stiffness, the body in three dimensions."""
