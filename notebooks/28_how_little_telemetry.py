# %% [markdown]
# # How little telemetry is enough?
#
# **Question:** from how many real windows on is a simulator no longer needed?
#
# - **After this lesson** you can set a threshold when the real windows must serve for training *and* for the threshold, fit a simulator
#   to the same few windows, and read a learning curve with a rule that was fixed before the experiment.
# - **You should know** ridge regression by blocks of time (notebook 04), the PCA residual and the conformal threshold (notebook 13), and
#   residual windows (notebook 25).
# - **Terms:** [conformal threshold](../docs/glossary.md#conformal-threshold), [residual](../docs/glossary.md#residual); a *learning
#   curve* is a result over the amount of data; *excess*: the false-alarm rate minus the one that the threshold was set for; *recall at the
#   real rate*: the share of anomalies found when the threshold is set on further real windows.
#
# **What the paper says** (section 1): often the data to train on "does not exist in sufficient quantity, and would be expensive to
# produce", and simulations supply it. But the enhancer and its noise are fitted to real telemetry, too. Is it not simpler to train the
# detector on that?

# %%
import itertools

import numpy as np
import pandas as pd
from lesson_tools import check_answer, drawing, open_pipeline, open_study
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from enhsim_tf.common.plot_style import AVERAGE, DASHED, QUIET, REAL
from enhsim_tf.detection import metrics
from enhsim_tf.detection.anomalies import INJECTIONS, inject
from enhsim_tf.detection.detectors import PCAResidual
from enhsim_tf.enhancer.ridge import fit_ridge, time_blocks

pipeline, budget = open_pipeline()
is_full = budget == "full"

# %% [markdown]
# ## The data
#
# The waves are those of the paper's example, but neighbouring samples of the noise are correlated. Known are the square waves and one
# contiguous *record* of $k$ windows of 500 samples, from which both methods cut 200 windows. With $k=5$, neighbours share 98 % of their
# samples, so their scores are not independent. Of the later nominal windows, half count false alarms, and half set the threshold for the
# recall at the real rate. Windows with injected anomalies of the package's [kinds](../docs/inject.md#kinds) count what is found. One draw
# says little about five windows, so all results are means over draws.

# %%
window, NUM_REAL, num_judged, seeds = (
    (500, (5, 20, 100), 400, range(10)) if is_full else (500, (5, 20), 100, range(2))
)
border = max(NUM_REAL) * window  # the records end here


def cut(values, starts):
    return np.stack([values[start : start + window] for start in starts])


def draw_telemetry(seed):
    """The coarse run, the telemetry, and later windows: nominal, for the threshold of the recall, and anomalous."""
    rng, time = np.random.default_rng(seed), np.arange(border + (2 * num_judged + 1) * window, dtype=float)
    noise = 0.1 * lfilter([np.sqrt(1 - 0.7**2)], [1, -0.7], rng.standard_normal(len(time)))
    telemetry = pipeline.truth(time).ravel() + noise
    nominal, for_threshold = np.split(cut(telemetry, border + window * np.arange(1, 2 * num_judged + 1)), 2)
    anomalous = [
        inject(nominal[first :: len(INJECTIONS)], kind, severity=4.0, duration=100, noise_sd=0.1, rng=rng)[0]
        for first, kind in enumerate(INJECTIONS)
    ]
    return pipeline.simulator(time).ravel(), telemetry, (nominal, for_threshold, np.concatenate(anomalous))


draws = {seed: draw_telemetry(seed) for seed in seeds}


def record_of(seed, k):
    """Starts of overlapping windows of a record of k windows, and the coarse and the real windows."""
    starts = np.linspace(border - k * window, border - window, 200).astype(int)
    return starts, *(cut(values, starts) for values in draws[seed][:2])


# %% [markdown]
# ## Real windows alone
#
# Train the PCA residual on the windows of the record. Where should the threshold come from? No further real windows exist, and the
# detector may have learnt the noise of its training windows. *Cross-fitting* helps: cut the time into five blocks, train on four of them,
# without the windows that reach into the fifth, and score the fifth; and so on.


# %%
def folds_of_time(starts, num_blocks=5):
    order, folds = np.argsort(starts, kind="stable"), []
    for held_out in np.array_split(order, num_blocks):
        rest = np.setdiff1d(order, held_out, assume_unique=True)  # keeps the order of time
        first, last = starts[held_out].min(), starts[held_out].max()
        apart = rest[(starts[rest] <= first - window) | (starts[rest] >= last + window)]
        folds.append((apart, held_out))
    return folds


