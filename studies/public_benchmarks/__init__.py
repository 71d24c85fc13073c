"""Study: the views of `score` on public telemetry with labels, beside what users would pick
instead.
"""
