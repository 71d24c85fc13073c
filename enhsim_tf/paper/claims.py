"""What the paper claims: for each claim its sentence, how it is measured, the limits that decide,
and the verdict.

A claim is reproduced if all limits hold but those that are only shown, partly if the basic ones
hold, and otherwise not. Each limit is a distance from an ideal value, so that all can be halved or
doubled. They were fixed before the runs that they judge; `docs/report.md` says which differ from
those of an earlier run.
"""

import dataclasses
import functools
import math
import time
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV, KFold

from enhsim_tf.common import measures
from enhsim_tf.common.stages import load_arrays, save_arrays
from enhsim_tf.common.two_sample import two_sample_auc
from enhsim_tf.paper.degraded import MODES, degrade
from enhsim_tf.paper.detectors import DETECTORS, threshold
from enhsim_tf.paper.enhancer import BATCH
from enhsim_tf.paper.pipeline import Pipeline
from enhsim_tf.paper.square_wave import Signal

REPRODUCED = "reproduced"
PARTLY = "partly"
NOT_REPRODUCED = "not reproduced"
NOT_MEASURED = "not measured"
OF_UNTESTED = {REPRODUCED: "holds", PARTLY: "holds in part", NOT_REPRODUCED: "does not hold"}
"""What is said instead of a claim that the paper itself does not test."""
BASIC = "basic"
WHOLE = "whole"
SHOWN = "shown"
Measured = dict[str, float]
Measure = Callable[[Pipeline], Measured]

BATTERY_COARSE_S = 0.00669
BATTERY_FINE_S = 0.0501
"""Seconds that one orbit takes in two battery simulators: studies/battery/results/speed.parquet,
gentle regime, mean of ten seeds.
"""
ONSET = 0.25  # share of a degraded window before the degradation begins


@dataclasses.dataclass(frozen=True)
class Limit:
    """A range in which a measurement must lie.

    Args:
        name: Name of the measurement.
        words: What it is.
        low: Lowest good value.
        high: Highest good value, or the name of a measurement.
        decides: `BASIC`, `WHOLE` or `SHOWN`.
        ideal: The value from which the distances of both ends are counted.
    """

    name: str
    words: str
    low: float = -np.inf
    high: float | str = np.inf
    decides: str = BASIC
    ideal: float = 0.0

    def ends(self, measured: Measured, factor: float = 1.0) -> tuple[float, float]:
        """The lowest and the highest good value, with their distances from the ideal multiplied by
        a factor.
        """
        high = measured[self.high] if isinstance(self.high, str) else self.high
        low, high = (self.ideal + factor * (end - self.ideal) for end in (self.low, high))
        return low, high

    def holds(self, measured: Measured, factor: float = 1.0) -> bool:
        """Whether the measurement lies in the range."""
        low, high = self.ends(measured, factor)
        return low <= measured[self.name] <= high


@dataclasses.dataclass(frozen=True)
class Claim:
    """A claim of the paper.

    Args:
        id: C1 to C9.
        short: What it says, in a few words.
        sentence: What the paper says, in few words.
        section: Where.
        figure: The figure that shows it.
        limits: The limits.
        measure: Measures it; an empty dictionary where that is impossible.
        is_tested: Whether the paper itself tests it.
        margin: Share of the width of the published range by which it is widened.
    """

    id: str
    short: str
    sentence: str
    section: str
    figure: str
    limits: tuple[Limit, ...]
    measure: Measure
    is_tested: bool = True
    margin: float = 1.0


def kept(stage: str, *networks: str, version: int = 1) -> Callable[[Measure], Measure]:
    """Keeps what a function measures as a stage, after its networks: `enhancer`, `noise GAN` or
    both.

    Raise the version when changed code measures something else; the cache then measures it again.
    """

    def keep(measure: Measure) -> Measure:
        @functools.wraps(measure)
        def measured(pipeline: Pipeline) -> Measured:
            if stage not in pipeline.measured:
                for network in networks:  # trains those that are not there yet
                    _ = pipeline.enhancer_folder if network == "enhancer" else pipeline.gan_folder
                depends = pipeline.settings.of("windows", "noise", "claims")

                def save(folder: Path) -> None:
                    save_arrays(folder, measure(pipeline))

                after = ["telemetry", *networks]
                arrays = load_arrays(pipeline.stages.run(stage, save, depends, after, version))
                pipeline.measured[stage] = {name: float(array) for name, array in arrays.items()}
            return pipeline.measured[stage]

        return measured

    return keep


