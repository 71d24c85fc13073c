"""Studies beyond the paper, each with one command: `python -m studies.NAME`."""
