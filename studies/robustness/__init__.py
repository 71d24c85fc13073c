"""The experiment on robustness: detectors trained on every kind of noise, over seeds and environments."""
