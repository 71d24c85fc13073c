"""Names in the tables of the experiment on noise."""

REAL = "real"
"""The arm of real windows, with which every rung is compared."""
PRESENT = "present"
"""The present rule of the choice."""
