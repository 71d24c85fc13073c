"""The enhancing network (section 2.2 of the paper), its training pairs, and a score for inputs outside its training range.

This package does not depend on the noise or the detectors.
"""
