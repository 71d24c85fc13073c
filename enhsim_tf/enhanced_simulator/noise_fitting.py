"""Fits the noise model of a simulator: the rung of the ladder that was asked for, or the one that held-out telemetry chooses.

Rule and tolerances are those of `noise_choice`. The rungs learn the noise of the first part of the time and are judged on that of the
last part, by generated telemetry as the simulator would give it, with its levels if the channel is quantised. The classifier sees
disjoint windows only, cut into pieces if there are few of them: it recognises single windows that overlap, whatever their noise is like.
A chosen rung without a network is fitted again to all of the time.
"""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.common.console import SILENT, Progress
from enhsim_tf.common.errors import InputError
from enhsim_tf.enhanced_simulator import noise_choice
from enhsim_tf.noise import ladder
from enhsim_tf.noise.rung_names import BY_OPTION, FOLLOWERS, GANS, NETWORKS, SAVED, STREAMS
from enhsim_tf.realism.two_sample import boosted_trees
from enhsim_tf.realism.window_features import signal_edges
from enhsim_tf.telemetry.quantisation import Levels
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import disjoint_rows, first_samples

if TYPE_CHECKING:
    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

JUDGED_SHARE = 0.25  # of the time, at its end, on which rungs are judged
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

    def __len__(self) -> int:
        return len(self.noise)


def noise_windows(simulator: "EnhancedSimulator", parts: Sequence[Telemetry], starts: np.ndarray) -> NoiseWindows:
    """Returns the noise of telemetry, and the enhanced signal below it.

    Args:
        simulator: The simulator, whose enhancer is trained.
        parts: Telemetry, or the parts between its gaps.
        starts: Start of each window, counted over all parts as in `telemetry.windows`.
    """
    pairs = simulator.pairs(parts, starts)
    clean = simulator.follow(pairs)
    return NoiseWindows(pairs.target - clean, clean, first_samples(parts, starts, simulator.window))


@dataclasses.dataclass(frozen=True)
class NoiseTraining:
    """How noise models are fitted.

    Args:
        num_iterations: Adversarial iterations of the GANs. The autoregressive network takes three times as many.
        seed: Seed of the training.
        to_unit: Converts enhanced windows to the unit in which noise that follows the signal receives them.
        quantisation: Levels of the channel, or None.
        with_signal: Whether the cheap detectors see the enhanced signal with the noise, or the noise alone.
        unit: Unit of the paper's GAN, in the unit of the telemetry. None: it follows from the noise.
        verbose: Progress bars of the GANs: 0 none, 1 always, "auto" on a terminal.
        progress: Reports the progress of the trainings as lines of text.
    """

    num_iterations: int
    seed: int
    to_unit: Callable[[np.ndarray], np.ndarray]
    quantisation: Levels | None = None
    with_signal: bool = True
    unit: float | None = None
    verbose: int | str = 0
    progress: Progress = SILENT


def fit_noise(option: str, windows: NoiseWindows, training: NoiseTraining, notes: list[str]) -> Any:
    """Fits the rung of one option.

    Args:
        option: A key of `rung_names.BY_OPTION`.
        windows: Windows to learn from.
        training: How they are learnt.
        notes: Receives a sentence for each training that diverged.

    Returns:
        The noise model.

    Raises:
        InputError: If the rung cannot be fitted to this noise.
    """
    is_adversarial = option in GANS
    number = training.num_iterations * (1 if is_adversarial else 3)
    name = "noise GAN, iteration" if is_adversarial else "noise network, iteration"
    count = training.progress.loop(name, number) if option in NETWORKS else None
    watch = ladder.Watch(None if training.verbose == "auto" else bool(training.verbose), count, notes.append)
    signal = training.to_unit(windows.clean) if option in FOLLOWERS else None
    task = ladder.FitTask(windows.noise, signal, number, training.seed, windows.starts, watch)
    return ladder.fit_paper_gan(task, training.unit) if option == "paper" else ladder.RUNGS[BY_OPTION[option]](task)


