"""Run models: enhanced simulators for runs of the user's own simulator, with several columns and without a period.

A run model is fitted to telemetry and a recorded run of the same time. It turns any further run, for example of a fault, into
realistic telemetry, and judges telemetry by its difference from the enhanced run.
"""
