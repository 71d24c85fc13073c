"""Lessons that teach the paper, figure by figure; the `.py` is the source of the `.ipynb` beside it."""
