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
#   curve* is a result over the amount of data; *excess*: the false-alarm rate minus the one that the threshold was set for;
#   *cross-fitting*: each window is scored by a model that was fitted to the other blocks of time; *recall at the real rate*: the share of
#   anomalies found when the threshold is set on further real windows.
#
# **What the paper says** (section 1): often the data to train on "does not exist in sufficient quantity, and would be expensive to
# produce", and simulations supply it. But the enhancer and its noise are fitted to real telemetry, too. Is it not simpler to train the
# detector on that?

# %%
import numpy as np
from lesson_tools import check_answer, drawing, open_pipeline, open_study, say, slider

from enhsim_tf.common.plot_style import AVERAGE, DASHED, QUIET, REAL
from enhsim_tf.detection import metrics
from enhsim_tf.detection.detectors import PCAResidual
from enhsim_tf.enhancer import ridge as packaged
from studies.common.metrics import recall_at_real_rate
from studies.common.settings import make_settings
from studies.few_windows.cells import World

budget = open_pipeline()[1]  # nothing else of the paper's example is used here
is_full = budget == "full"

# %% [markdown]
# ## The data
#
# The waves are those of the paper's example, but neighbouring samples of the noise are correlated. Known are the square waves and one
# contiguous *record* of $k$ windows of 500 samples, from which both methods may cut overlapping windows. Of the later nominal windows,
# half count false alarms, and half set the threshold for the recall at the real rate. Windows with injected anomalies count what is
# found.

# %%
NUM_REAL = (5, 20, 100) if is_full else (5, 20)
small = {"num_real": NUM_REAL, "num_windows": 200, "num_judged": 400, "num_anomalous": 24}
if not is_full:
    small |= {"num_windows": 60, "num_judged": 60, "num_anomalous": 6}
small = {f"few_windows__{name}": value for name, value in small.items()}
# 100 is not one of the seeds of the published curve
world = World(make_settings(budget, **small).of("autoregressive", 100))
records = {k: world.record(k) for k in NUM_REAL}
judged = world.judged
for k, record in records.items():
    print(
        f"k = {k:3}: {len(record.telemetry):6,} samples, {len(record.windows)} overlapping windows, {k} disjoint ones"
    )

# %% [markdown]
# ## Real windows alone
#
# Train the PCA residual on the windows of the record. Where should the threshold come from? No further real windows exist, and the
# detector has learnt the noise of its training windows. *Cross-fitting* helps: cut the time into five blocks, train on four of them,
# without the windows that reach into the fifth, and score the fifth; and so on.


# %%
def folds_of_time(starts, num_blocks=5, window=500):
    order, folds = np.argsort(starts, kind="stable"), []
    for held_out in np.array_split(order, num_blocks):
        rest = np.setdiff1d(order, held_out, assume_unique=True)  # keeps the order of time
        first, last = starts[held_out].min(), starts[held_out].max()
        apart = rest[(starts[rest] <= first - window) | (starts[rest] >= last + window)]
        folds.append((apart, held_out))
    return folds


def cross_fitted_scores(record):
    scores = np.empty(len(record.windows))
    for training, held_out in folds_of_time(record.starts):
        detector = PCAResidual().fit(record.windows[training])
        scores[held_out] = detector.score(record.windows[held_out])
    return scores


for k in NUM_REAL[1:]:
    expected = packaged.time_blocks(records[k].starts, 5, 500)
    for mine, ours in zip(folds_of_time(records[k].starts), expected):
        np.testing.assert_array_equal(mine[0], ours[0])
        np.testing.assert_array_equal(mine[1], ours[1])

# %%
real, naive, fitted = {}, {}, {}
for k, record in records.items():
    real[k] = PCAResidual().fit(record.windows)
    naive[k], fitted[k] = real[k].score(record.windows), cross_fitted_scores(record)


def alarms_of(detector, threshold_scores):
    """False alarms on later nominal windows, with the conformal threshold of 1 % from the given scores."""
    limit = metrics.finite_threshold(threshold_scores, 0.01)[0]
    return np.mean(detector.score(judged["nominal"]) > limit)


