"""The experiment on how few real windows suffice, and from how few a simulator pays."""
