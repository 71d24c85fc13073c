"""The steps of a replicate: errors of the enhancers, detectors, classifiers of faults, and what needs networks."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from enhsim_tf.detection.registry import DETECTORS
from studies.battery import detectors, errors
from studies.battery.labelled import labelled_rows, simulate_faults
from studies.battery.orbits import REGIMES
from studies.battery.record import Recorded
from studies.battery.speed import speed_rows
from studies.battery.windows import pair_windows
from studies.common.settings import Settings

TEMPERATURE = ("coarse itself", "level and gain", "ridge, all columns")
"""Enhancers that are judged on the temperature too."""


def _write(folder: Path, name: str, rows: list[dict[str, Any]]) -> None:
    import pandas as pd

    pd.DataFrame(rows).to_parquet(folder / f"{name}.parquet")


def make_errors(folder: Path, recorded: Recorded, regime: str, seed: int, settings: Settings, before: Path | None) -> None:
    """Writes the tables `errors`, `choice`, `trust`, `speed` and `runs` of a replicate.

    Args:
        folder: An existing folder.
        recorded: The runs.
        regime: A key of `orbits.REGIMES`.
        seed: The seed.
        settings: All settings.
        before: The folder of the step before, which this step does not need.
    """
    pairs = pair_windows(recorded, "fit", errors.NUM_WINDOWS, seed)
    enhancers = errors.fit_enhancers(pairs, tuple(errors.ENHANCERS), seed, settings.battery.paper_epochs)
    rows = errors.error_rows(recorded, enhancers, seed)
    heat = pair_windows(recorded, "fit", errors.NUM_WINDOWS, seed, target="celsius")
    rows += errors.error_rows(recorded, errors.fit_enhancers(heat, TEMPERATURE, seed, 0), seed, "celsius")
    _write(folder, "errors", rows)
    ladder = errors.choose(pairs, seed)
    choice = [
        {"rung": each.name, "error": each.error, "standard_error": each.standard_error, "is_chosen": each.name == ladder.chosen}
        for each in ladder.judged
    ]
    _write(folder, "choice", choice)
    _write(folder, "trust", errors.trust_rows(recorded, pairs))
    _write(folder, "speed", speed_rows(recorded, enhancers, REGIMES[regime], seed))
    reduced = recorded.about["reduced"]
    runs = {"num_runs": recorded.about["num_runs"], "num_reduced": len(reduced), "most_reductions": max(reduced.values(), default=0)}
    _write(folder, "runs", [runs])


def _judge(recorded: Recorded, seed: int, before: Path | None) -> detectors.Judge:
    """Fits the rung that the step `errors` has chosen again."""
    import pandas as pd

    choice = pd.read_parquet(before / "choice.parquet")
    chosen = str(choice["rung"][choice["is_chosen"]].iloc[0])
    return detectors.Judge(recorded, pair_windows(recorded, "fit", errors.NUM_WINDOWS, seed), chosen, seed)


def make_detectors(folder: Path, recorded: Recorded, regime: str, seed: int, settings: Settings, before: Path | None) -> None:
    """Writes the table `alarms` of the detectors without networks and of residuals; see `make_errors`."""
    judge = _judge(recorded, seed, before)
    names = tuple(name for name in DETECTORS if name not in detectors.NETWORKS)
    _write(folder, "alarms", judge.rows(judge.arms(), names) + judge.residual_rows())


def make_labelled(folder: Path, recorded: Recorded, regime: str, seed: int, settings: Settings, before: Path | None) -> None:
    """Writes the table `alarms` of the classifiers that learn simulated faults; see `make_errors`."""
    faults = simulate_faults(settings.battery.fault_orbits, REGIMES[regime], seed)
    _write(folder, "alarms", labelled_rows(_judge(recorded, seed, before), faults))


def make_networks(folder: Path, recorded: Recorded, regime: str, seed: int, settings: Settings, before: Path | None) -> None:
    """Writes the table `alarms` of the autoencoders, and of all detectors that learn noise of the GAN; see `make_errors`."""
    judge = _judge(recorded, seed, before)
    arms = judge.arms()
    chosen = {name: arms[name] for name in (detectors.RESAMPLED, detectors.REAL_60, detectors.REAL_120)}
    generated = judge.convolutional_arm(settings.battery.num_iterations)
    _write(folder, "alarms", judge.rows(chosen, detectors.NETWORKS) + judge.rows(generated, tuple(DETECTORS)))


STEPS: dict[str, Callable[[Path, Recorded, str, int, Settings, Path | None], None]] = {
    "errors": make_errors,
    "detectors": make_detectors,
    "labelled": make_labelled,
    "networks": make_networks,
}
"""The steps of a replicate by name, in their order."""
