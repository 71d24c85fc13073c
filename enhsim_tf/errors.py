"""The one error that stands for a user's mistake; the commands turn it into one line and exit code 2."""


class InputError(ValueError):
    """Input that cannot be used. The message says what was expected, what was received and what to do."""
