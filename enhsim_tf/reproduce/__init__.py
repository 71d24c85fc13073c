"""Reproduction of Feldman 2020: every number, figure and claim of the paper. No other package imports this one."""