def times_of_windows(pipeline: Pipeline, number: int, rng: np.random.Generator) -> np.ndarray:
    """Times in seconds of windows that begin at random in 10**6 samples, float64 of shape
    `(number, window)`.
    """
    begins = rng.integers(0, 10**6, (number, 1))
    samples = begins + np.arange(pipeline.settings.window, dtype=np.float64)
    return pipeline.telemetry.interval * samples


# -- C1 ------------------------------------------------------------------------------------------


@kept("enhancement", "enhancer")
def enhancement(pipeline: Pipeline) -> Measured:
    """Errors of the enhancer, and of ridge regression on the same windows, on all disjoint test
    windows; `share_seen` of their coarse windows also occur in training.
    """
    train = pipeline.windows("train", pipeline.settings.num_windows, "training windows")
    test = pipeline.windows("test")
    order = np.argsort(train["start"])  # neighbours in time stay in one block of `KFold`
    source = train["coarse"][order].astype(np.float64)
    target = train["target"][order]
    ridge = GridSearchCV(
        Ridge(), {"alpha": np.logspace(-2, 5, 8)}, cv=KFold(5), scoring="neg_mean_squared_error"
    )
    known = {window.tobytes() for window in train["coarse"]}
    return {
        "nrmse": measures.nrmse(pipeline.enhance(test["coarse"]), test["truth"]),
        "train_nrmse": measures.nrmse(pipeline.enhance(train["coarse"]), train["truth"]),
        "coarse_nrmse": measures.nrmse(test["coarse"], test["truth"]),
        "ridge_nrmse": measures.nrmse(
            ridge.fit(source, target).predict(test["coarse"]), test["truth"]
        ),
        "share_seen": float(np.mean([window.tobytes() in known for window in test["coarse"]])),
        "allowed_nrmse": pipeline.allowed_nrmse,
    }


# -- C2 ------------------------------------------------------------------------------------------


@kept("speed", "enhancer", "noise GAN", version=2)
def speed(pipeline: Pipeline) -> Measured:
    """CPU time of the coarse simulation alone and of the whole pipeline, medians of five, and the
    memory of enhancer and generator: their weights, and what their layers put out for a batch.
    """
    settings = pipeline.settings
    rng = pipeline.draw("speed")
    seconds = {"coarse": [], "all": []}
    times = times_of_windows(pipeline, settings.speed_windows, rng)

    def simulate() -> np.ndarray:
        return pipeline.simulator(times).astype(np.float32)

    work = {"coarse": simulate, "all": lambda: pipeline.combine(simulate(), rng)}
    pipeline.combine(simulate(), rng)  # the first call traces the networks
    for _ in range(5):
        for name, run in work.items():
            began = time.process_time()
            run()
            seconds[name].append(time.process_time() - began)
    coarse = float(np.median(seconds["coarse"])) / settings.speed_windows
    whole = float(np.median(seconds["all"])) / settings.speed_windows
    added = max(whole - coarse, 0.0)
    networks = (pipeline.enhancer, pipeline.generator)
    outputs = [layer.output.shape[1:] for network in networks for layer in network.layers]
    numbers = BATCH * sum(math.prod(shape) for shape in outputs)
    numbers += sum(network.count_params() for network in networks)
    return {
        "share_of_real_time": whole / (settings.window * pipeline.telemetry.interval),
        "ratio_to_fine": (BATTERY_COARSE_S + added) / BATTERY_FINE_S,
        "ratio_to_simulator": 1 + added / BATTERY_COARSE_S,
        "ratio_to_formula": whole / coarse,
        "memory_mb": 4e-6 * numbers,
    }


