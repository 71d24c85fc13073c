"""The coarse simulator (section 2.1 of the paper): square waves, their fit to telemetry, and degraded modes; runs of a user's simulator."""
