"""Reading tables in the forms that people have: the dialect, the roles of the columns, the clock,
the series, and then the numbers.
"""
