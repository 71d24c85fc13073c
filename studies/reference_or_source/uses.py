"""What the same simulator can be used for, with equal data and with thresholds set alike.

| use | a detector learns | it judges |
|---|---|---|
| source | generated nominal windows | telemetry |
| source, faults | generated windows, nominal and with simulated faults | telemetry |
| reference | differences of known telemetry from the enhanced run | the difference from the enhanced run |
| coarse reference | differences of known telemetry from the coarse run | the difference from the coarse run |
| reference, faults | noise, and differences that simulated faults make | the difference from the enhanced run |
| no simulator | known telemetry | telemetry |
| both | as reference, and as no simulator | the larger of the two scores |

Thresholds are set on the known nominal windows, for every use.
"""

import dataclasses
import functools
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from studies.reference_or_source.detectors import (
    CLASSIFIERS,
    ONE_CLASS,
    ONE_LINERS,
    across_folds,
    classifier,
)
from studies.reference_or_source.enhancers import Map, fit_map
from studies.reference_or_source.windows import Judged, by_fold

SOURCE, SOURCE_FAULTS = "source", "source, faults"
REFERENCE, COARSE_REFERENCE, REFERENCE_FAULTS = "reference", "coarse reference", "reference, faults"
NO_SIMULATOR, BOTH = "no simulator", "both"
USES = (SOURCE, SOURCE_FAULTS, REFERENCE, COARSE_REFERENCE, REFERENCE_FAULTS, NO_SIMULATOR, BOTH)
DRAWS = ("joint", "separate", "randomised")
"""How noise is drawn: residual windows of all channels at once, of each channel on its own, or at once with a random scale of each channel."""
_NUM_FAULTY = 40  # windows of each simulated fault that classifiers learn from


@dataclasses.dataclass(frozen=True)
class Scores:
    """Scores of one detector in one use.

    Args:
        use: One of `USES`.
        detector: Name of the detector.
        known: Scores of the known nominal windows, none of which the detector has learnt from.
        tested: Scores of the tested windows.
    """

    use: str
    detector: str
    known: np.ndarray
    tested: np.ndarray


