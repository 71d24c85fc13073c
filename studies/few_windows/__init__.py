"""Study: from how few real windows a simulator pays, and from how many real windows suffice."""
