"""Contact with the plate: penalty, gluing, gripping, and Coulomb friction."""
