"""Hold the paper's formulas and claims against finite elements.

Exit status 3 if the finite elements do not reach a load.
"""
