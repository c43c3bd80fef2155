"""Fabrication: solids of the mould and their checks, bodies of the Hall elements, CAD files and drawings."""
