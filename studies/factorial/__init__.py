"""Study: which part of the pipeline (windows, extraction, enhancer or generator) lowers false
alarms.
"""
