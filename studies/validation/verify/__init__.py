"""Hold the finite elements against published problems, closed forms and theory.

Exit status 3 if others are missed than the expected ones, or one of these is met.
"""
