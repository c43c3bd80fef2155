"""Measure the true errors of every model of the mechanics, and hold error estimates against them.

Exit status 3 if others are missed than the expected ones, or one of these is met.
"""
