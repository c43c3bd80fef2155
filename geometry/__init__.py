"""Shapes: designs, scenes, CAD, moulds and meshes. Imports no other package of magtip."""
