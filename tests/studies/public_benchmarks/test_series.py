"""Both layouts of public data, read from small files that are known."""

import numpy as np
import pytest

from studies.public_benchmarks.series import NOMINAL_ROWS, SKAB, SPACECRAFT, find_series
from tests.studies.public_benchmarks import synthetic


def test_both_layouts_by_hand(tmp_path):
    folders = [synthetic.write_spacecraft(tmp_path / "a"), synthetic.write_skab(tmp_path / "b")]
    found = {name: load() for name, load in find_series(folders).items()}
    assert {name: (each.data_set, each.is_development) for name, each in found.items()} == {
        "A-1": (SPACECRAFT, True),
        "Z-1": (SPACECRAFT, False),
        "valve1/0": (SKAB, True),
    }
    one, plant = found["A-1"], found["valve1/0"]
    assert one.nominal.shape == (600, 1) and one.judged.shape == (800, 1)
    assert one.events == ((300, 360),) and np.all(one.judged[300:360] == 3)
    assert plant.nominal.shape == (NOMINAL_ROWS, 2) and plant.judged.shape == (300, 2)
    assert plant.events == ((100, 200),) and np.all(plant.judged[100:200, 1] == 3)
    np.testing.assert_allclose(plant.nominal[:, 0], synthetic.wave(700, 7)[:400], rtol=1e-6)


def test_a_folder_in_another_form_is_refused(tmp_path, refused):
    with refused("train/", "semicolons", str(tmp_path)):
        find_series([tmp_path])
    folder = synthetic.write_skab(tmp_path)
    with refused("valve1/0 in two folders"):
        find_series([folder, folder])


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"rows": 400, "begin": 300}, "400 rows"),
        ({"Current": np.nan}, "700 values not finite"),
        ({"Current": "broken"}, "'broken'"),
        ({"anomaly": 2.0}, "700 labels"),
        ({"anomaly": 0.0}, "none of valve1/0"),
    ],
)
def test_an_experiment_that_cannot_be_used_is_refused(changed, words, tmp_path, refused):
    folder = synthetic.write_skab(tmp_path, **changed)
    with refused(words):
        find_series([folder])["valve1/0"]()
