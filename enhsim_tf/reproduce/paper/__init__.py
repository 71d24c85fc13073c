"""The paper itself: its example, the pipeline in stages, claims C1 to C9, and figures 1 to 14."""
