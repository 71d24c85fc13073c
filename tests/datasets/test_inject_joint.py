import numpy as np
import pytest

from enhsim_tf.coarse_simulator.recording import Recording, Run
from enhsim_tf.common.errors import InputError
from enhsim_tf.datasets.inject_joint import JOINT_KINDS, inject_joint

LENGTHS = ("40", "40")


def telemetry(channels=3):
    rng = np.random.default_rng(0)
    common = np.cumsum(rng.standard_normal(1_000))
    values = np.stack([common * (1 + channel) + rng.standard_normal(1_000) for channel in range(channels)], axis=1).astype(np.float32)
    return Recording((Run(values[:600]), Run(values[600:], 700.0)), tuple("abc"[:channels]), name="abc")


@pytest.mark.parametrize("kind", JOINT_KINDS)
def test_samples_that_are_not_marked_keep_their_values(kind):
    source = telemetry()
    nominal = np.concatenate([part.values for part in source.parts])
    frame = inject_joint(source, [kind], 3, (4.0, 4.0), LENGTHS, None, seed=1)
    mask = frame[[f"mask {name}" for name in "abc"]].to_numpy()
    np.testing.assert_array_equal(mask, frame[list("abc")].to_numpy() != nominal)
    np.testing.assert_array_equal(frame["mask"], mask.any(axis=1))
    assert len(frame.attrs["anomalies"]) == 3 and mask.any(axis=0).sum() == (
        3 if kind == "common_shift" else len({each[4] for each in frame.attrs["anomalies"]})
    )


def test_a_channel_of_another_time_has_the_values_of_that_time():
    source = telemetry()
    frame = inject_joint(source, ["another_time"], 1, (1.0, 1.0), LENGTHS, None, seed=2)
    ((_, _, begin, end, name),) = frame.attrs["anomalies"]
    values = np.concatenate([part.values for part in source.parts])[:, "abc".index(name)]
    piece = frame[name].to_numpy()[begin:end]
    assert any(np.array_equal(piece, values[first : first + 40]) for first in range(961) if abs(first - begin) >= 40)


def test_a_late_channel_is_that_of_a_quarter_before():
    source = telemetry()
    frame = inject_joint(source, ["delay"], 1, (1.0, 1.0), LENGTHS, None, seed=3)
    ((_, _, begin, end, name),) = frame.attrs["anomalies"]
    values = np.concatenate([part.values for part in source.parts])[:, "abc".index(name)]
    np.testing.assert_array_equal(frame[name].to_numpy()[begin:end], values[begin - 10 : end - 10])


def test_a_common_shift_has_the_severity_in_each_channel():
    source = telemetry()
    frame = inject_joint(source, ["common_shift"], 1, (4.0, 4.0), LENGTHS, None, seed=4)
    ((_, _, begin, end, _),) = frame.attrs["anomalies"]
    shift = frame[list("abc")].to_numpy()[begin:end] - np.concatenate([part.values for part in source.parts])[begin:end]
    assert np.ptp(shift, axis=0).max() < 1e-3 and (shift[0] > 3).all()


def test_one_channel_and_other_kinds_are_refused():
    with pytest.raises(InputError, match="several channels"):
        inject_joint(telemetry(1), ["delay"], 1, (1.0, 1.0), LENGTHS, None, 0)
    with pytest.raises(InputError, match="kinds among"):
        inject_joint(telemetry(), ["delay", "spike"], 1, (1.0, 1.0), LENGTHS, None, 0)
