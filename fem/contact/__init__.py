"""Contact with the plate: penalty springs, gluing, gripping, and Coulomb friction."""
