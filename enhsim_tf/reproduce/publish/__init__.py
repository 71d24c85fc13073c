"""Output for readers: `results.json`, the generated parts of the README and other pages, the report on robustness, and the HTML page."""
