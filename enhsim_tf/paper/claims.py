"""What the paper claims: for each claim its sentence, how it is measured, the limits that decide, and the verdict.

A claim is reproduced if all its limits hold, partly if the basic ones hold, and otherwise not. Further hurdles are this project's: they
are shown beside the verdict and do not enter it. The limits were fixed before the runs that they judge; `docs/report.md` says which differ
from those of an earlier run.
"""

import dataclasses
import functools
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV, KFold
from sklearn.neighbors import KNeighborsRegressor

from enhsim_tf.common import measures
from enhsim_tf.common.stages import load_arrays, save_arrays
from enhsim_tf.common.two_sample import two_sample_auc
from enhsim_tf.paper.degraded import MODES, degrade
from enhsim_tf.paper.detectors import DETECTORS, threshold
from enhsim_tf.paper.pipeline import Pipeline
from enhsim_tf.paper.square_wave import Signal

REPRODUCED, PARTLY, NOT_REPRODUCED, NOT_MEASURED = (
    "reproduced",
    "partly",
    "not reproduced",
    "not measured",
)
OF_UNTESTED = {REPRODUCED: "holds", PARTLY: "holds in part", NOT_REPRODUCED: "does not hold"}
"""What is said instead of a claim that the paper itself does not test."""
BASIC, WHOLE, OURS = "basic", "whole", "ours"
Measured = dict[str, float]
Measure = Callable[[Pipeline], Measured]

BATTERY_COARSE_S, BATTERY_FINE_S = 0.00669, 0.0501
"""Seconds that one orbit takes in two battery simulators: studies/battery/results/speed.parquet, gentle regime, mean of ten seeds."""
ONSET = 0.25  # share of a degraded window before the degradation begins
LOUDER = 1.10
"""Real noise that is louder by this factor is as different as the tolerance on its scale allows."""


@dataclasses.dataclass(frozen=True)
class Limit:
    """A range in which a measurement must lie.

    Args:
        name: Name of the measurement.
        words: What it is.
        low: Lowest good value.
        high: Highest good value, or the name of a measurement.
        decides: `BASIC`, `WHOLE` or `OURS`.
    """

    name: str
    words: str
    low: float = -np.inf
    high: float | str = np.inf
    decides: str = BASIC

    def holds(self, measured: Measured) -> bool:
        """Whether the measurement lies in the range."""
        return self.low <= measured[self.name] <= self.upper(measured)

    def upper(self, measured: Measured) -> float:
        """The highest good value."""
        return measured[self.high] if isinstance(self.high, str) else self.high


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
    """Keeps what a function measures as a stage, after its networks: `enhancer`, `noise GAN` or both.

    Raise the version when changed code measures something else; the cache then measures it again.
    """

    def keep(measure: Measure) -> Measure:
        @functools.wraps(measure)
        def measured(pipeline: Pipeline) -> Measured:
            if stage not in pipeline.measured:
                for network in networks:
                    _ = pipeline.enhancer_folder if network == "enhancer" else pipeline.gan_folder
                depends, after = (
                    pipeline.settings.of("windows", "noise", "claims"),
                    ["telemetry", *networks],
                )
                folder = pipeline.stages.run(
                    stage,
                    lambda folder: save_arrays(folder, measure(pipeline)),
                    depends,
                    after,
                    version,
                )
                pipeline.measured[stage] = {
                    name: float(value) for name, value in load_arrays(folder).items()
                }
            return pipeline.measured[stage]

        return measured

    return keep


# -- C1 ----------------------------------------------------------------------------------------------------------------


@kept("enhancement", "enhancer")
def enhancement(pipeline: Pipeline) -> Measured:
    """Errors of the enhancer and of simple baselines that learn from the same windows, on all disjoint test windows."""
    train, test = (
        pipeline.windows("train", pipeline.settings.num_windows, "training windows"),
        pipeline.windows("test"),
    )
    order, blocks = np.argsort(train["start"]), KFold(5)  # neighbours in time stay in one block
    source, target = train["coarse"][order].astype(np.float64), train["target"][order]
    ridge = GridSearchCV(
        Ridge(), {"alpha": np.logspace(-2, 5, 8)}, cv=blocks, scoring="neg_mean_squared_error"
    )
    neighbours = [number for number in (1, 3, 10, 30, 100, 300) if number <= 0.8 * len(source)]
    nearest = GridSearchCV(
        KNeighborsRegressor(),
        {"n_neighbors": neighbours},
        cv=blocks,
        scoring="neg_mean_squared_error",
    )
    known = {window.tobytes() for window in train["coarse"]}
    return {
        "nrmse": measures.nrmse(pipeline.enhance(test["coarse"]), test["truth"]),
        "train_nrmse": measures.nrmse(pipeline.enhance(train["coarse"]), train["truth"]),
        "coarse_nrmse": measures.nrmse(test["coarse"], test["truth"]),
        "ridge_nrmse": measures.nrmse(
            ridge.fit(source, target).predict(test["coarse"]), test["truth"]
        ),
        "nearest_nrmse": measures.nrmse(
            nearest.fit(source, target).predict(test["coarse"]), test["truth"]
        ),
        "share_seen": float(np.mean([window.tobytes() in known for window in test["coarse"]])),
        # errors on telemetry of one's own contain its noise
        "allowed_nrmse": 0.15
        if pipeline.is_example
        else measures.nrmse(test["coarse"], test["truth"]),
    }


