"""Fits the noise model of a simulator: the candidate that was asked for, or the one that held-out telemetry chooses.

Rule and tolerances are those of `noise_choice`. The candidates learn the noise of the first part of the time and are judged on that of the
last part, by generated telemetry as the simulator would give it, with its levels if the channel is quantised. The classifier sees
disjoint windows only, cut into pieces if there are few of them: it recognises single windows that overlap, whatever their noise is like.
The chosen candidate is fitted again to all of the time.
"""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.two_sample import boosted_trees
from enhsim_tf.common.window_features import signal_edges
from enhsim_tf.enhanced_simulator import noise_choice
from enhsim_tf.noise.candidates import NoiseModel, fit_candidate
from enhsim_tf.noise.names import CANDIDATES
from enhsim_tf.telemetry.quantisation import Levels
from enhsim_tf.telemetry.windows import disjoint_rows

JUDGED_SHARE = 0.25  # of the time, at its end, on which candidates are judged
MOST_JUDGED = 1_000  # windows
_LEAST_JUDGED = 20
_ENOUGH_PIECES, _LEAST_PIECE = 200, 16  # disjoint pieces that the classifier should see, and their least length in samples
_DRAW = 73  # number of the random draw


@dataclasses.dataclass(frozen=True)
class NoiseWindows:
    """Windows of noise and the enhanced windows below them.

    Args:
        noise: Telemetry minus enhanced signal, shape `(windows, samples)`, in the unit of the telemetry.
        clean: Enhanced windows of the same shape.
        starts: First sample of each window, shape `(windows,)`. Needed to judge with these windows.
    """

    noise: np.ndarray
    clean: np.ndarray
    starts: np.ndarray | None = None

    @functools.cached_property
    def disjoint(self) -> "NoiseWindows":
        """Those windows that share no sample."""
        chosen = disjoint_rows(self.starts, self.noise.shape[1])
        return NoiseWindows(self.noise[chosen], self.clean[chosen], self.starts[chosen])

    def fit(self, name: str) -> NoiseModel:
        """Fits the candidate of a name to these windows."""
        return fit_candidate(name, self.noise, self.clean, self.starts)

    def __len__(self) -> int:
        return len(self.noise)


def choose_noise(
    learnt: NoiseWindows,
    judged: NoiseWindows,
    everything: NoiseWindows,
    seed: int,
    notes: list[str],
    quantisation: Levels | None = None,
    with_signal: bool = True,
) -> tuple[NoiseModel, list[dict[str, Any]]]:
    """Fits every candidate, judges it on held-out telemetry, and returns the chosen one, fitted to all of the time.

    Args:
        learnt: Windows of the first part of the time, in order.
        judged: Windows of the last part of the time, in order.
        everything: Windows of the whole time.
        seed: Seed of the draws and of the judges.
        notes: Receives a sentence for each candidate that could not be fitted.
        quantisation: Levels of the channel, or None.
        with_signal: Whether the cheap detectors see the enhanced signal with the noise, or the noise alone.

    Returns:
        The noise model; and for each candidate the fields of `noise_choice.CandidateJudgement`, `passes` and `is_chosen`. The list is
        empty if there is too little telemetry to judge; whole residual windows are drawn then.
    """
    if min(len(judged), len(learnt)) < _LEAST_JUDGED or len(compare(learnt, learnt, judged)[0]) < _LEAST_JUDGED:
        notes.append("there is too little telemetry to judge noise models; whole residual windows are drawn")
        return everything.fit("residual windows"), []
    judgements, judge = [], HeldOutJudge(learnt, judged, seed, quantisation, with_signal)
    for number, name in enumerate(CANDIDATES):
        try:
            judgements.append(judge.judge(name, learnt.fit(name), np.random.default_rng([seed, _DRAW, number])))
        except InputError as error:
            notes.append(f"noise model {name} left out: {error}")
    chosen = noise_choice.choose(judgements)
    rows = [dataclasses.asdict(each) | {"passes": bool(each.passes), "is_chosen": each.name == chosen} for each in judgements]
    return everything.fit(chosen), rows


class HeldOutJudge:
    """Judges noise models on held-out telemetry.

    Args:
        learnt: Windows from which they are fitted.
        judged: Windows that they have not seen.
        seed: Seed of the classifier and the detectors.
        quantisation: Levels of the channel, or None.
        with_signal: Whether the cheap detectors see the enhanced signal with the noise, or the noise alone.
    """

    def __init__(self, learnt: NoiseWindows, judged: NoiseWindows, seed: int, quantisation: Levels | None = None, with_signal: bool = True):
        number = min(len(judged), len(learnt), MOST_JUDGED)
        rows, last = (np.linspace(0, len(each) - 1, number).astype(int) for each in (learnt, judged))
        self._learnt, self._held_out, self._quantisation, self._clean = learnt, judged, quantisation, learnt.clean[rows]
        self._few = classified(self._clean, learnt, judged)
        signals = [each if with_signal else np.zeros_like(each) for each in (self._clean, self._clean, judged.clean[last])]
        _, *compared = compare(NoiseWindows(learnt.noise[rows], self._clean), learnt, judged)
        self._judge = noise_choice.NoiseJudge(learnt.noise[rows], judged.noise[last], signals, compared, seed=seed)

    def judge(self, name: str, model: NoiseModel, rng: np.random.Generator) -> noise_choice.CandidateJudgement:
        """Judges a fitted noise model.

        Args:
            name: Its name.
            model: The noise model.
            rng: Random generator of its noise.
        """

        def noise_on(clean: np.ndarray) -> np.ndarray:
            # sums of 32-bit numbers: where the signal is large, the noise that is judged has their steps, as the real one has
            generated = clean + model.generate(len(clean), rng, clean)
            return (generated if self._quantisation is None else self._quantisation.round(generated)) - clean

        noise = noise_on(self._clean)
        seen = compare(NoiseWindows(noise_on(self._few), self._few), self._learnt, self._held_out)[0]
        return self._judge.judge(name, noise, seen)


