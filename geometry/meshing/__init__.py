"""Meshes of the beam and its magnet: sizes of edges, surfaces, curved cells, quality, and meshes kept on disk."""