# -- C2 ----------------------------------------------------------------------------------------------------------------


@kept("speed", "enhancer", "noise GAN")
def speed(pipeline: Pipeline) -> Measured:
    """Time of the coarse simulation alone and of the whole pipeline, medians of five."""
    settings, rng, seconds = pipeline.settings, pipeline.draw("speed"), {"coarse": [], "all": []}
    begins = rng.integers(0, 10**6, settings.speed_windows)
    times = pipeline.telemetry.interval * (
        begins[:, None] + np.arange(settings.window, dtype=np.float64)
    )

    def simulate() -> np.ndarray:
        return pipeline.simulator(times).astype(np.float32)

    work = {"coarse": simulate, "all": lambda: pipeline.combine(simulate(), rng)}
    pipeline.combine(simulate(), rng)  # the first call traces the networks
    for _ in range(5):
        for name, run in work.items():
            began = time.perf_counter()
            run()
            seconds[name].append(time.perf_counter() - began)
    coarse, whole = (float(np.median(each)) / settings.speed_windows for each in seconds.values())
    added = max(whole - coarse, 0.0)
    return {
        "times_real_time": settings.window * pipeline.telemetry.interval / whole,
        "added_ms": 1e3 * added,
        "ratio_to_simulator": 1 + added / BATTERY_COARSE_S,
        "gain_over_fine": BATTERY_FINE_S / (BATTERY_COARSE_S + added),
        "ratio_to_formula": whole / coarse,
    }


# -- C3 and C8 ---------------------------------------------------------------------------------------------------------


@kept("detection", "enhancer", "noise GAN")
def detection(pipeline: Pipeline) -> Measured:
    """False-alarm rate on real nominal windows and recall in degraded modes, by training data and detector."""
    if not pipeline.is_example:
        return {}
    settings, nominal = pipeline.settings, pipeline.windows("test")["target"]
    noise_sd = np.std(pipeline.noise_windows("train", settings.num_windows, "noise windows"))
    noise = pipeline.draw("noise of degraded telemetry")
    faults = [degraded_windows(pipeline, mode, pipeline.truth) for mode in MODES]
    faults = [
        windows + settings.noise_sd * noise.standard_normal(windows.shape) for windows in faults
    ]

    def training_data(purpose: str) -> dict[str, np.ndarray]:
        drawn, rng = (
            pipeline.windows("train", settings.detector_windows, purpose),
            pipeline.draw(f"noise, {purpose}"),
        )
        clean = pipeline.enhance(drawn["coarse"])
        return {
            "coarse": drawn["coarse"],
            "enhanced": clean,
            "enhanced + GAN noise": clean + pipeline.generate_noise(len(clean), rng),
            "enhanced + Gaussian noise": clean
            + noise_sd * rng.standard_normal(clean.shape, np.float32),
            "real": drawn["target"],
        }

    fitted, held_out, found = (
        training_data("detectors, fitted"),
        training_data("detectors, thresholds"),
        {},
    )
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
    if not found:
        return {}
    rates = [found[f"false alarms, enhanced, {name}"] for name in DETECTORS]
    return {"least_false_alarms": min(rates), "most_false_alarms": max(rates)}


def robust(pipeline: Pipeline) -> Measured:
    """C8: each detector trained on the enhanced signal with the GAN's noise, against the same detector trained on telemetry."""
    found, is_met = detection(pipeline), []
    if not found:
        return {}
    for name in DETECTORS:
        rate, real = (
            found[f"false alarms, {data}, {name}"] for data in ("enhanced + GAN noise", "real")
        )
        recall, real_recall = (
            found[f"recall, {data}, {name}"] for data in ("enhanced + GAN noise", "real")
        )
        is_met.append(rate <= 2 * real + 0.01 and recall >= real_recall - 0.05)
    return {"share_of_detectors": float(np.mean(is_met))} | found


