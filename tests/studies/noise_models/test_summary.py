"""The findings of the study of noise models, with hand-made tables."""

import pandas as pd

from studies.noise_models import summary

# false alarms of 1,000 windows and recall of each model: what every number below is worked out from
RESULTS = {
    "real": (10, 0.60),
    "gaussian": (500, 0.90),
    "autoregression": (30, 0.60),
    "residual windows": (8, 0.55),
    "matched residual windows": (15, 0.58),
}


def tables():
    """Two families and two seeds, in which all is equal but the classifier: it tells resampled noise from the real on `bursts`."""
    rows = {name: [] for name in summary.KEPT.names}
    for family in ("white", "bursts"):
        for seed in (1, 2):
            for model, (alarms, recall) in RESULTS.items():
                about = {"family": family, "seed": seed, "model": model}
                for detector in ("a", "b"):
                    found = {"alarms": alarms, "windows": 1_000, "recall": recall, "recall_at_real_rate": 0.5}
                    rows["detectors"].append({**about, "detector": detector, **found})
                rows["realism"] += [{**about, "measure": name, "value": 0.0, "ratio": ratio} for name, ratio in (("m", 1.0), ("n", 4.0))]
                if model != "real":
                    auc = 0.7 if family == "bursts" and "windows" in model else 0.5
                    judged = {"auc": auc, "real_auc": 0.5, "alarms": alarms / 1_000, "real_alarms": 0.01}
                    rows["choice"].append({**about, **judged, "recall": recall, "real_recall": 0.6})
    return {name: pd.DataFrame(each) for name, each in rows.items()}


def test_the_findings_are_those_of_hand_made_tables(near):
    found = summary.summarise(tables())
    assert [found["families"][name]["looked_at"] for name in ("white", "bursts")] == [True, False]
    matched = found["families"]["white"]["models"]["matched residual windows"]
    expected = {"seeds": [1, 2], "alarms": 0.015, "excess": 0.005, "lost": 0.02, "realism": 0.5, "auc": 0.5, "passes": 2, "judged": 2}
    assert matched == near(expected)
    kept = {name: (about["within_alarms"], about["within_recall"], about["within_both"]) for name, about in found["models"].items()}
    assert kept == {
        "real": (2, 2, 2),
        "gaussian": (0, 2, 0),
        "autoregression": (0, 2, 0),
        "residual windows": (2, 0, 0),
        "matched residual windows": (2, 2, 2),
    }
    # on bursts, no model passes: the departures are 0.49, 0.02, 0.25 and 0.225
    choice = found["choice"]
    assert choice["chosen"] == {"gaussian": 0, "autoregression": 2, "residual windows": 0, "matched residual windows": 2}
    assert (choice["judgements"], choice["with_a_passing_model"], choice["within_alarms"], choice["within_recall"]) == (4, 2, 2, 4)


def test_a_model_is_compared_with_the_real_windows_of_its_own_seeds(near):
    made = tables()
    detectors = made["detectors"]
    detectors.loc[(detectors["model"] == "real") & (detectors["seed"] == 2), "alarms"] = 100
    made["detectors"] = detectors[(detectors["model"] == "real") | (detectors["seed"] == 1)]
    made["choice"] = made["choice"][made["choice"]["seed"] == 1]
    assert summary.summarise(made)["families"]["white"]["models"]["autoregression"]["excess"] == near(0.02)
