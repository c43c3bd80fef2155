"""Hold calibrations, decoders in C and sized sensors against made sensors whose truth is known.

Exit status 3 if others are missed than the expected ones, or one of these is met.
"""