# -- C3 and C8 -----------------------------------------------------------------------------------


@kept("detection", "enhancer", "noise GAN", version=2)
def detection(pipeline: Pipeline) -> Measured:
    """False-alarm rate on real nominal windows and recall in degraded modes, by training data and
    detector.
    """
    settings = pipeline.settings
    nominal = pipeline.windows("test")["target"]
    noise_sd = np.std(pipeline.noise_series("train"))
    noise = pipeline.draw("noise of degraded telemetry")
    faults = [degraded_windows(pipeline, mode, pipeline.truth) for mode in MODES]
    faults = [
        windows + settings.noise_sd * noise.standard_normal(windows.shape) for windows in faults
    ]

    def training_data(purpose: str) -> dict[str, np.ndarray]:
        drawn = pipeline.windows("train", settings.detector_windows, purpose)
        rng = pipeline.draw(f"noise, {purpose}")
        clean = pipeline.enhance(drawn["coarse"])
        return {
            "coarse": drawn["coarse"],
            "enhanced": clean,
            "enhanced + GAN noise": clean + pipeline.generate_noise(len(clean), rng),
            "enhanced + Gaussian noise": clean
            + noise_sd * rng.standard_normal(clean.shape, np.float32),
            "real": drawn["target"],
        }

    fitted = training_data("detectors, fitted")
    held_out = training_data("detectors, thresholds")
    found = {}
    held_out["real"] = pipeline.windows("calibration")["target"]
    for data, windows in fitted.items():
        for name, fit in DETECTORS.items():
            score = fit(windows, settings)
            limit = threshold(score(held_out[data]), settings.false_alarm_rate)
            found[f"false alarms, {data}, {name}"] = float(np.mean(score(nominal) > limit))
            found[f"recall, {data}, {name}"] = float(
                np.mean([np.mean(score(each) > limit) for each in faults])
            )
    return found


def too_clean(pipeline: Pipeline) -> Measured:
    """C3: the detectors that were trained on the clean enhanced signal."""
    found = detection(pipeline)
    rates = [found[f"false alarms, enhanced, {name}"] for name in DETECTORS]
    return {"least_false_alarms": min(rates), "most_false_alarms": max(rates)}


def robust(pipeline: Pipeline) -> Measured:
    """C8: each detector trained on the enhanced signal with the GAN's noise, against the same
    detector trained on telemetry, and the same with Gaussian noise in place of the GAN's.

    A detector is worse by 1 if it has twice the rate of false alarms and a point more, or finds
    five points less of the degraded windows.
    """
    found = detection(pipeline)

    def worse(data: str, name: str) -> float:
        rate, real = (found[f"false alarms, {kind}, {name}"] for kind in (data, "real"))
        recall, real_recall = (found[f"recall, {kind}, {name}"] for kind in (data, "real"))
        return max((rate - real) / (real + 0.01), (real_recall - recall) / 0.05, 0.0)

    of_gan, of_gaussian = (
        [worse(f"enhanced + {kind} noise", name) for name in DETECTORS]
        for kind in ("GAN", "Gaussian")
    )
    return half_and_most(of_gan) | half_and_most(of_gaussian, "gaussian_") | found


