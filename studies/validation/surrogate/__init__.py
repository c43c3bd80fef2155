"""Build the surrogate from finite elements, and test it on beams that it has not seen.

From an empty store it took some 70 minutes on two busy cores; what is solved is kept, so that an interrupted
study goes on. To ship the new surrogate, copy surrogate.npz from the folder to studies/beam.
"""
