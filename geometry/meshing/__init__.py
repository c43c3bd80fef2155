"""Meshing of the beam and its magnet: edge lengths, surfaces, curved cells, quality, cache and imported meshes."""
