"""User input: designs, axes and studies, option groups, CSV tables, JSON lines."""