class Cell:
    """The uses of one simulator with known telemetry.

    Args:
        windows: The windows.
        seed: Seed of detectors and draws.
        enhancer: The enhancer, see `enhancers.fit_map`.
        draws: How noise is drawn, one of `DRAWS`.
        is_unknown: Whether the commands are unknown. Windows of the known telemetry are then paired with the most similar ones of the source.
        alone: Scores without a simulator of cells with the same telemetry, by detector, to which those of this one are added.
    """

    def __init__(
        self,
        windows: Judged,
        seed: int,
        enhancer: str = "ridge",
        draws: str = "joint",
        is_unknown: bool = False,
        alone: dict[str, Scores] | None = None,
    ):
        self.alone = {} if alone is None else alone
        self.windows, self.seed, self.enhancer, self.draws, self.is_unknown = (
            windows,
            seed,
            enhancer,
            draws,
            is_unknown,
        )
        known = windows.known
        self._maps: dict[bytes, Map] = {}
        self._nominal: dict[bytes, np.ndarray] = {}
        self.planned = self._nearest(known.telemetry) if is_unknown else known.coarse
        self.residuals = by_fold(
            known.folds,
            lambda learnt, held_out: self._less(
                known.telemetry[held_out], self.planned[held_out], self._learnt(learnt)
            ),
        )

    @property
    def enhance(self) -> Map:
        """The enhancer that has learnt from all known windows."""
        return self._learnt(None)

    def _learnt(self, rows: np.ndarray | None) -> Map:
        """The enhancer that has learnt from some known windows, fitted once; None: from all."""
        key, known = b"" if rows is None else rows.tobytes(), self.windows.known
        if key not in self._maps:
            some = slice(None) if rows is None else rows
            self._maps[key] = fit_map(
                self.enhancer,
                self.planned[some],
                known.telemetry[some],
                known.starts[some],
                known.folds[some],
                self.seed,
            )
        return self._maps[key]

    def _enhanced_source(self, rows: np.ndarray | None) -> np.ndarray:
        """The source, enhanced by what some known windows teach; None: all."""
        key = b"" if rows is None else rows.tobytes()
        if key not in self._nominal:
            self._nominal[key] = self._learnt(rows)(self.windows.source)
        return self._nominal[key]

    def _nearest(self, telemetry: np.ndarray) -> np.ndarray:
        """Coarse windows of the source that are most similar to telemetry, the channels at mean 0 and deviation 1."""
        number, source = telemetry.shape[2], self.windows.source
        known, library = self.windows.known.telemetry, source[:, :, :number]
        spread = library.std(axis=(0, 1))
        library = (library - library.mean(axis=(0, 1))) / np.where(spread > 1e-6, spread, np.inf)
        return source[
            _nearest_rows(library, (telemetry - known.mean(axis=(0, 1))) / known.std(axis=(0, 1)))
        ]

    def _less(self, telemetry: np.ndarray, planned: np.ndarray, enhance: Map) -> np.ndarray:
        if not self.is_unknown:
            return telemetry - enhance(planned)
        library = enhance(self.windows.source)
        return telemetry - library[_nearest_rows(library, telemetry)]

    @functools.cached_property
    def differences(self) -> np.ndarray:
        """Differences of the tested telemetry from the enhanced run."""
        tested = self.windows.tested
        return self._less(tested.telemetry, tested.coarse, self.enhance)

    def noise(self, number: int, stream: int, rows: np.ndarray | None = None) -> np.ndarray:
        """Draws residual windows of some known windows (None: all) in one of several random streams; `(number, samples, channels)`."""
        rng, residuals = (
            np.random.default_rng([self.seed, 200, stream]),
            self.residuals if rows is None else self.residuals[rows],
        )
        channels = residuals.shape[2]
        if self.draws == "separate":
            return np.stack(
                [
                    residuals[rng.integers(0, len(residuals), number), :, each]
                    for each in range(channels)
                ],
                axis=2,
            )
        drawn = residuals[rng.integers(0, len(residuals), number)]
        return (
            drawn * np.exp(rng.uniform(-np.log(2), np.log(2), (number, 1, channels)))
            if self.draws == "randomised"
            else drawn
        )

    def scores(self, uses: tuple[str, ...] = USES) -> Iterator[Scores]:
        """Scores of every detector in every use that is tried."""
        known, tested = self.windows.known, self.windows.tested
        alone: dict[str, dict[str, Scores]] = {}
        signals: dict[str, Callable[[], tuple[np.ndarray, np.ndarray]]] = {
            REFERENCE: lambda: (self.residuals, self.differences),
            COARSE_REFERENCE: lambda: (
                known.telemetry - self._as_channels(self.planned),
                tested.telemetry
                - self._as_channels(
                    self._nearest(tested.telemetry) if self.is_unknown else tested.coarse
                ),
            ),
            NO_SIMULATOR: lambda: (known.telemetry, tested.telemetry),
        }
        for use in (
            use for use in signals if use in uses or (BOTH in uses and use == NO_SIMULATOR)
        ):
            learnt, judged = signals[use]()
            detectors = ONE_CLASS | (ONE_LINERS if use == NO_SIMULATOR and use in uses else {})
            alone[use] = {
                name: self._one_class(use, name, make, learnt, judged)
                for name, make in detectors.items()
            }
            yield from alone[use].values() if use in uses else ()
        if BOTH in uses:
            for name in ONE_CLASS:
                pair = [_standard(alone[use][name]) for use in (REFERENCE, NO_SIMULATOR)]
                yield Scores(BOTH, name, *(np.maximum(*each) for each in zip(*pair, strict=True)))
        if SOURCE in uses:
            for name, make in ONE_CLASS.items():
                scores = by_fold(
                    known.folds,
                    lambda rows, held_out, make=make: self._learn_generated(make, rows).score(
                        known.telemetry[held_out]
                    ),
                )
                yield Scores(
                    SOURCE, name, scores, self._learn_generated(make).score(tested.telemetry)
                )
        if self.windows.simulated and {SOURCE_FAULTS, REFERENCE_FAULTS} & set(uses):
            yield from self.classified(tuple(self.windows.simulated), uses)

    def classified(self, faults: Sequence[int], uses: tuple[str, ...] = USES) -> Iterator[Scores]:
        """Scores of classifiers that learn the simulated faults of these numbers.

        Known windows are scored by classifiers whose enhancer and noise come from other folds.
        """
        known, tested = self.windows.known, self.windows.tested
        some = [
            tuple(_spread(each) for each in self.windows.simulated[number]) for number in faults
        ]
        broken, expected = (np.concatenate(each) for each in zip(*some, strict=True))

        def train(use: str, name: str, rows: np.ndarray | None = None) -> Map:
            enhance = self._learnt(rows)
            nominal, faulty = self._enhanced_source(rows), enhance(broken)
            if use == REFERENCE_FAULTS:
                nominal, faulty = np.zeros_like(nominal), faulty - enhance(expected)
            drawn = [
                each + self.noise(len(each), stream, rows)
                for stream, each in enumerate((nominal, faulty), 2)
            ]
            return classifier(name, *drawn, self.seed)

        signals = {
            SOURCE_FAULTS: (known.telemetry, tested.telemetry),
            REFERENCE_FAULTS: (self.residuals, self.differences),
        }
        for use in (use for use in signals if use in uses):
            learnt, judged = signals[use]
            for name in CLASSIFIERS:
                make = functools.partial(train, use, name)
                scores = by_fold(
                    known.folds,
                    lambda rows, held_out, make=make, learnt=learnt: make(rows)(learnt[held_out]),
                )
                yield Scores(use, name, scores, make()(judged))

    def _learn_generated(self, make: Callable[[int], Any], rows: np.ndarray | None = None) -> Any:
        """Fits a detector to windows that were generated from some known windows; None: from all."""
        generated = self._enhanced_source(rows)
        return make(self.seed).fit(generated + self.noise(len(generated), 1, rows))

    def _one_class(
        self,
        use: str,
        name: str,
        make: Callable[[int], Any],
        learnt: np.ndarray,
        judged: np.ndarray,
    ) -> Scores:
        if use == NO_SIMULATOR and name in self.alone:
            return self.alone[name]
        fitted, known = across_folds(make, learnt, self.windows.known.folds, self.seed)
        scores = Scores(use, name, known, fitted.score(judged))
        if use == NO_SIMULATOR:
            self.alone[name] = scores
        return scores

    def _as_channels(self, coarse: np.ndarray) -> np.ndarray:
        """The coarse columns of the channels, in the units of the telemetry windows."""
        return coarse[:, :, : len(self.windows.scale)] / self.windows.scale


def _standard(scores: Scores) -> tuple[np.ndarray, np.ndarray]:
    """Scores in units of the spread of the known ones, so that two detectors can be compared."""
    middle, high = np.quantile(scores.known, (0.5, 0.9))
    unit = high - middle or 1.0
    return (scores.known - middle) / unit, (scores.tested - middle) / unit


def _nearest_rows(library: np.ndarray, windows: np.ndarray) -> np.ndarray:
    """The row of the library that is nearest to each window, by Euclidean distance."""
    table, wanted = (each.reshape(len(each), -1).astype(np.float32) for each in (library, windows))
    squares = np.sum(table**2, axis=1)
    return np.concatenate(
        [
            np.argmin(squares - 2 * part @ table.T, axis=1)
            for part in np.array_split(wanted, max(1, len(wanted) // 500))
        ]
    )


def _spread(windows: np.ndarray) -> np.ndarray:
    """At most `_NUM_FAULTY` windows, spread evenly."""
    return windows[np.linspace(0, len(windows) - 1, min(_NUM_FAULTY, len(windows))).astype(int)]
