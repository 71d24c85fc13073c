"""The experiment with a coarse and a fine simulator: PyBaMM models of a satellite's battery over
low orbits.
"""