def choose_noise(
    learnt: NoiseWindows, judged: NoiseWindows, everything: NoiseWindows, training: NoiseTraining, notes: list[str]
) -> tuple[Any, list[dict[str, Any]]]:
    """Fits every rung, judges it on held-out telemetry, and returns the chosen one.

    Args:
        learnt: Windows of the first part of the time, in order.
        judged: Windows of the last part of the time, in order.
        everything: Windows of the whole time, for a chosen rung without a network.
        training: How they are learnt.
        notes: Receives a sentence for each rung that could not be fitted or diverged.

    Returns:
        The noise model; and for each rung its `name`, the numbers of `noise_choice.RungJudgement`, `passes` and `is_chosen`. The
        list is empty if there is too little telemetry to judge; whole residual windows are drawn then.
    """
    if min(len(judged), len(learnt)) < _LEAST_JUDGED or len(compare(learnt, learnt, judged)[0]) < _LEAST_JUDGED:
        notes.append("there is too little telemetry to judge noise models; whole residual windows are drawn")
        return fit_noise("residual windows", everything, training, notes), []
    models, judgements, judge = {}, [], HeldOutJudge(learnt, judged, training)
    for option in SAVED:
        try:
            model = fit_noise(option, learnt, training, notes)
            judgements.append(judge.judge(option, model))
            models[option] = model
        except InputError as error:
            notes.append(f"noise model {option} left out: {error}")
    chosen = noise_choice.choose(judgements)
    model = models[chosen] if chosen in NETWORKS else fit_noise(chosen, everything, training, notes)
    return model, rows_of(judgements, chosen)


class HeldOutJudge:
    """Judges noise models on held-out telemetry.

    Args:
        learnt: Windows from which they are fitted.
        judged: Windows that they have not seen.
        training: How they are fitted.
    """

    def __init__(self, learnt: NoiseWindows, judged: NoiseWindows, training: NoiseTraining):
        number = min(len(judged), len(learnt), MOST_JUDGED)
        rows, last = (np.linspace(0, len(each) - 1, number).astype(int) for each in (learnt, judged))
        self._learnt, self._held_out, self._training, self._clean = learnt, judged, training, learnt.clean[rows]
        self._few = classified(self._clean, learnt, judged)
        signals = [each if training.with_signal else np.zeros_like(each) for each in (self._clean, self._clean, judged.clean[last])]
        _, *compared = compare(NoiseWindows(learnt.noise[rows], self._clean), learnt, judged)
        self._judge = noise_choice.NoiseJudge(learnt.noise[rows], judged.noise[last], signals, compared, seed=training.seed)

    def judge(self, option: str, model: Any) -> noise_choice.RungJudgement:
        """Judges a fitted noise model.

        Args:
            option: Name of its rung.
            model: The noise model.
        """
        training = self._training
        rng = np.random.default_rng([training.seed, _DRAW, STREAMS[option]])

        def noise_on(clean: np.ndarray) -> np.ndarray:
            # sums of 32-bit numbers: where the signal is large, the noise that is judged has their steps, as the real one has
            generated = clean + ladder.generate(model, len(clean), rng, training.to_unit(clean))
            return (generated if training.quantisation is None else training.quantisation.round(generated)) - clean

        noise = noise_on(self._clean)
        seen = compare(NoiseWindows(noise_on(self._few), self._few), self._learnt, self._held_out)[0]
        return self._judge.judge(option, noise, seen)


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
    """Describes the judgements of all rungs in one sentence.

    Args:
        rows: As returned by `choose_noise`.
        used: The option that the model was fitted with.
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


def rows_of(judgements: Sequence[noise_choice.RungJudgement], chosen: str) -> list[dict[str, Any]]:
    """Returns judgements in plain JSON types."""
    return [
        {"name": each.rung, **{name: value for name, value in dataclasses.asdict(each).items() if name != "rung"}}
        | {"passes": bool(each.passes), "is_chosen": each.rung == chosen}
        for each in judgements
    ]
