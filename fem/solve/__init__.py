"""Equilibria: linear systems, the Newton loop, load increments and paths."""
