"""A real pair of simulators: a satellite's battery over low orbits, computed by PyBaMM with a coarse and a fine model."""
