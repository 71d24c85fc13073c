"""When is an enhanced simulator worth having, and for what: as a source of training data, or as a
reference?
"""
