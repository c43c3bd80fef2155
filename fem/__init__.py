"""Finite-strain finite elements for the sensor. Imports geometry only."""
