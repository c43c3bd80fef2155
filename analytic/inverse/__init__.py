"""Inverse problem, from readings to the magnet's pose: forward model, start poses, iteration."""