def cross_fitted_scores(starts, windows):
    scores = np.empty(len(starts))
    for training, held_out in folds_of_time(starts):
        scores[held_out] = PCAResidual().fit(windows[training]).score(windows[held_out])
    return scores


starts, _, _ = record_of(0, 20)
for mine, ours in zip(folds_of_time(starts), time_blocks(starts, 5, window)):
    np.testing.assert_array_equal(np.concatenate(mine), np.concatenate(ours))


# %%
def alarms_of(seed, detector, threshold_scores):
    """False alarms on later nominal windows, with the conformal threshold of 1 % from the given scores."""
    limit = metrics.finite_threshold(threshold_scores, 0.01)[0]
    nominal, _, _ = draws[seed][2]
    return np.mean(detector.score(nominal) > limit)


real, alarms = {}, {}
for seed, k in itertools.product(seeds, NUM_REAL):
    starts, _, windows = record_of(seed, k)
    real[seed, k] = PCAResidual().fit(windows)
    alarms[seed, k] = {
        "threshold from the training windows": alarms_of(seed, real[seed, k], real[seed, k].score(windows)),
        "threshold by cross-fitting": alarms_of(seed, real[seed, k], cross_fitted_scores(starts, windows)),
    }
rates = pd.DataFrame(alarms).T.groupby(level=1).mean()  # over the draws
print("Share of false alarms, set for 0.01:")
print(rates.rename_axis("k").round(4).to_string())
if is_full:
    assert (rates["threshold from the training windows"] > 5 * rates["threshold by cross-fitting"]).all()
    assert rates["threshold by cross-fitting"].iloc[0] > 0.01

# %% [markdown]
# The threshold from the training windows is useless. Probably, the twenty components describe a part of the noise of these very windows,
# and of no others. Cross-fitting comes much nearer to the 1 % that was asked for, but with five windows it is still above it, and with
# twenty probably.
#
# ## A simulator that is fitted to the same windows
#
# The simulator uses the same record: ridge regression from square waves to the record, and noise fitted to its residuals. These must be
# cross-fitted for the same reason as the scores. The noise is a Gaussian *autoregression*: each sample is a weighted sum of the samples
# before it, plus a random number (notebook 25). It has few parameters, here ten weights and a variance. Once fitted, it generates as many
# windows as wanted: some to train the detector on, and others to set its threshold.


# %%
def cross_fitted_residuals(starts, inputs, windows):
    noise = np.empty_like(windows)
    for training, held_out in folds_of_time(starts):
        enhancer = fit_ridge(inputs[training], windows[training], starts[training])
        noise[held_out] = windows[held_out] - enhancer.predict(inputs[held_out])
    return noise


def fit_simulator(starts, inputs, windows, order=10):
    """A function that generates windows: enhanced windows of other times, and noise of an autoregression."""
    enhancer = fit_ridge(inputs, windows, starts)
    noise = cross_fitted_residuals(starts, inputs, windows)
    # autocovariance r; the best weights for the samples before leave an error that is uncorrelated with each of these: the equations of
    # Yule and Walker, toeplitz(r[:order]) @ weights = r[1:]
    r = np.array([np.mean(noise[:, : window - lag] * noise[:, lag:]) for lag in range(order + 1)])
    weights = np.linalg.solve(toeplitz(r[:order]), r[1:])
    sd = np.sqrt(r[0] - weights @ r[1:])  # of that error

    def generate(number, rng):
        times = rng.integers(0, 1_000_000, number)[:, None] + np.arange(window, dtype=float)
        steps = sd * rng.standard_normal((number, window + 200))
        noise = lfilter([1.0], [1.0, *-weights], steps, axis=1)[:, 200:]  # without its start from zero
        return enhancer.predict(pipeline.simulator(times)) + noise

    return generate


# %%
def recall_of(seed, detector):
    """Recall at the real rate: the threshold comes from further real windows."""
    _, for_threshold, anomalous = draws[seed][2]
    return np.mean(
        detector.score(anomalous) > metrics.finite_threshold(detector.score(for_threshold), 0.01)[0]
    )


number, results = 400 if is_full else 100, {}
for seed, k in itertools.product(seeds, NUM_REAL):
    generate = fit_simulator(*record_of(seed, k))
    simulated = PCAResidual().fit(generate(number, np.random.default_rng(1)))
    further = simulated.score(generate(number, np.random.default_rng(2)))
    results[seed, k] = {
        ("false alarms", "real windows alone"): alarms[seed, k]["threshold by cross-fitting"],
        ("false alarms", "simulator fitted to them"): alarms_of(seed, simulated, further),
        ("recall", "real windows alone"): recall_of(seed, real[seed, k]),
        ("recall", "simulator fitted to them"): recall_of(seed, simulated),
    }