# -- C4 and C5 ---------------------------------------------------------------------------------------------------------


def settling(pipeline: Pipeline) -> Measured:
    """C4: from which iteration on the generated noise is what it will be, whether that resembles the real noise or not.

    That is the first record from which the standard deviation stays within 10 % of its median over the last quarter of the record, and
    the lag-1 correlation within .05 of its own, to the end. Without such a record, it is one interval after the last.
    """
    history, settings = pipeline.history, pipeline.settings
    if settings.rounds < 2:
        return {}
    iteration, is_late = (
        history["iteration"],
        history["iteration"] > 0.75 * history["iteration"][-1],
    )
    scale, lag = np.log(np.maximum(history["sd"], 1e-12)), history["lag_one"]
    apart = np.abs(scale - np.median(scale[is_late])), np.abs(lag - np.median(lag[is_late]))
    is_bad = np.flatnonzero((apart[0] > 0.1) | (apart[1] > 0.05))
    settled = iteration[0] if not len(is_bad) else iteration[is_bad[-1]] + settings.record_every
    return {
        "settled_at": float(settled),
        "final_sd_ratio": float(np.exp(np.median(scale[is_late])) / history["real_sd"]),
        "final_lag_one": float(np.median(lag[is_late])),
    }


def balance(pipeline: Pipeline) -> Measured:
    """C5: shares of rows that the discriminator classifies correctly in the first and in the second half of training."""
    history, rows, last = pipeline.history, pipeline.settings.rows, pipeline.settings.iterations
    iteration = history["iteration"]
    is_late, is_early = (iteration > last / 2) & (iteration <= last), iteration <= last / 2
    real, generated = history["accuracy_real"], history["accuracy_generated"]
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
    z = 1.959964
    middle, width = (
        share + z**2 / (2 * number),
        z * np.sqrt(share * (1 - share) / number + z**2 / (4 * number**2)),
    )
    return float((middle - width) / (1 + z**2 / number)), float(
        (middle + width) / (1 + z**2 / number)
    )


# -- C6 and C7 ---------------------------------------------------------------------------------------------------------


def resemblance(generated: np.ndarray, real: np.ndarray, again: np.ndarray, seed: int) -> Measured:
    """How far generated windows are from as many real ones, disjoint and in the order of time.

    A classifier separates them, and also other real windows, `again`, from `real`: as they are, and louder by `LOUDER`.
    """
    lag, real_lag = (
        float(measures.autocorrelation(windows, 1)[1]) for windows in (generated, real)
    )
    auc = {
        name: two_sample_auc(windows, real, seed)
        for name, windows in (("", generated), ("floor_", again), ("louder_", LOUDER * again))
    }
    # half of what separates the real noise from white noise, from twice the 95 % interval of white noise up to .05
    lag_unit = np.clip(abs(real_lag), 8 / np.sqrt(real.size), 0.1)
    return {
        "scale_difference": measures.scale_difference(generated, real),
        "lag_one": lag,
        "real_lag_one": real_lag,
        "lag_one_error": abs(lag - real_lag) / lag_unit,
        "marginal_distance": measures.marginal_distance(generated, real),
        "rank": measures.effective_rank(generated),
        "real_rank": measures.effective_rank(real),
        "rank_ratio": measures.effective_rank(generated) / measures.effective_rank(real),
        "roughness_ratio": measures.roughness(generated) / measures.roughness(real),
        **{f"{name}auc": value for name, value in auc.items()},
        "allowed_auc": max(auc["floor_"], auc["louder_"]),
    }


@kept("noise resemblance", "noise GAN")
def noise_resemblance(pipeline: Pipeline) -> Measured:
    """C6: generated noise beside the noise of the test part."""
    real = pipeline.noise_windows("test")
    generated = pipeline.generate_noise(len(real), pipeline.draw("noise, compared"))
    return resemblance(
        generated, real, pipeline.noise_windows("train")[: len(real)], pipeline.settings.seed
    )


@kept("sum resemblance", "enhancer", "noise GAN")
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


# -- C9 ----------------------------------------------------------------------------------------------------------------


