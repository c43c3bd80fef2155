"""Meshing of the beam and its magnet: edge lengths, surfaces, curved cells, quality and imported meshes."""
