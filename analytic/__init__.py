"""The formulas: beam, magnet field, Hall readings. Imports geometry only."""
