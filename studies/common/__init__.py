"""What the studies share: the command, settings, replicates, tables, intervals, figures, and known
noise processes.
"""
