"""The factorial experiment: which part of the pipeline lowers false alarms: windows, extraction, enhancer or generator."""
