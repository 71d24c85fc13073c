"""Study: detectors trained on every kind of training data, over seeds and kinds of noise."""
