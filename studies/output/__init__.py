"""Output of the program: files, tables, plots, pictures, progress, provenance, stored results."""
