"""The study of real spacecraft telemetry with labelled anomalies."""
