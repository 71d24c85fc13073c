"""Small files in the layouts of the public data sets."""

import numpy as np
import pandas as pd

EVENTS = {"A-1": (300, 360), "Z-1": (500, 620)}
"""Labelled samples of the channels, of which A-1 has the name of a development channel."""


def wave(number, seed):
    noise = 0.05 * np.random.default_rng(seed).standard_normal(number)
    return np.sin(2 * np.pi * np.arange(number) / 25) + noise


def write_spacecraft(folder):
    """Waves that stand still at the labelled samples, far outside their range."""
    lines = ["chan_id,spacecraft,anomaly_sequences,class,num_values"]
    for seed, (name, (begin, end)) in enumerate(EVENTS.items()):
        for part, number in (("train", 600), ("test", 800)):
            values = wave(number, [seed, number])
            if part == "test":
                values[begin:end] = 3
            (folder / part).mkdir(parents=True, exist_ok=True)
            np.save(folder / part / f"{name}.npy", np.stack([values, 0 * values], axis=1))
        lines.append(f'{name},SMAP,"[[{begin}, {end - 1}]]",[point],800')
    (folder / "labeled_anomalies.csv").write_text("\n".join(lines))
    return folder


def write_skab(folder, name="valve1/0", rows=700, begin=500, **changed):
    """Two channels, of which the second stands still from `begin` on until the row 600."""
    table = pd.DataFrame(
        {
            "datetime": pd.date_range("2020-01-01", periods=rows, freq="s"),
            "Current": wave(rows, 7),
            "Pressure": wave(rows, 8),
            "anomaly": np.float64((np.arange(rows) >= begin) & (np.arange(rows) < 600)),
            "changepoint": 0.0,
        }
    )
    table.loc[begin:599, "Pressure"] = 3.0
    for column, values in changed.items():
        table[column] = values
    path = folder / f"{name}.csv"
    path.parent.mkdir(parents=True, exist_ok=True)
    table.to_csv(path, sep=";", index=False)
    return folder