rates = {
    "threshold from the training windows": [alarms_of(real[k], naive[k]) for k in NUM_REAL],
    "threshold by cross-fitting": [alarms_of(real[k], fitted[k]) for k in NUM_REAL],
}
title = (
    f"With {NUM_REAL[0]} windows, cross-fitting lowers false alarms from {rates['threshold from the training windows'][0]:.0%} to "
    f"{rates['threshold by cross-fitting'][0]:.1%}"
)
alt = "False alarms over the number of real windows, for two ways to set the threshold on the same windows"
with drawing(alt, height=2.1, title=title) as panel:
    for (name, values), (color, style, marker) in zip(
        rates.items(), ((QUIET, DASHED, "s"), (REAL, "-", "o"))
    ):
        panel.plot(
            NUM_REAL,
            [100 * value for value in values],
            color=color,
            linestyle=style,
            marker=marker,
            markersize=4,
            label=name,
        )
    panel.axhline(1, color=QUIET, linewidth=0.6)
    panel.set(xlabel="number of real windows k", ylabel="false alarms (%)", xscale="log", ylim=(0, None))
    panel.set_xticks(NUM_REAL, list(map(str, NUM_REAL)))
    panel.minorticks_off()
    panel.legend(frameon=False)

# %% [markdown]
# *What to see:* the threshold from the training windows is useless. The twenty components describe a part of the noise of these very
# windows, and of no others. Cross-fitting comes much nearer to the 1 % that was asked for, but with five windows it is still above it.

# %%
for name, values in rates.items():
    print(f"{name:38}" + "".join(f"   k = {k}: {value:6.1%}" for k, value in zip(NUM_REAL, values)))
assert rates["threshold from the training windows"][0] > rates["threshold by cross-fitting"][0]

# %% [markdown]
# ## A simulator that is fitted to the same windows
#
# The simulator uses the same record: ridge regression from square waves to the record, and noise fitted to its residuals. These must be
# cross-fitted for the same reason as the scores. The noise is a Gaussian *autoregression*: each sample is a weighted sum of the samples
# before it, plus a random number (notebook 25). It has few parameters. Once fitted, it generates as many windows as wanted: some to train
# the detector on, and others to set its threshold.


# %%
def cross_fitted_residuals(record):
    seconds = record.telemetry.offset_s + record.telemetry.interval_s * (
        record.starts[:, None] + np.arange(500)
    )
    coarse, noise = record.coarse.simulate(seconds), np.empty_like(record.windows)
    for training, held_out in folds_of_time(record.starts):
        enhancer = packaged.fit_ridge(coarse[training], record.windows[training], record.starts[training])
        noise[held_out] = record.windows[held_out] - enhancer.predict(coarse[held_out])
    return noise


middle = NUM_REAL[1]
np.testing.assert_allclose(cross_fitted_residuals(records[middle]), records[middle].residuals[0], atol=1e-5)

# %%
generated = 400 if is_full else 60
simulated, further = {}, {}
for k, record in records.items():
    simulated[k] = PCAResidual().fit(record.generate("autoregression", generated, 1))
    further[k] = simulated[k].score(record.generate("autoregression", generated, 2))
arms = {
    "real windows alone": [(real[k], fitted[k]) for k in NUM_REAL],
    "simulator fitted to them": [(simulated[k], further[k]) for k in NUM_REAL],
}
alarms = {name: np.array([alarms_of(*each) for each in pairs]) for name, pairs in arms.items()}
recall = {
    name: np.array(
        [
            recall_at_real_rate(detector.score(judged["reference"]), detector.score(judged["anomalous"]))
            for detector, _ in pairs
        ]
    )
    for name, pairs in arms.items()
}

