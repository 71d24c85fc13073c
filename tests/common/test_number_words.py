"""Numbers as words, by hand."""

import pytest

from enhsim_tf.common.number_words import in_words


@pytest.mark.parametrize(
    "number,words", [(0, "zero"), (4, "four"), (7, "seven"), (13, "thirteen"), (20, "twenty"), (21, "21"), (1_036, "1,036"), (-1, "-1")]
)
def test_small_numbers_are_words_and_others_digits(number, words):
    assert in_words(number) == words
