"""Classifiers that learn simulated faults, which only a simulator can provide, judged on the faults of the fine simulator."""

from collections.abc import Callable

import numpy as np

from enhsim_tf.common.window_features import window_features
from studies.battery.detectors import COARSE, ENHANCED_RUN, NUM, WITH_RESIDUALS, Judge, Rows, alarm_rows, apart
from studies.battery.faults import ALL
from studies.battery.orbits import Regime, draw_load
from studies.battery.simulate import COARSE as COARSE_MODEL
from studies.battery.simulate import simulate_all
from studies.battery.windows import coarse_windows, cut_columns, window_starts

CLASSIFIERS = ("logistic regression", "boosted trees")
FAULTS = ", simulated faults"
"""Ending of the names of training data with simulated faults."""
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
        nominal, broken = (runs[0].values for runs in simulate_all(load, regime, [None, fault], [COARSE_MODEL]))
        starts = window_starts(len(broken), NUM // len(ALL))
        faulty.append(cut_columns(broken, starts))
        planned.append(cut_columns(nominal, starts))
    return np.concatenate(faulty), np.concatenate(planned)


def classifier_rows(judge: Judge, faults: tuple[np.ndarray, np.ndarray]) -> Rows:
    """Judges classifiers that learn nominal windows and windows of simulated faults.

    They learn three kinds of windows: of the coarse simulator, enhanced with residual windows, and the difference of the latter
    from the enhanced run of the planned orbits.

    Args:
        judge: The enhancer and the windows of a replicate.
        faults: What `simulate_faults` returns.

    Returns:
        Rows as `detectors.alarm_rows` returns them.
    """
    nominal = coarse_windows(judge.recorded, "coarse", 2 * NUM)
    faulty, planned = faults
    noise = judge.noise(len(nominal) + len(faulty), 3)
    of_nominal, of_faulty = noise[: len(nominal)], noise[len(nominal) :]
    windows = {fault: pairs.telemetry for fault, pairs in judge.test.items()}
    enhanced = judge.enhance(faulty) + of_faulty
    kinds = {
        COARSE: (nominal[:, :, 0], faulty[:, :, 0], windows),
        WITH_RESIDUALS: (judge.enhance(nominal) + of_nominal, enhanced, windows),
        ENHANCED_RUN: (of_nominal, enhanced - judge.enhance(planned), judge.differences()),
    }
    rows = []
    for training, (normal, broken, judged) in kinds.items():
        learnt, held_out = apart(normal, 1 / 2, judge.num_coarse)
        labels = np.repeat([0, 1], [len(learnt), len(broken)])
        for name in CLASSIFIERS:
            score = _classifier(name, np.concatenate([learnt, broken]), labels, judge.seed)
            scores = {fault: score(each) for fault, each in judged.items()}
            rows += alarm_rows(training + FAULTS, name, score(held_out), scores, judge.num_stretches)
    return rows


def _classifier(name: str, windows: np.ndarray, labels: np.ndarray, seed: int) -> Score:
    """Fits a classifier that scores how likely a fault is."""
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
