"""What a run writes for readers: `results.json`, the parts of the README, the report, and the page."""
