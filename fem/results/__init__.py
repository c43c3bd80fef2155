"""Evaluation of solutions: response, diagnostics, lateral stiffness, stability of the law, three-dimensional body."""
