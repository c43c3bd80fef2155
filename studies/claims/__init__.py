"""The claims of the paper, and the range in which its beam formulas hold, tested by finite elements."""
