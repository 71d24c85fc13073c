"""The commands of `python -m enhsim_tf`: one module for each command, and their options.

The commands may use every package except `reproduce`. Nothing imports them.
"""