def degraded_windows(
    pipeline: Pipeline, mode: str, signal: Signal, severity: float | None = None
) -> np.ndarray:
    """Windows of a signal in a degraded mode; the true signal and the simulation get the same times and draws."""
    settings = pipeline.settings
    severity = settings.severity if severity is None else severity
    begins = pipeline.draw("degraded windows").integers(0, 10**6, settings.detector_windows)
    times = settings.interval * (begins[:, None] + np.arange(settings.window, dtype=np.float64))
    size, onset = (
        settings.orbit_amplitude + settings.rotation_amplitude,
        int(ONSET * settings.window),
    )
    draws = pipeline.draw(f"degraded {mode}")
    return degrade(
        signal, times, mode, severity, (-size, size), settings.rotation_period, draws, onset
    ).astype(np.float32)


@kept("degraded", "enhancer")
def degraded_errors(pipeline: Pipeline) -> Measured:
    """C9: errors of the enhanced signal in degraded modes that the enhancer was not trained on."""
    if not pipeline.is_example:
        return {}
    found = {}
    for mode in ("nominal", *MODES):
        coarse, truth = (
            degraded_windows(pipeline, mode, signal)
            for signal in (pipeline.simulator, pipeline.truth)
        )
        found[f"nrmse, {mode}"] = measures.nrmse(pipeline.enhance(coarse), truth)
        found[f"coarse nrmse, {mode}"] = measures.nrmse(coarse, truth)
    errors = {mode: found[f"nrmse, {mode}"] for mode in MODES}
    is_met = [
        error <= 2 * found["nrmse, nominal"] and error < found[f"coarse nrmse, {mode}"]
        for mode, error in errors.items()
    ]
    return {
        "share_of_modes": float(np.mean(is_met)),
        "worst_ratio": max(errors.values()) / found["nrmse, nominal"],
    } | found


