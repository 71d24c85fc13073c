"""Parallel work: calls a function for many items, in processes of this machine or of a Ray
cluster.
"""
