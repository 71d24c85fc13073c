"""The paper: every number, figure and claim of Feldman 2020. Nothing below imports this wing."""
