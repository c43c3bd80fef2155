"""The sensor as an object: its design, its loads, its solids, its mould and its meshes.

This package imports no other package of magtip.
"""
