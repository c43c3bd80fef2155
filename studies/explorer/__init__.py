"""The explorer: a local page on which a sensor's design and load change by hand, solved by finite elements."""
