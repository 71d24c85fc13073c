"""The commands of `python -m enhsim_tf`, one module for each command, and the options of the commands.

This package may import every package except `reproduce`. No other package imports it.
"""
