"""The book: the notebooks, the pages of `docs/` and the reference of the code as one set of HTML
pages; `python -m book` builds it.
"""