CLAIMS = (
    Claim(
        "C1",
        "The network learns the waveform",
        "A wide, shallow network learns to map the highly quantised simulation to the smooth waveform in 40 epochs.",
        "2.2",
        "fig04_enhanced_simulation",
        (
            Limit(
                "nrmse",
                "error on held-out windows, in standard deviations of the true signal",
                high="coarse_nrmse",
            ),
            Limit(
                "nrmse",
                "error on held-out windows, in standard deviations of the true signal",
                high="allowed_nrmse",
                decides=WHOLE,
            ),
            Limit(
                "nrmse",
                "the same error, compared with that of ridge regression",
                high="ridge_nrmse",
                decides=OURS,
            ),
        ),
        enhancement,
    ),
    Claim(
        "C2",
        "Inference is fast",
        "Inference is extremely fast: high fidelity comes without substantial speed or memory penalties.",
        "2.2",
        "fig04_enhanced_simulation",
        (
            Limit("times_real_time", "seconds of telemetry generated in a second", low=10_000),
            Limit(
                "gain_over_fine",
                "times as fast as a fine simulator of a battery, timed in its study",
                low=1,
            ),
            Limit(
                "ratio_to_simulator",
                "time divided by that of a battery's coarse simulator, timed in its study",
                high=2,
                decides=WHOLE,
            ),
            Limit(
                "ratio_to_formula",
                "time divided by that of the square waves, one line of NumPy",
                high=2,
                decides=OURS,
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
                "most_false_alarms", "largest false-alarm rate of a detector set to 1 %", low=0.1
            ),
            Limit(
                "least_false_alarms",
                "smallest false-alarm rate of a detector set to 1 %",
                low=0.1,
                decides=WHOLE,
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
                "settled_at",
                "iteration from which the generated noise no longer changes",
                high=1_500,
            ),
            Limit(
                "settled_at",
                "iteration from which the generated noise no longer changes",
                low=500,
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
                "share classified correctly in the second half of training, upper end of its interval",
                low=0.5,
            ),
            Limit(
                "late_low",
                "share classified correctly in the second half of training, lower end of its interval",
                high=0.8,
            ),
            Limit(
                "late_least",
                "the same share of the kind, real or generated, with the smaller one",
                low=0.2,
            ),
            Limit(
                "early_low",
                "share in the first half, lower end of its interval",
                low=0.5,
                decides=WHOLE,
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
            Limit("scale_difference", "log ratio of the standard deviations", high=0.1),
            Limit(
                "lag_one_error",
                "error of the lag-1 correlation, in units of its distance from white noise",
                high=0.5,
            ),
            Limit(
                "marginal_distance",
                "distance of the distributions of values, in standard deviations",
                high=0.1,
            ),
            Limit(
                "rank_ratio", "effective rank divided by that of real noise", low=0.8, decides=WHOLE
            ),
            Limit(
                "auc",
                "AUC of a classifier, compared with real noise 10 % louder",
                high="allowed_auc",
                decides=WHOLE,
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
            Limit("scale_difference", "log ratio of the standard deviations", high=0.1),
            Limit(
                "marginal_distance",
                "distance of the distributions of values, in standard deviations",
                high=0.1,
            ),
            Limit(
                "roughness_ratio",
                "standard deviation of first differences divided by the real one",
                low=0.8,
                high=1.25,
            ),
            Limit(
                "auc",
                "AUC of a classifier, compared with telemetry 10 % larger",
                high="allowed_auc",
                decides=WHOLE,
            ),
        ),
        sum_resemblance,
    ),
    Claim(
        "C8",
        "Detectors trained on it are robust",
        "Detectors trained on such data are robust where those trained on clean simulation are not.",
        "title, abstract",
        "fig13_combined",
        (
            Limit(
                "share_of_detectors",
                "share of detectors as good as if trained on telemetry",
                low=0.5,
            ),
            Limit(
                "share_of_detectors",
                "share of detectors as good as if trained on telemetry",
                low=1.0,
                decides=WHOLE,
            ),
        ),
        robust,
        is_tested=False,
    ),
    Claim(
        "C9",
        "It is right in degraded modes",
        "The enhanced simulator infers realistic signals in degraded configurations that it was not trained on.",
        "1, 3",
        "fig04_enhanced_simulation",
        (
            Limit(
                "share_of_modes",
                "share of degraded modes with at most twice the nominal error",
                low=0.5,
            ),
            Limit(
                "share_of_modes",
                "share of degraded modes with at most twice the nominal error",
                low=1.0,
                decides=WHOLE,
            ),
        ),
        degraded_errors,
        is_tested=False,
    ),
)


def verdict(limits: tuple[Limit, ...], measured: Measured) -> str:
    """The verdict on a claim with these limits."""
    if not measured:
        return NOT_MEASURED
    holds = {
        kind: all(limit.holds(measured) for limit in limits if limit.decides == kind)
        for kind in (BASIC, WHOLE)
    }
    return NOT_REPRODUCED if not holds[BASIC] else REPRODUCED if holds[WHOLE] else PARTLY


def judge(claim: Claim, measured: Measured) -> dict[str, Any]:
    """One record of `results.json`: the claim, its limits beside the measurements, and the verdict."""
    limits = [
        {
            "name": limit.name,
            "words": limit.words,
            "value": measured[limit.name],
            "low": limit.low if np.isfinite(limit.low) else None,
            "high": upper if np.isfinite(upper := limit.upper(measured)) else None,
            "decides": limit.decides,
            "holds": limit.holds(measured),
        }
        for limit in claim.limits
        if measured
    ]
    found = verdict(claim.limits, measured)
    counted = [limit for limit in limits if limit["decides"] != OURS]
    failed = [
        limit
        for kind in (BASIC, WHOLE)
        for limit in counted
        if limit["decides"] == kind and not limit["holds"]
    ]
    about = {
        name: getattr(claim, name)
        for name in ("id", "short", "sentence", "section", "figure", "is_tested")
    }
    return about | {
        "verdict": found if claim.is_tested else OF_UNTESTED.get(found, found),
        "deciding": (failed or counted[-1:] or [None])[0],
        "limits": limits,
        "measured": measured,
    }


def judge_all(pipeline: Pipeline) -> list[dict[str, Any]]:
    """The records of all claims."""
    return [judge(claim, claim.measure(pipeline)) for claim in CLAIMS]


def title(records: list[dict[str, Any]]) -> str:
    """The sign of the whole reproduction, from the claims that the paper tests."""
    verdicts = [record["verdict"] for record in records if record["is_tested"]]
    if NOT_REPRODUCED in verdicts:
        return "[¬Re]"
    return "[Re]" if set(verdicts) == {REPRODUCED} else "[Re, in part]"


def outside(records: list[dict[str, Any]], published: Mapping[str, Any]) -> list[str]:
    """One line for each measurement with a limit that lies outside its published range over seeds and processors.

    Each range is widened on both sides by the claim's `margin` times its width, and by 5 % of its larger end, or by .005 if that is more.
    """
    claims, lines = {claim.id: claim for claim in CLAIMS}, []
    for record in records:
        claim, ranges = claims[record["id"]], published["claims"][record["id"]]["ranges"]
        for name in dict.fromkeys(limit.name for limit in claim.limits):
            low, high = ranges[name]
            margin = claim.margin * (high - low) + max(0.05 * max(abs(low), abs(high)), 0.005)
            value = record["measured"].get(name)
            if value is None or not low - margin <= value <= high + margin:
                lines.append(f"{record['id']}: {name} is {value}, published {low:g} to {high:g}")
    return lines
