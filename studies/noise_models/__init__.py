"""Study: noise models on fourteen families of noise."""
