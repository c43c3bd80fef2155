"""What leaves the program: files, tables, plots, pictures, progress, provenance, kept answers."""
