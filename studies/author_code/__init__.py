"""Is the GAN of this project the author's? His own code, run as it is, beside it."""
