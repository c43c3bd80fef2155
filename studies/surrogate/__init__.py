"""The surrogate: a fast model of the finite elements, trained on stored states, with intervals for its errors."""
