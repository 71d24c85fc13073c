from enhsim_tf.common.columns import apart_from


def test_a_name_that_is_taken_says_whose_it_is():
    names = ["volts", "mask", "mask (channel)", "score"]
    assert apart_from(["mask", "score"], names) == {
        "volts": "volts",
        "mask": "mask (channel) (channel)",
        "mask (channel)": "mask (channel)",
        "score": "score (channel)",
    }
    assert apart_from(["value"], ["value"], "run") == {"value": "value (run)"}