table = pd.DataFrame(results).T.groupby(level=1).mean()  # over the draws

# %%
alt = "False alarms and recall of both arms over the number of real windows"
first = table["false alarms"].iloc[0]
alone, fitted = (f"{100 * rate:.1f} %" for rate in first)
title = f"Set for 1 %, {NUM_REAL[0]} windows alone give {alone}, a simulator {fitted}"
looks = {"style": ["o-", "^--"], "color": [REAL, AVERAGE], "logx": True, "xticks": NUM_REAL}
looks |= {"markersize": 4, "clip_on": False}
with drawing(alt, 2, 2.4, title) as (left, right):
    (100 * table["false alarms"]).plot(ax=left, ylabel="false alarms (%), set for 1 %", legend=False, **looks)
    left.axhline(1, color=QUIET, linewidth=0.6, linestyle=DASHED)
    (100 * table["recall"]).plot(ax=right, ylabel="recall at the real rate (%)", ylim=(0, 103), **looks)
    for panel in (left, right):
        panel.set(xlabel="number of real windows k", xticklabels=NUM_REAL)
        panel.minorticks_off()
    right.legend(frameon=False, loc="lower right")

# %% [markdown]
# *What to see:* with the simulator there are hardly any false alarms: its thresholds are rather too high. On the right, it finds somewhat
# fewer anomalies, and the difference is largest with five windows. Whether such an exchange *pays* needs a rule.

# %%
print(table.rename_axis("k").round(4).to_string())
lost = table["recall", "real windows alone"] - table["recall", "simulator fitted to them"]
if is_full:
    assert (
        table["false alarms", "simulator fitted to them"] < table["false alarms", "real windows alone"]
    ).all()
    assert lost.min() > 0 and lost.idxmax() == NUM_REAL[0]

# %% [markdown]
# ## The published curve
#
# The [study](../studies/few_windows/README.md) has ten seeds, four detectors, more methods, and four kinds of noise: white,
# autoregressive (neighbours are correlated), heteroscedastic (its loudness changes slowly) and shot (rare pulses). The lesson above
# has one detector and one kind of noise. The study's rule was fixed before its first run:
#
# - A simulator *pays* where the excess of the real windows is more than half a point, its own is at most half of that, and its recall at
#   the real rate is at most 3 points lower.
# - Real windows *suffice* from a number on if their excess is at most half a point there and at all larger numbers.


# %%
def pays(real_alarms, own_alarms, recall_loss):
    real_excess, own_excess = real_alarms - 0.01, own_alarms - 0.01
    return real_excess > 0.005 and own_excess <= 0.5 * real_excess and recall_loss <= 0.03


recalls = pd.DataFrame(results).T["recall"]
each_lost = recalls["real windows alone"] - recalls["simulator fitted to them"]
real_alarms = pd.DataFrame(results).T["false alarms", "real windows alone"]
of_loss, of_excess = (
    100 * values.groupby(level=1).std() / np.sqrt(len(seeds)) for values in (each_lost, real_alarms)
)
print("± is the standard error over the draws.")
for k in NUM_REAL:
    answer = "pays" if pays(*table.loc[k, "false alarms"], lost[k]) else "does not pay"
    excess = 100 * (table.loc[k, ("false alarms", "real windows alone")] - 0.01)
    print(
        f"k = {k}: excess of the real windows {excess:.2f} ± {of_excess[k]:.2f} points; "
        f"recall lower by {100 * lost[k]:.1f} ± {of_loss[k]:.1f} points; the simulator {answer}"
    )

# %%
found, _ = open_study("few_windows")
numbers, environments = found["numbers"], found["environments"]
shown = {
    "real": "real windows alone",
    "simulator + gaussian": "simulator, Gaussian noise",
    "simulator + autoregression": "simulator, autoregression",
}
title = "Simulators keep their threshold only where their noise model fits"
alt = "Excess of false alarms over the number of real windows on four kinds of noise, for real windows and two simulators"
with drawing(alt, len(environments), 2.6, title, sharex=True, sharey=True) as panels:
    for panel, (environment, about) in zip(panels, environments.items()):
        excess = {label: about["arms"][arm]["excess"].values() for arm, label in shown.items()}
        points = 100 * pd.DataFrame(excess, index=numbers)
        looks = {"color": [REAL, QUIET, AVERAGE], "fillstyle": "none", "markersize": 4, "clip_on": False}
        points.plot(ax=panel, style=["o", "s", "^"], legend=False, **looks)
        panel.axhline(0.5, color=QUIET, linewidth=0.6, linestyle=DASHED)
        panel.set_xscale("log")
        panel.set_xticks([5, 50, 1_000], ["5", "50", "1,000"])
        panel.set_yscale("symlog", linthresh=1)
        panel.set(title=environment, xlabel="real windows k", ylabel="excess (points; linear below 1)")
        panel.minorticks_off()
    panels[0].set_yticks([0, 1, 10, 50], ["0", "1", "10", "50"])
    panels[-1].legend(frameon=False, loc="upper left", bbox_to_anchor=(1, 1))

