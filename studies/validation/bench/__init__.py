"""Measure time and memory at a given error, and the field beside magpylib; exit status 3 if a goal is missed."""
