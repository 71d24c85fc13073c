"""The coarse simulator (section 2.1 of the paper): square waves, degraded modes, runs of a user's
simulator, and how both are aligned with telemetry.
"""
