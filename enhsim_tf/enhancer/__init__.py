"""The enhancer (section 2.2 of the paper): its candidates, the choice among them, and a score for
inputs outside its training range.
"""
