"""The commands of `python -m enhsim_tf`, one module for each command, and their options. No other
package imports it.
"""
