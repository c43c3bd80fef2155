"""Tables, files, plots and the command line: the only package that sees all others."""
