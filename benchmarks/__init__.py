"""Speed of enhsim_tf, compared with other implementations and with the limits of the machine:
`python -m benchmarks`.
"""
