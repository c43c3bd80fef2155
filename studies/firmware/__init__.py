"""The decoder in C for a microcontroller."""