def classified(clean: np.ndarray, learnt: NoiseWindows, judged: NoiseWindows) -> np.ndarray:
    """Returns the enhanced windows for which noise is to be generated that a classifier sees: as many as there are disjoint windows.

    Of more windows than these, some would have to repeat real noise if the noise model draws real windows again.

    Args:
        clean: Enhanced windows, shape `(windows, samples)`.
        learnt: Windows from which the noise model was fitted.
        judged: Windows that it has not seen.
    """
    number = min(len(clean), len(learnt.disjoint), len(judged.disjoint))
    return clean[np.linspace(0, len(clean) - 1, number).astype(int)] if number else clean[:0]


def compare(generated: NoiseWindows, learnt: NoiseWindows, judged: NoiseWindows) -> list[np.ndarray]:
    """Returns what a classifier sees of generated, learnt and held-out noise: features of the pieces of `pieces_of`.

    Args:
        generated: Generated windows of noise.
        learnt: Windows from which the noise model was fitted.
        judged: Windows that it has not seen.

    Returns:
        Three arrays of the same shape, `(pieces, features)`; see `noise_choice.features_of`.
    """
    groups = pieces_of(generated, learnt, judged)
    if not len(groups[0]):
        return [np.zeros((0, 0))] * 3
    edges, unit = signal_edges(groups[1].clean), noise_choice.unit_of(groups[1].noise)
    return [noise_choice.features_of(each.noise, each.clean, edges, unit) for each in groups]


def pieces_of(generated: NoiseWindows, learnt: NoiseWindows, judged: NoiseWindows) -> list[NoiseWindows]:
    """Returns disjoint windows of each kind, as many of each, cut into pieces if there are few.

    Args:
        generated: Generated windows of noise.
        learnt: Windows from which the noise model was fitted.
        judged: Windows that it has not seen.

    Returns:
        The pieces of each, shape `(pieces, samples)`.
    """
    groups = [generated, learnt.disjoint, judged.disjoint]
    number, window = min(map(len, groups)), generated.noise.shape[1]
    if not number:
        return [NoiseWindows(*np.zeros((2, 0, window)))] * 3
    pieces = max(1, min(-(-_ENOUGH_PIECES // number), window // _LEAST_PIECE))
    short = window // pieces
    found = []
    for each in groups:
        rows = np.linspace(0, len(each) - 1, number).astype(int)
        found.append(NoiseWindows(*(windows[rows, : short * pieces].reshape(-1, short) for windows in (each.noise, each.clean))))
    return found


def auc_of(
    add_noise: Callable[[np.ndarray], np.ndarray], clean: np.ndarray, learnt: NoiseWindows, judged: NoiseWindows, seed: int
) -> dict[str, float]:
    """Returns how well a classifier tells generated, and learnt, from held-out noise, in disjoint windows or pieces of them.

    Args:
        add_noise: Adds generated noise to enhanced windows.
        clean: Enhanced windows, shape `(windows, samples)`.
        learnt: Windows from which the noise model was fitted.
        judged: Windows that it has not seen.
        seed: Seed of the classifier.

    Returns:
        The AUC of `generated` and of `real` noise; empty if there are fewer than 20 pieces of each.
    """
    few = classified(clean, learnt, judged)
    if not len(few):
        return {}
    tried = compare(NoiseWindows(add_noise(few) - few, few), learnt, judged)
    if len(tried[0]) < _LEAST_JUDGED:
        return {}
    return {kind: boosted_trees(features, tried[2], seed).auc for kind, features in (("generated", tried[0]), ("real", tried[1]))}


def sentence_of(rows: Sequence[Mapping[str, Any]], used: str) -> str:
    """Describes the judgements of all candidates in one sentence.

    Args:
        rows: As returned by `choose_noise`.
        used: Name of the noise model that was asked for.
    """
    if not rows:
        return f"Noise model: {used}."
    judged = [f"{each['name']} {each['auc']:.2f}, {each['alarms']:.1%} and {each['recall']:.0%}" for each in rows]
    (chosen,) = [each for each in rows if each["is_chosen"]]
    why = "the simplest that passes" if chosen["passes"] else "none passes, and it departs least"
    return (
        "Noise models on held-out time, by the AUC of a classifier against real noise, and the false alarms and the recall of two detectors: "
        f"{'; '.join(judged)}; real noise {chosen['real_auc']:.2f}, {chosen['real_alarms']:.1%} and {chosen['real_recall']:.0%}. "
        f"Used: {chosen['name']}, {why}."
    )


def warning_of(auc: float | None, real_auc: float | None) -> str:
    """Returns what the first line of a report says if a classifier tells generated noise from the real; otherwise an empty text.

    Args:
        auc: AUC of a classifier of generated against real noise, or None if it was not measured.
        real_auc: The same for real against other real noise.
    """
    if auc is None or auc <= noise_choice.TOLD_APART:
        return ""
    return (
        f"WARNING: a classifier tells its noise from the telemetry's (AUC {auc:.2f}; {real_auc:.2f} between two parts of the telemetry's). "
    )
