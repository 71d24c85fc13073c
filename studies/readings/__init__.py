"""Do the verdicts on the paper hold over readings of its text, seeds, and the rounding of the
processor?
"""
