"""Noise models (section 2.3 of the paper): what is added to the enhanced signal."""
