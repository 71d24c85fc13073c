"""False alarms and finds of every trained detector of the study, computed from the ranks of its scores."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.spacecraft.judging import RULES
from studies.spacecraft.matched import RATES, finds_by_shift, windows_that_meet

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

PRIMARY = 0.05
"""False-alarm rate at which arms are compared first: at 1 %, two of some three hundred overlapping windows may alarm."""
_COLUMNS = [*RATES, *RULES]  # in the order of the second axis of `Rates.finds`


@dataclasses.dataclass(frozen=True)
class Rates:
    """Results of every trained detector.

    Args:
        cells: One row for each channel, arm, detector and seed, with the shares `own` and `past` of nominal windows above the
            thresholds of these rules.
        finds: For each channel, finds of shape `(shifts, rates and rules, rows, sequences)`. The rows are those of the channel
            in `cells`; the first shift is 0.
        delays: For each channel, samples from the start of a sequence to the end of the first window that alarms at its own
            threshold, shape `(rows, sequences)`, NaN if there is none.
        num_nominal: Number of nominal test windows of each channel.
        sequences: One row for each labelled sequence: `channel`, `sequence`, `class`, `start`, `stop`.
    """

    cells: "pd.DataFrame"
    finds: Mapping[str, "NDArray[np.bool_]"]
    delays: Mapping[str, "NDArray[np.float64]"]
    num_nominal: Mapping[str, int]
    sequences: "pd.DataFrame"

    @property
    def names(self) -> list[str]:
        """Names of the channels."""
        return list(self.finds)

    @property
    def seeds(self) -> list[int]:
        """Training seeds."""
        return sorted(set(self.cells["seed"].tolist()))

    @property
    def num_sequences(self) -> int:
        """Number of labelled sequences of all channels."""
        return sum(found.shape[3] for found in self.finds.values())

    def detectors(self, arm: str) -> list[str]:
        """Names of the detectors of an arm."""
        return list(dict.fromkeys(self.cells[self.of_arm(arm)]["detector"]))

    def of_arm(self, arm: str) -> np.ndarray:
        """Mask of the rows of an arm, without controls."""
        from enhsim_tf.detection.registry import CONTROLS

        return ((self.cells["arm"] == arm) & ~self.cells["detector"].isin(list(CONTROLS))).to_numpy()

    def of_control(self, name: str) -> np.ndarray:
        """Mask of the rows of a control: a detector that was trained on the channel's own past."""
        return ((self.cells["arm"] == "real") & (self.cells["detector"] == name)).to_numpy()

    def _chosen(self, rows: np.ndarray, rule: float | str, channels: Sequence[str] | None = None) -> "Iterator[tuple[str, np.ndarray]]":
        """Finds of the chosen rows of each channel by one rule, shape `(shifts, rows, sequences)`. Channels without such rows are left out."""
        names, column = self.cells["channel"].to_numpy(), _COLUMNS.index(rule)
        for name in channels or self.names:
            if rows[names == name].any():
                yield name, self.finds[name][:, column][:, rows[names == name]]

    def found(self, rows: np.ndarray, rule: float | str, channels: Sequence[str] | None = None) -> float:
        """Share of the labelled sequences that is found, mean over rows.

        Args:
            rows: Mask of rows of `cells`.
            rule: A rate at which thresholds are matched, or a rule by which they are set.
            channels: Names of channels; None for all.

        Returns:
            The share; NaN if none of the rows belongs to the channels.
        """
        shares = [found[0].mean(axis=0) for _, found in self._chosen(rows, rule, channels)]
        return float(np.concatenate(shares).mean()) if shares else float("nan")

    def shares(self, rows: np.ndarray, rule: float | str) -> "pd.DataFrame":
        """For each labelled sequence, the share `found` of the rows that find it, with its `channel` and `sequence`."""
        import pandas as pd

        return pd.DataFrame(
            [
                {"channel": name, "sequence": number, "found": share}
                for name, found in self._chosen(rows, rule)
                for number, share in enumerate(found[0].mean(axis=0))
            ]
        )

    def counts_by_shift(self, rows: np.ndarray, rule: float | str) -> list[np.ndarray]:
        """For each channel, the number of sequences found for each shift of the labels, mean over rows."""
        return [found.sum(axis=2).mean(axis=1) for _, found in self._chosen(rows, rule)]

    def median_delay(self, rows: np.ndarray) -> float | None:
        """Median delay of alarms at the arm's own threshold in samples, or None if nothing is found."""
        names = self.cells["channel"].to_numpy()
        delays = np.concatenate([self.delays[name][rows[names == name]].ravel() for name in self.names])
        return float(np.nanmedian(delays)) if np.isfinite(delays).any() else None

    def by_sequence(self, channel: str, names: Sequence[str]) -> "Iterator[tuple[Any, dict[str, float]]]":
        """For each labelled sequence of a channel, its row and the share of detectors of each arm or control that find it at 5 %."""
        rows = {name: self.of_arm(name) if self.of_arm(name).any() else self.of_control(name) for name in names}
        found = {name: list(self._chosen(chosen, PRIMARY, [channel])) for name, chosen in rows.items()}
        shares = {name: each[0][1][0].mean(axis=0) for name, each in found.items() if each}
        for row in self.sequences[self.sequences["channel"] == channel].to_dict("records"):
            yield row, {name: float(share[row["sequence"]]) for name, share in shares.items()}


def rates_of(tables: "Mapping[str, pd.DataFrame]") -> Rates:
    """Computes false alarms and finds from the tables of the study.

    Args:
        tables: As `findings.KEPT.read` returns them.
    """
    import pandas as pd

    sequences = tables["sequences"].drop_duplicates(["channel", "sequence"])
    key, cells, finds, delays, num_nominal = ["arm", "detector", "seed"], [], {}, {}, {}
    for name, scores in tables["scores"].groupby("channel", sort=False):
        about = tables["channels"].query("channel == @name").iloc[0]
        ranks = scores.pivot(index=key, columns="place", values="rank")
        limits = (
            tables["thresholds"].query("channel == @name").pivot(index=key, columns="rule", values="rank").loc[ranks.index, list(RULES)]
        )
        begins = ranks.columns.to_numpy() * int(about["stride"])
        ranges = sequences.query("channel == @name")[["start", "stop"]].to_numpy()
        values, rules = ranks.to_numpy(np.int16), limits.to_numpy().T
        window, samples = int(about["window"]), int(about["samples"])
        finds[name] = finds_by_shift(values, begins, window, samples, ranges, rules)
        meets = windows_that_meet(begins, window, samples, ranges)
        is_nominal = ~meets.any(axis=0)
        num_nominal[name] = int(is_nominal.sum())
        flags = values[None] > rules[..., None]
        alarms = dict(zip(RULES, flags[..., is_nominal].mean(axis=2), strict=True))
        cells.append(ranks.index.to_frame(index=False).assign(channel=name, **alarms))
        delays[name] = np.stack(
            [_delays(flags[0][:, each], begins[each], window, start) for each, (start, _) in zip(meets, ranges, strict=True)], 1
        )
    return Rates(pd.concat(cells, ignore_index=True), finds, delays, num_nominal, sequences)


def _delays(flags: np.ndarray, begins: np.ndarray, window: int, start: int) -> np.ndarray:
    """Samples from the start of a sequence to the end of the first window that alarms, NaN without an alarm, shape `(rows,)`."""
    first = begins[np.argmax(flags, axis=1)] + window - 1 - start
    return np.where(flags.any(axis=1), np.maximum(first, 0), np.nan)
