"""Learnt noise models, which studies compare with the simple ones of the tool."""
