"""Options of scoring. Nothing slow is imported."""

import dataclasses

from enhsim_tf.common.options import check_options, option


@dataclasses.dataclass(frozen=True)
class ScoreOptions:
    """Options of scoring, as those of the command `score`. Raises InputError if a number is out of
    range.
    """

    false_alarm_rate: float = option(
        0.01, "share of nominal samples to flag", float, least=1e-9, most=0.5, metavar="SHARE"
    )

    def __post_init__(self):
        check_options(self)
