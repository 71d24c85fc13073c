"""Run models: enhanced simulators for runs of the user's own simulator, with several columns and without a period.

A run model is fitted to telemetry and a recorded run that covers the same time. It turns any further run, for example of a fault, into
realistic telemetry, and scores telemetry by its difference from the enhanced run.
"""
