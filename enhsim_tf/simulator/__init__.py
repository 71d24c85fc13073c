"""The enhanced simulator of one or several channels (figure 1 of the paper)."""