def half_and_most(worse: list[float], key: str = "") -> Measured:
    """By how much the better half of some cases is worse at most, and by how much all are."""
    ordered = sorted(worse)
    return {f"{key}worse_half": ordered[(len(worse) - 1) // 2], f"{key}worse_most": ordered[-1]}


# -- C4 and C5 -----------------------------------------------------------------------------------


def settling(pipeline: Pipeline) -> Measured:
    """C4: how wrong the generated noise is around the paper's number of iterations, compared with
    the first half of it and with the last quarter of twice as many.

    Wrong is the larger one of two errors, of the standard deviation in units of 10 % and of the
    lag-1 correlation in units of .05; each is the mean over the records of a stretch of training,
    so that a network which fluctuates can pass.
    """
    history = pipeline.history
    settings = pipeline.settings
    if settings.rounds < 2:
        return {}
    scale = np.abs(np.log(np.maximum(history["sd"], 1e-12) / history["real_sd"])) / 0.1
    error = np.maximum(scale, np.abs(history["lag_one"] - history["real_lag_one"]) / 0.05)
    progress = history["iteration"] / settings.iterations
    stretches = {"early": (0, 0.5), "around": (0.75, 1.25), "later": (1.5, 2)}
    errors = {
        name: float(np.mean(error[(progress > first) & (progress <= last)]))
        for name, (first, last) in stretches.items()
    }
    return {
        "gained_later": errors["around"] / errors["later"] - 1,
        "gained_before": errors["early"] / errors["around"] - 1,
        **{f"error_{name}": error for name, error in errors.items()},
    }


def balance(pipeline: Pipeline) -> Measured:
    """C5: shares of rows that the discriminator classifies correctly in the first and in the second
    half of the paper's number of iterations.
    """
    history = pipeline.history
    rows = pipeline.settings.rows
    last = pipeline.settings.iterations
    iteration = history["iteration"]
    is_late = (iteration > last / 2) & (iteration <= last)
    is_early = iteration <= last / 2
    real = history["accuracy_real"]
    generated = history["accuracy_generated"]
    early, late = (float(np.mean((real + generated)[chosen] / 2)) for chosen in (is_early, is_late))
    of_each = [float(np.mean(kind[is_late])) for kind in (real, generated)]
    low, high = binomial_interval(late, 2 * rows * int(is_late.sum()))
    return {
        "early_accuracy": early,
        "early_low": binomial_interval(early, 2 * rows * int(is_early.sum()))[0],
        "late_accuracy": late,
        "late_low": low,
        "late_high": high,
        "late_real": of_each[0],
        "late_generated": of_each[1],
        "late_least": min(of_each),
    }


def binomial_interval(share: float, number: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share of `number` independent rows."""
    found = binomtest(round(share * number), number).proportion_ci(method="wilson")
    return float(found.low), float(found.high)


# -- C6 and C7 -----------------------------------------------------------------------------------


def resemblance(generated: np.ndarray, real: np.ndarray, others: np.ndarray, seed: int) -> Measured:
    """How far generated windows are from as many real ones, disjoint and in the order of time.

    A classifier separates them from `real`: an AUC of 1 is always right, 0.5 guesses. Its floor is
    how well it separates `others`, further real windows. `rescaled_auc` is that of generated
    windows with the mean and the standard deviation of the real ones.
    """
    lag, real_lag = (
        float(measures.autocorrelation(windows, 1)[1]) for windows in (generated, real)
    )
    rescaled = np.mean(real) + np.std(real) / np.std(generated) * (generated - np.mean(generated))
    auc, floor, rescaled_auc = (
        two_sample_auc(windows, real, seed) for windows in (generated, others, rescaled)
    )
    return {
        "auc_over_floor": auc - max(floor, 0.5),
        "auc": auc,
        "floor_auc": floor,
        "rescaled_auc": rescaled_auc,
        "scale_difference": measures.scale_difference(generated, real),
        "lag_one_error": abs(lag - real_lag),
        "lag_one": lag,
        "real_lag_one": real_lag,
        "marginal_distance": measures.marginal_distance(generated, real),
        "rank_ratio": measures.effective_rank(generated) / measures.effective_rank(real),
        "roughness_ratio": measures.roughness(generated) / measures.roughness(real),
    }


@kept("noise resemblance", "noise GAN", version=2)
def noise_resemblance(pipeline: Pipeline) -> Measured:
    """C6: generated noise beside the noise of the test part."""
    real = pipeline.noise_windows("test")
    generated = pipeline.generate_noise(len(real), pipeline.draw("noise, compared"))
    return resemblance(
        generated, real, pipeline.noise_windows("train")[: len(real)], pipeline.settings.seed
    )


@kept("sum resemblance", "enhancer", "noise GAN", version=2)
def sum_resemblance(pipeline: Pipeline) -> Measured:
    """C7: the sum of both networks beside the telemetry of the test part."""
    test = pipeline.windows("test")
    combined = pipeline.combine(test["coarse"], pipeline.draw("sum, compared"))
    return resemblance(
        combined,
        test["target"],
        pipeline.windows("train")["target"][: len(combined)],
        pipeline.settings.seed,
    )


# -- C9 ------------------------------------------------------------------------------------------


def degraded_windows(
    pipeline: Pipeline, mode: str, signal: Signal, severity: float | None = None
) -> np.ndarray:
    """Windows of a signal in a degraded mode; the true signal and the simulation get the same times
    and draws.
    """
    settings = pipeline.settings
    severity = settings.severity if severity is None else severity
    times = times_of_windows(pipeline, settings.detector_windows, pipeline.draw("degraded windows"))
    size = settings.orbit_amplitude + settings.rotation_amplitude
    onset = int(ONSET * settings.window)
    draws = pipeline.draw(f"degraded {mode}")
    return degrade(
        signal, times, mode, severity, (-size, size), settings.rotation_period, draws, onset
    ).astype(np.float32)


@kept("degraded", "enhancer", version=2)
def degraded_errors(pipeline: Pipeline) -> Measured:
    """C9: errors of the enhanced signal in degraded modes that the enhancer was not trained on.

    A mode is worse by 1 if its error is twice the nominal one, or that of the coarse simulation.
    """
    found = {}
    for mode in ("nominal", *MODES):
        coarse, truth = (
            degraded_windows(pipeline, mode, signal)
            for signal in (pipeline.simulator, pipeline.truth)
        )
        found[f"nrmse, {mode}"] = measures.nrmse(pipeline.enhance(coarse), truth)
        found[f"coarse nrmse, {mode}"] = measures.nrmse(coarse, truth)
    worse = [
        max(
            found[f"nrmse, {mode}"] / found["nrmse, nominal"] - 1,
            found[f"nrmse, {mode}"] / found[f"coarse nrmse, {mode}"],
        )
        for mode in MODES
    ]
    return half_and_most(worse) | found


ERROR = "error on held-out windows, in standard deviations of the true signal"
SCALE = "log ratio of the standard deviations"
MARGINAL = "distance of the distributions of values, in standard deviations"
AUC = "AUC of a classifier of real and generated windows, above that of real ones alone"
WORSE = "how much worse than with telemetry, in tolerances: {} of three detectors"
MODE = "how much worse than nominal, in tolerances: {} of six degraded modes"

CLAIMS = (
    Claim(
        "C1",
        "The network learns the waveform",
        "A wide, shallow network learns to map the highly quantised simulation to the smooth "
        "waveform in 40 epochs.",
        "2.2",
        "fig04_enhanced_simulation",
        (
            Limit("nrmse", ERROR, high="coarse_nrmse"),
            Limit("nrmse", ERROR, high="allowed_nrmse", decides=WHOLE),
            Limit("nrmse", ERROR, high="ridge_nrmse", decides=SHOWN),
        ),
        enhancement,
    ),
    Claim(
        "C2",
        "Inference is fast",
        "Inference is extremely fast: high fidelity comes without substantial speed or memory "
        "penalties.",
        "2.2",
        "fig04_enhanced_simulation",
        (
            Limit("share_of_real_time", "CPU seconds for a second of telemetry", high=1e-4),
            Limit(
                "ratio_to_fine",
                "time divided by that of a fine simulator of a battery, timed in its study",
                high=1,
            ),
            Limit("memory_mb", "megabytes of both networks and a batch", high=1_000),
            Limit(
                "ratio_to_simulator",
                "time divided by that of a battery's coarse simulator, timed in its study",
                high=2,
                decides=WHOLE,
                ideal=1,
            ),
            Limit("memory_mb", "megabytes of both networks and a batch", high=250, decides=WHOLE),
            Limit(
                "ratio_to_formula",
                "time divided by that of the square waves, one line of NumPy",
                high=2,
                decides=SHOWN,
                ideal=1,
            ),
        ),
        speed,
        margin=20.0,
    ),
    Claim(
        "C3",
        "The enhanced signal is too clean",
        "The enhanced signal alone is too clean to train a detector on.",
        "2.2",
        "fig04_enhanced_simulation",
        (
            Limit(
                "most_false_alarms",
                "largest false-alarm rate of a detector set to 1 %",
                low=0.1,
                ideal=0.01,
            ),
            Limit(
                "least_false_alarms",
                "smallest false-alarm rate of a detector set to 1 %",
                low=0.1,
                decides=WHOLE,
                ideal=0.01,
            ),
        ),
        too_clean,
    ),
    Claim(
        "C4",
        "The GAN needs about 1,000 iterations",
        "To match the qualities of the noise, the model needed around 1,000 iterations.",
        "2.3",
        "fig12_accuracy_loss",
        (
            Limit(
                "gained_later",
                "error of the noise around 1,000 iterations, divided by the later one, minus 1",
                high=0.5,
            ),
            Limit(
                "gained_before",
                "error of the noise up to 500 iterations, divided by that around 1,000, minus 1",
                low=0.5,
                decides=WHOLE,
            ),
        ),
        settling,
    ),
    Claim(
        "C5",
        "Discriminator slightly ahead, both balanced",
        "The discriminator improves slightly faster than the generator, and the two stay balanced.",
        "2.3",
        "fig12_accuracy_loss",
        (
            Limit(
                "late_high",
                "share classified correctly in the second half of training, upper end of its "
                "interval",
                low=0.5,
                ideal=0.5,
            ),
            Limit(
                "late_low",
                "share classified correctly in the second half of training, lower end of its "
                "interval",
                high=0.8,
                ideal=0.5,
            ),
            Limit(
                "late_least",
                "the same share of the kind, real or generated, with the smaller one",
                low=0.2,
                ideal=0.5,
            ),
            Limit(
                "early_low",
                "share in the first half, lower end of its interval",
                low=0.5,
                decides=WHOLE,
                ideal=0.5,
            ),
        ),
        balance,
    ),
    Claim(
        "C6",
        "The generated noise is similar",
        "After 1,000 iterations, the generated noise is sufficiently similar to the actual noise.",
        "2.3",
        "fig06_real_or_generated_noise",
        (
            Limit("auc_over_floor", AUC, high=0.2),
            Limit("auc_over_floor", AUC, high=0.1, decides=WHOLE),
            Limit("scale_difference", SCALE, high=0.1, decides=SHOWN),
            Limit("lag_one_error", "error of the lag-1 correlation", high=0.05, decides=SHOWN),
            Limit("marginal_distance", MARGINAL, high=0.1, decides=SHOWN),
            Limit(
                "rank_ratio",
                "effective rank divided by that of real noise",
                low=0.8,
                decides=SHOWN,
                ideal=1,
            ),
        ),
        noise_resemblance,
    ),
    Claim(
        "C7",
        "The sum resembles telemetry",
        "The sum of both networks resembles the original telemetry.",
        "2.3",
        "fig13_combined",
        (
            Limit("scale_difference", SCALE, high=0.1),
            Limit("marginal_distance", MARGINAL, high=0.1),
            Limit(
                "roughness_ratio",
                "standard deviation of first differences divided by the real one",
                low=0.8,
                high=1.25,
                ideal=1,
            ),
            Limit("auc_over_floor", AUC, high=0.1, decides=WHOLE),
        ),
        sum_resemblance,
    ),
    Claim(
        "C8",
        "Detectors trained on it are robust",
        "Detectors trained on such data are robust where those trained on clean simulation are "
        "not. Tested with detectors that learn nominal windows.",
        "title, abstract",
        "fig13_combined",
        (
            Limit("worse_half", WORSE.format("the second"), high=1),
            Limit("worse_most", WORSE.format("the worst"), high=1, decides=WHOLE),
            Limit(
                "gaussian_worse_half",
                f"{WORSE.format('the second')}; Gaussian noise in place of the GAN's",
                high=1,
                decides=SHOWN,
            ),
        ),
        robust,
        is_tested=False,
    ),
    Claim(
        "C9",
        "It is right in degraded modes",
        "The enhanced simulator infers realistic signals in degraded configurations that it was "
        "not trained on.",
        "1, 3",
        "fig04_enhanced_simulation",
        (
            Limit("worse_half", MODE.format("the third"), high=1),
            Limit("worse_most", MODE.format("the worst"), high=1, decides=WHOLE),
        ),
        degraded_errors,
        is_tested=False,
    ),
)


def verdict(limits: tuple[Limit, ...], measured: Measured, factor: float = 1.0) -> str:
    """The verdict on a claim with these limits, whose distances are multiplied by a factor."""
    if not measured:
        return NOT_MEASURED
    holds = {
        kind: all(limit.holds(measured, factor) for limit in limits if limit.decides == kind)
        for kind in (BASIC, WHOLE)
    }
    return NOT_REPRODUCED if not holds[BASIC] else REPRODUCED if holds[WHOLE] else PARTLY


def judge(claim: Claim, measured: Measured) -> dict[str, Any]:
    """One record of `results.json`: the claim, its limits beside the measurements, and the
    verdict.
    """
    limits = []
    for limit in claim.limits if measured else ():
        low, high = limit.ends(measured)
        limits.append(
            {
                "name": limit.name,
                "words": limit.words,
                "value": measured[limit.name],
                "low": low if np.isfinite(low) else None,
                "high": high if np.isfinite(high) else None,
                "decides": limit.decides,
                "holds": limit.holds(measured),
            }
        )
    reached = verdict(claim.limits, measured)
    told = ("id", "short", "sentence", "section", "figure", "is_tested")
    return {name: getattr(claim, name) for name in told} | {
        "verdict": reached if claim.is_tested else OF_UNTESTED.get(reached, reached),
        "deciding": _deciding(limits),
        "limits": limits,
        "measured": measured,
    }


def _deciding(limits: list[dict[str, Any]]) -> dict[str, Any] | None:
    """The first basic limit that fails, or else the first other one that does, or else the last
    that could.
    """
    counted = [limit for kind in (BASIC, WHOLE) for limit in limits if limit["decides"] == kind]
    failed = [limit for limit in counted if not limit["holds"]]
    if failed:
        return failed[0]
    return counted[-1] if counted else None


def judge_all(pipeline: Pipeline) -> list[dict[str, Any]]:
    """The records of all claims."""
    return [
        judge(claim, {} if claim.id in pipeline.not_measured else claim.measure(pipeline))
        for claim in CLAIMS
    ]


def title(verdicts: Collection[str]) -> str:
    """The sign of the whole reproduction, from the verdicts on the claims that the paper tests."""
    if NOT_REPRODUCED in verdicts:
        return "[¬Re]"
    return "[Re]" if set(verdicts) == {REPRODUCED} else "[Re, in part]"


def outside(records: list[dict[str, Any]], published: Mapping[str, Any]) -> list[str]:
    """One line for each measurement with a limit that lies outside its published range over seeds
    and processors.

    Each range is widened on both sides by the claim's `margin` times its width, and by 5 % of its
    larger end, or by .005 if that is more.
    """
    claims = {claim.id: claim for claim in CLAIMS}
    lines = []
    for record in records:
        claim = claims[record["id"]]
        ranges = published["claims"][record["id"]]["ranges"]
        for name, (low, high) in ranges.items():
            margin = claim.margin * (high - low) + max(0.05 * max(abs(low), abs(high)), 0.005)
            value = record["measured"].get(name)
            if value is None or not low - margin <= value <= high + margin:
                lines.append(f"{record['id']}: {name} is {value}, published {low:g} to {high:g}")
    return lines
