"""Terms of the levels of `analytic.beam`: press, and shear of the pressed beam."""
