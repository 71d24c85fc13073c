"""Speed of the package, beside what a competent user would write and beside the machine's limits: `python -m benchmarks`."""
