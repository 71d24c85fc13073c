"""Writes small numbers as English words, for sentences and captions that are put together from results."""

_WORDS = (
    "zero one two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen sixteen seventeen eighteen nineteen twenty"
).split()


def in_words(number: int) -> str:
    """Returns a number from 0 to 20 as an English word, and any other number in digits.

    Args:
        number: The number, for example of detectors.
    """
    return _WORDS[number] if 0 <= number < len(_WORDS) else f"{number:,}"