# %%
alt = "False alarms and recall of both arms over the number of real windows"
title = (
    f"With {NUM_REAL[0]} windows, false alarms are {alarms['real windows alone'][0]:.1%} alone, "
    f"{alarms['simulator fitted to them'][0]:.1%} with the simulator"
)
with drawing(alt, 2, 2.4, title) as (left, right):
    for name, (color, style, marker) in zip(arms, ((REAL, "-", "o"), (AVERAGE, DASHED, "^"))):
        look = {"color": color, "linestyle": style, "marker": marker, "markersize": 4, "label": name}
        left.plot(NUM_REAL, 100 * alarms[name], **look)
        right.plot(NUM_REAL, 100 * recall[name], **look)
    left.axhline(1, color=QUIET, linewidth=0.6)
    left.set(ylabel="false alarms (%), set for 1 %", ylim=(0, None))
    right.set(ylabel="recall at the real rate (%)", ylim=(0, 100))
    right.legend(frameon=False, loc="lower right")
    for panel in (left, right):
        panel.set(xlabel="number of real windows k", xscale="log")
        panel.set_xticks(NUM_REAL, list(map(str, NUM_REAL)))
        panel.minorticks_off()

# %% [markdown]
# *What to see:* with five windows, the simulator gives fewer false alarms; with more, neither exceeds 1 %. On the right, it finds
# somewhat fewer anomalies in this run. Whether such an exchange *pays* needs a rule.

# %%
for position, k in enumerate(NUM_REAL):
    print(
        f"k = {k:3}   "
        + "   ".join(
            f"{name}: {alarms[name][position]:5.1%} false alarms, {recall[name][position]:4.0%} recall"
            for name in arms
        )
    )
if is_full:
    assert alarms["simulator fitted to them"][0] < alarms["real windows alone"][0]
    assert np.all(recall["simulator fitted to them"] < recall["real windows alone"] + 0.03)

# %% [markdown]
# This is one seed, one detector and one kind of noise. The slider shows the scores.


# %%
def draw(k):
    alt = f"Scores of later nominal windows and the thresholds of both arms for {k} real windows"
    shares = [alarms[name][NUM_REAL.index(k)] for name in arms]
    title = (
        f"k = {k}: {shares[0]:.1%} exceed the threshold from real windows, {shares[1]:.1%} the simulator's"
    )
    with drawing(alt, 2, 2.0, title, sharex=True, sharey=True) as panels:
        for panel, (name, pairs), color in zip(panels, arms.items(), (REAL, AVERAGE)):
            detector, own = pairs[NUM_REAL.index(k)]
            panel.hist(
                1e3 * detector.score(judged["nominal"]),
                30,
                color=QUIET,
                alpha=0.5,
                label="later nominal windows",
            )
            panel.margins(x=0.1, y=0.5)
            panel.axvline(
                1e3 * metrics.finite_threshold(own, 0.01)[0], color=color, linestyle=DASHED, label="threshold"
            )
            panel.set_title(name, loc="left")
            panel.set(xlabel="score (mean squared residual × 1,000)", ylabel="windows")
            panel.legend(frameon=False, fontsize=7, loc="upper left")


slider(draw, "number of real windows", NUM_REAL, shown=NUM_REAL[:2])

# %% [markdown]
# ## The published curve
#
# The [study](../studies/few_windows/README.md) has ten seeds, four detectors, more methods, and four kinds of noise: white,
# autoregressive (neighbours are correlated), heteroscedastic (its loudness changes slowly) and shot (rare pulses). Its rule was fixed
# before the first run:
#
# - A simulator *pays* where the excess of the real windows is more than half a point, its own is at most half of that, and its recall at
#   the real rate is at most 3 points lower.
# - Real windows *suffice* from a number on if their excess is at most half a point there and at all larger numbers.

# %%
from studies.few_windows.summary import MAX_RECALL_LOSS, PAYS_SHARE, RATE, SUFFICES

excess = {name: values - RATE for name, values in alarms.items()}
pays_here = [
    k
    for position, k in enumerate(NUM_REAL)
    if excess["real windows alone"][position] > SUFFICES
    and max(excess["simulator fitted to them"][position], 0)
    <= PAYS_SHARE * excess["real windows alone"][position]
    and recall["real windows alone"][position] - recall["simulator fitted to them"][position]
    <= MAX_RECALL_LOSS
]
say(
    f"By this rule, the simulator of the live example pays at: **{', '.join(map(str, pays_here)) or 'none of its numbers'}**. "
    f"Its recall is lower than that of real windows alone by "
    + ", ".join(
        f"**{100 * loss:.1f} points** at {k}"
        for k, loss in zip(NUM_REAL, recall["real windows alone"] - recall["simulator fitted to them"])
    )
    + "."
)

