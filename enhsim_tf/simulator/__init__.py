"""The enhanced simulator of one or several channels (figure 1 of the paper): its parts, how it is fitted, and how it scores telemetry."""