# %% [markdown]
# *What to see:* where the noise model describes the noise, the simulator stays within half a point (dashed) from five windows on, and the
# real windows from 50 on. Where it does not, with these two noise models no number of windows brings it down. With autoregressive noise,
# the simulator pays in the study, whose numbers are means over four detectors. It did not for the one detector above: with 5 and 20 windows
# it lost more recall than the rule allows (with 20, by less than the standard error), and with 100 the real windows suffice.

# %%
print("numbers of windows in the study:", numbers)
for environment, about in environments.items():
    paid = sorted(set(sum(about["pays"].values(), [])))
    enough = about["real_suffices_from"]
    told = f"{paid[0]} to {paid[-1]}" if paid else "none"
    print(f"{environment:16} a simulator pays at {told:8} real windows suffice from {enough:,}")
    assert all(number < enough for number in paid)
paying = [environment for environment, about in environments.items() if any(about["pays"].values())]
assert paying == ["white", "autoregressive"]

# %% [markdown]
# **Answer.** For the detector trained here, real windows suffice with 100, and probably not with 5; ten draws do not decide about 20. By
# the rule, the simulator pays with none of these numbers (with 20, it misses by less than the standard error). In the study, it depends on
# the noise: real windows suffice from 50 on where it is white or autoregressive, from 100 on with shot noise, and from 1,000 on where it is
# heteroscedastic. With 5 to 20 windows, a simulator paid on white and on autoregressive noise. On the other two kinds, none of these
# simulators paid with any number. (A gap in the rule: a threshold that is far too high passes as well.)
#
# ## Exercises
#
# **1.** A threshold from $n$ independent scores is finite for a false-alarm rate of 1 % only if $n$ is large enough. What is the smallest
# $n$? (Notebook 13: the threshold is the score of rank $\lceil(n+1)(1-0.01)\rceil$.)

# %%
smallest = None  # your answer

# %%
check_answer(
    smallest,
    lambda n: (
        np.isfinite(metrics.threshold(np.arange(n), 0.01))
        and not np.isfinite(metrics.threshold(np.arange(n - 1), 0.01))
    ),
    "The rank must not be larger than n.",
)

# %% [markdown]
# **2.** How does the number that *suffices* change with the tolerance of half a point? Complete the function: the smallest number of real
# windows from which on the excess of the [arm](../docs/glossary.md#arm) `real` stays at most `limit`, or `None`.


# %%
def suffices_from(environment, limit):
    excess = found["environments"][environment]["arms"]["real"]["excess"]  # by the number, as text
    # your code
    return ...


# %%
from notebooks import answers_tool

cases = [(environment, limit) for environment in environments for limit in (0.002, 0.005, 0.01, 0.03)]
answers = [suffices_from(*case) for case in cases]
check_answer(
    None if ... in answers else answers,
    lambda given: given == [answers_tool.suffices_from(found, *case) for case in cases],
    "Every later number must keep the limit, too, not only the first one that does.",
)

# %% [markdown]
# ## Solution
#
# <details><summary>1. The smallest number of scores</summary>
#
# ```python
# smallest = next(n for n in range(1, 1_000) if np.ceil((n + 1) * 0.99 - 1e-9) <= n)
# print(smallest)
# ```
#
# It is 99. With fewer, even the largest score stands for a rate of $1/(n+1)$, above 1 %. Overlapping windows do not help: a hundred
# scores from five disjoint windows are not independent.
#
# </details>

# %% [markdown]
# <details><summary>2. The tolerance</summary>
#
# ```python
# def suffices_from(environment, limit):
#     excess, smallest = found["environments"][environment]["arms"]["real"]["excess"], None
#     for number in reversed(found["numbers"]):
#         if excess[str(number)] > limit:
#             break
#         smallest = number
#     return smallest
#
#
# for environment, limit in cases:
#     print(f"{environment}, excess at most {limit:.1%}: from {suffices_from(environment, limit)}")
# ```
#
# Where the answer jumps with a small change of the tolerance, a value lies close to the tolerance: on heteroscedastic noise, 300 windows
# miss the half point by very little.
#
# </details>
