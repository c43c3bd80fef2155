"""Readings of the Hall elements, and back from readings to pose and load; layouts of elements."""
