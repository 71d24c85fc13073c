"""The criterion of claim C8 by hand. Tables are kept and read back."""

import pandas as pd
import pytest

from enhsim_tf.common.errors import InputError
from studies.common.command import PUBLISHED
from studies.robustness import summary


def test_tables_come_back_as_they_were_written_and_a_missing_one_is_named(tmp_path):
    written = summary.KEPT.read(PUBLISHED / "robustness" / "results")
    summary.KEPT.write(written, tmp_path)
    for name, table in summary.KEPT.read(tmp_path).items():
        pd.testing.assert_frame_equal(table, written[name])
    (tmp_path / "alarms.parquet").unlink()
    with pytest.raises(InputError, match="alarms.parquet"):
        summary.KEPT.read(tmp_path)


def test_the_criterion_allows_twice_the_rate_of_real_training_plus_a_point_and_five_points_less_recall():
    index = pd.MultiIndex.from_product(
        [["real", "arm"], ["a", "b", "c"]], names=["arm", "detector"]
    )
    rate = pd.Series([0.01, 0.01, 0.02, 0.03, 0.03, 0.051], index)
    kept = summary.keeps_the_rule(rate, pd.Series([0.5, 0.5, 0.5, 0.451, 0.449, 0.5], index))
    assert kept["arm"].to_dict() == {"a": True, "b": False, "c": False}
