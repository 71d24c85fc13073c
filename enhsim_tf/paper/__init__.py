"""Feldman 2020 (arXiv 2008.12082), top to bottom and in the paper's order; `python -m
enhsim_tf.reproduce` runs it.

Read `telemetry` (section 2), `square_wave` (2.1), `enhancer` (2.2), `noise` (2.3) and `pipeline`
(Figure 1). `settings` has every value with its source, `claims` what the paper claims and how it is
judged, and `degraded` the degraded modes of this project. Nothing here imports more of the package
than `common`: caching, speed, measures, plotting.
"""
