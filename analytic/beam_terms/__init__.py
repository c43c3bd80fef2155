"""The terms of which the levels of `analytic.beam` are made."""
