"""What the same telemetry can be used for with and without a simulator, with equal data and with
thresholds set alike.

| use | a detector learns | it judges |
|---|---|---|
| reference | differences of known telemetry from the enhanced run | the difference from the enhanced run |
| coarse reference | differences of known telemetry from the coarse run | the difference from the coarse run |
| source | generated nominal windows | telemetry |
| no simulator | known telemetry | telemetry |
| commands and sums | differences from a regression on the commands | the difference from it |
| autoregression with inputs | errors of a prediction by last samples and commands | its errors |
"""

import functools
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np

from studies.reference_or_source import autoregression
from studies.reference_or_source.detectors import ONE_CLASS, across_folds
from studies.reference_or_source.inputs import Map, fit_map, regressions
from studies.reference_or_source.windows import Judged, by_fold

REFERENCE = "reference"
COARSE_REFERENCE = "coarse reference"
SOURCE = "source"
NO_SIMULATOR = "no simulator"
COMMANDS = "commands and sums"
ONE_STEP = "autoregression with inputs"
OF_SIMULATOR = (REFERENCE, COARSE_REFERENCE, SOURCE)
WITHOUT = (NO_SIMULATOR, COMMANDS, ONE_STEP)
"""Uses with a simulator, and those that need none."""


class Scores(NamedTuple):
    """Scores of one detector in one use.

    Args:
        use: One of `OF_SIMULATOR` and `WITHOUT`.
        detector: Name of the detector.
        known: Scores of the known nominal windows, none of which the detector has learnt from.
        tested: Scores of the tested windows.
    """

    use: str
    detector: str
    known: np.ndarray
    tested: np.ndarray


class Comparison:
    """The uses of one simulator with known telemetry, and of none.

    Args:
        windows: The windows.
        seed: Seed of detectors and draws.
    """

    def __init__(self, windows: Judged, seed: int):
        self.windows = windows
        self.seed = seed
        self._maps: dict[bytes, Map] = {}

    def scores(
        self, uses: tuple[str, ...], detectors: Iterable[str] = ONE_CLASS
    ) -> Iterator[Scores]:
        """Scores of some detectors in some uses."""
        known = self.windows.known
        tested = self.windows.tested
        number = known.telemetry.shape[2]
        signals: dict[str, Callable[[], tuple[np.ndarray, np.ndarray]]] = {
            REFERENCE: lambda: (
                self.residuals,
                tested.telemetry - self.enhance(tested.coarse),
            ),
            COARSE_REFERENCE: lambda: tuple(
                part.telemetry - part.coarse[:, :, :number] / self.windows.scale
                for part in (known, tested)
            ),
            NO_SIMULATOR: lambda: (known.telemetry, tested.telemetry),
            COMMANDS: self._less_commands,
            ONE_STEP: self._less_autoregression,
            SOURCE: lambda: (known.telemetry, tested.telemetry),
        }
        for use in (use for use in signals if use in uses):
            signal, judged = signals[use]()
            for name in detectors:
                yield self._scores(use, name, signal, judged)

    def _scores(self, use: str, name: str, signal: np.ndarray, judged: np.ndarray) -> Scores:
        """Scores of one detector, from the known windows of a use and from those that it judges."""

        def learn(rows: np.ndarray | None) -> Any:
            if use == SOURCE:
                windows = self._generated(rows)
            else:
                windows = signal if rows is None else signal[rows]
            return ONE_CLASS[name](self.seed).fit(windows)

        fitted, scores = across_folds(learn, signal, self.windows.known.folds)
        return Scores(use, name, scores, fitted.score(judged))

    @functools.cached_property
    def residuals(self) -> np.ndarray:
        """Known telemetry less the run that was enhanced by what other folds teach."""
        known = self.windows.known
        return by_fold(
            known.folds,
            lambda learnt, held_out: (
                known.telemetry[held_out] - self.enhance(known.coarse[held_out], learnt)
            ),
        )

    def enhance(self, coarse: np.ndarray, rows: np.ndarray | None = None) -> np.ndarray:
        """Enhances coarse windows by what some known windows teach; None: all."""
        key = b"" if rows is None else rows.tobytes()
        known = self.windows.known
        if key not in self._maps:
            some = known if rows is None else known.take(rows)
            self._maps[key] = fit_map(some.coarse, some.telemetry, some.starts)
        return self._maps[key](coarse)

    def _generated(self, rows: np.ndarray | None) -> np.ndarray:
        """Windows that are generated from some known windows; None: from all."""
        rng = np.random.default_rng([self.seed, 200, 1])
        residuals = self.residuals if rows is None else self.residuals[rows]
        nominal = self.enhance(self.windows.source, rows)
        noise = residuals[rng.integers(0, len(residuals), len(nominal))]
        return nominal + noise

    def _less_commands(self) -> tuple[np.ndarray, np.ndarray]:
        """Known and tested telemetry less a ridge regression on the commands.

        For each channel, the regression is taken that predicts known windows of other folds best.
        """
        known = self.windows.known
        tested = self.windows.tested
        residuals = []
        differences = []
        errors = []
        for fit in regressions(known.inputs.shape[2]).values():
            residuals.append(
                by_fold(
                    known.folds,
                    lambda rows, held_out, fit=fit: (
                        known.telemetry[held_out]
                        - fit(known.inputs[rows], known.telemetry[rows], known.starts[rows])(
                            known.inputs[held_out]
                        )
                    ),
                )
            )
            errors.append(np.mean(residuals[-1] ** 2, axis=(0, 1)))
            predict = fit(known.inputs, known.telemetry, known.starts)
            differences.append(tested.telemetry - predict(tested.inputs))
        chosen = np.argmin(errors, axis=0)
        return tuple(
            np.stack([parts[place][:, :, channel] for channel, place in enumerate(chosen)], axis=2)
            for parts in (residuals, differences)
        )

    def _less_autoregression(self) -> tuple[np.ndarray, np.ndarray]:
        """Errors of a vector autoregression with inputs on known and tested telemetry."""
        known = self.windows.known
        tested = self.windows.tested
        model = autoregression.choose(known.telemetry, known.inputs, known.folds)
        errors = autoregression.held_out_errors(model, known.telemetry, known.inputs, known.folds)
        model.fit(known.telemetry, known.inputs)
        return errors, model.errors(tested.telemetry, tested.inputs)
