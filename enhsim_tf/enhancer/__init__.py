"""The enhancing network (section 2.2): from coarse windows to smooth ones, the pairs it learns from, and where not to trust it.

This package knows nothing of noise or detectors.
"""
