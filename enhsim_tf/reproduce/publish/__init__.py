"""Output for readers: `results.json`, the generated parts of the README, the report on robustness, and the HTML page."""
