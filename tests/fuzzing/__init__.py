"""Fuzzing with bad and hostile input. `targets` lists the functions under test, and `judge` classifies the outcomes."""