# %%
found, _ = open_study("few_windows")
numbers, environments = found["numbers"], found["environments"]
shown = {
    "real": ("real windows alone", REAL, "o"),
    "simulator + gaussian": ("simulator, Gaussian noise", QUIET, "s"),
    "simulator + autoregression": ("simulator, autoregression", AVERAGE, "^"),
}
paying = [environment for environment, about in environments.items() if any(about["pays"].values())]
title = f"A simulator pays on {' and '.join(paying)} noise, with few windows"
alt = "Excess of false alarms over the number of real windows on four kinds of noise, for real windows and two simulators"
with drawing(alt, len(environments), 2.6, title, sharex=True, sharey=True) as panels:
    for panel, (environment, about) in zip(panels, environments.items()):
        for arm, (label, color, marker) in shown.items():
            excess = [100 * about["arms"][arm]["excess"][str(number)] for number in numbers]
            panel.plot(numbers, excess, marker, color=color, markersize=4, label=label)
        panel.axhline(100 * SUFFICES, color=QUIET, linewidth=0.6, linestyle=DASHED)
        panel.set_xscale("log")
        panel.set_yscale("symlog", linthresh=1)
        panel.set_title(environment, loc="left")
        panel.set_xticks([10, 100, 1_000, 10_000], ["10", "100", "1,000", ""])
        panel.minorticks_off()
        panel.set_xlabel("real windows k")
    panels[0].set_yticks([0, 1, 10, 50], ["0", "1", "10", "50"])
    panels[0].set_ylabel("excess (points)")
    panels[-1].legend(frameon=False, fontsize=7, loc="upper left", bbox_to_anchor=(1, 1))

# %% [markdown]
# *What to see:* where the noise model describes the noise, the simulator stays within half a point (dashed) from five windows on, and the
# real windows from 50 on. Where it does not, no number of windows brings it down. With autoregressive noise, the simulator pays in the
# study's means, and did not for the one seed above.

# %%
for environment, about in environments.items():
    pays = sorted(set(sum(about["pays"].values(), [])))
    enough = about["real_suffices_from"]
    told = f"{pays[0]} to {pays[-1]}" if pays else "none"
    print(f"{environment:16} a simulator pays at {told:8} real windows suffice from {enough:,}")
    assert all(number < enough for number in pays)
assert paying == ["white", "autoregressive"]

# %% [markdown]
# **Answer.** It depends on the noise: from 50 windows on where it is white or autoregressive, from 100 on with shot noise, and from 1,000
# on where it is heteroscedastic. Below that, a simulator paid with 5 to 20 windows, and only with a noise model that describes the noise.
# (A gap in the rule: a threshold that is far too high passes as well.)

# %% [markdown]
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
# windows from which on the excess of the arm `real` stays at most `limit`, or `None`.


# %%
def suffices_from(environment, limit):
    excess = found["environments"][environment]["arms"]["real"]["excess"]  # by the number, as text
    # your code
    return ...


# %%
cases = [(environment, limit) for environment in environments for limit in (0.002, 0.005, 0.01, 0.03)]
answers = [suffices_from(*case) for case in cases]


def is_smallest(answer, environment, limit):
    """Whether every number from the answer on keeps the limit, and the number before it does not."""
    excess = environments[environment]["arms"]["real"]["excess"]
    place = len(numbers) if answer is None else numbers.index(answer)
    before = numbers[place - 1] if place else None
    kept = [excess[str(number)] <= limit for number in numbers[place:]]
    return all(kept) and (before is None or excess[str(before)] > limit)


check_answer(
    None if ... in answers else answers,
    lambda given: all(is_smallest(answer, *case) for answer, case in zip(given, cases)),
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
# Where the answer jumps with a small change of the tolerance, the curve is flat or noisy there.
#
# </details>
