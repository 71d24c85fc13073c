"""Classifiers that learn simulated faults, which only a simulator can provide, judged on the faults of the fine simulator."""

from collections.abc import Callable
from typing import Any

import numpy as np

from enhsim_tf.realism.window_features import window_features
from studies.battery.detectors import COARSE, NUM, RESAMPLED, Judge, apart, judge
from studies.battery.errors import fault_windows
from studies.battery.faults import ALL
from studies.battery.orbits import Regime, draw_load
from studies.battery.simulate import simulate_all
from studies.battery.windows import coarse_windows, cut_windows_of_columns, window_starts

CLASSIFIERS = ("logistic regression", "boosted trees")
DIFFERENCE = "residual of the enhanced run, faults in training"
"""The arm whose windows are differences from the run of the planned orbits."""
_STREAM = 200  # of the seed, for the loads

Score = Callable[[np.ndarray], np.ndarray]


def simulate_faults(num_orbits: int, regime: Regime, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Simulates faults with the coarse simulator alone. Each fault at each severity has orbits of its own.

    Args:
        num_orbits: Orbits under each fault at each severity.
        regime: How hard the battery is used.
        seed: Seed of the loads.

    Returns:
        Windows under faults and windows of the same orbits as they were planned, each of shape `(windows, WINDOW, 3)` with the
        same number of windows for each of `faults.ALL`, in its order.

    Raises:
        InputError: If PyBaMM is not installed, or a solver fails at any current.
    """
    faulty, planned = [], []
    for number, fault in enumerate(ALL):
        load = draw_load(num_orbits + 1, regime, np.random.default_rng([seed, _STREAM, number]))
        nominal, broken = (runs[0].values for runs in simulate_all(load, regime, [None, fault], ["coarse"]))
        starts = window_starts(len(broken), NUM // len(ALL))
        faulty.append(cut_windows_of_columns(broken, starts))
        planned.append(cut_windows_of_columns(nominal, starts))
    return np.concatenate(faulty), np.concatenate(planned)


def labelled_rows(trained: Judge, faults: tuple[np.ndarray, np.ndarray]) -> list[dict[str, Any]]:
    """Judges classifiers that learn nominal windows and windows of simulated faults.

    They learn three kinds of windows: of the coarse simulator, enhanced with residuals drawn again, and the difference of the
    latter from the enhanced run of the planned orbits.

    Args:
        trained: The enhancer and the windows of a replicate.
        faults: What `simulate_faults` returns.

    Returns:
        Rows as `detectors.judge` returns them.
    """
    nominal, _ = coarse_windows(trained.recorded, "coarse", 2 * NUM)
    faulty, planned = faults
    enhance = trained.enhancer.predict
    noise = trained.noise(len(nominal) + len(faulty), 3)
    noises = noise[: len(nominal)], noise[len(nominal) :]
    kinds = {
        f"{COARSE}, faults in training": (nominal[:, :, 0], faulty[:, :, 0]),
        f"{RESAMPLED}, faults in training": (enhance(nominal) + noises[0], enhance(faulty) + noises[1]),
        DIFFERENCE: (noises[0], enhance(faulty) + noises[1] - enhance(planned)),
    }
    windows = {fault: pairs.telemetry for fault, pairs in trained.test.items()}
    differences = {}
    for fault in windows:
        pairs = fault_windows(trained.recorded, fault, trained.seed, is_planned=True)
        differences[fault] = pairs.telemetry - enhance(pairs.coarse)
    rows = []
    for arm, (normal, broken) in kinds.items():
        training, held_out = apart(normal, 1 / 2, trained.num_coarse)
        labels = np.repeat([0, 1], [len(training), len(broken)])
        for name in CLASSIFIERS:
            score = _classifier(name, np.concatenate([training, broken]), labels, trained.seed)
            scores = {fault: score(each) for fault, each in (differences if arm == DIFFERENCE else windows).items()}
            rows += judge(arm, name, score(held_out), scores, trained.num_stretches)
    return rows


def _classifier(name: str, windows: np.ndarray, labels: np.ndarray, seed: int) -> Score:
    """Fits a classifier that gives the probability of a fault."""
    from threadpoolctl import threadpool_limits

    if name == "boosted trees":
        from sklearn.ensemble import HistGradientBoostingClassifier

        trees = HistGradientBoostingClassifier(random_state=seed).fit(window_features(windows), labels)
        return lambda each: trees.predict_proba(window_features(each))[:, 1]
    from sklearn.linear_model import LogisticRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    with threadpool_limits(1):
        machine = make_pipeline(StandardScaler(), LogisticRegression(C=0.01, max_iter=300)).fit(windows, labels)
    return machine.decision_function
