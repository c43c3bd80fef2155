"""What is printed and cast: solids of the mould and their checks, bodies of the Hall elements, files and drawings."""
