"""Calibration of a made sensor from what a test stand recorded."""
