# %% [markdown]
# # Strong baselines: when does a network pay?
#
# **Question:** when is a network better than what needs no network?
#
# - **After this lesson** you can compare an enhancer fairly with strong baselines, avoid two traps of such comparisons (an untuned penalty,
#   a random split of overlapping windows), and say what a network must find to be worth its training.
# - **You should know** ridge regression with cross-validation over blocks of time (notebook 04), the PCA residual and the conformal
#   threshold (notebook 13).
# - **Terms:** [NRMSE](../docs/glossary.md#nrmse), [ridge regression](../docs/glossary.md#ridge-regression),
#   [nearest windows](../docs/glossary.md#nearest-windows), [residual](../docs/glossary.md#residual); a *baseline* is a simple method that a
#   complicated one must beat; a *block of time* is a contiguous stretch of telemetry.
#
# **What the paper says** (section 2.2): "Wider networks are better at matching functions of this type." It tries no other method than the
# network.

# %%
import numpy as np
from lesson_tools import check_answer, drawing, open_pipeline, open_study, say, slider

from enhsim_tf.common.plot_style import COARSE, DASHED, ENHANCED, QUIET, REAL
from enhsim_tf.enhancer import ridge as packaged

pipeline, budget = open_pipeline()
is_full = budget == "full"

# %% [markdown]
# ## Baselines on the paper's example
#
# Ridge regression is one matrix, and was written out in notebook 04; here it comes from the package, with its penalty chosen by blocks of
# time. The other baseline learns nothing at all. It looks up the $k$ training windows whose coarse windows are *nearest* to the new one,
# and returns the mean of their telemetry:


# %%
def nearest_mean(train_inputs, train_targets, inputs, k):
    squared = (
        np.sum(inputs**2, axis=1)[:, None] - 2 * inputs @ train_inputs.T + np.sum(train_inputs**2, axis=1)
    )
    nearest = np.argsort(squared, axis=1, kind="stable")[:, :k]
    return train_targets[nearest].mean(axis=1)


def nrmse(estimate, truth):
    return np.sqrt(np.mean((estimate.astype(float) - truth) ** 2)) / truth.std(dtype=float)


small = np.random.default_rng(0).normal(size=(3, 60, 20))
np.testing.assert_allclose(nearest_mean(*small, 5), packaged.nearest_windows(*small, 5), atol=1e-5)

# %%
train = pipeline.windows("train", pipeline.settings.num_windows, "training windows")
test = pipeline.windows("test", None)
ridge = packaged.fit_ridge(train["coarse"], train["target"], train["start"])
k = packaged.choose_num_neighbours(train["coarse"], train["target"], train["start"])
estimates = {
    "coarse simulator": test["coarse"],
    "network of the paper": pipeline.enhance(test["coarse"]),
    "mean of the nearest windows": nearest_mean(train["coarse"], train["target"], test["coarse"], k),
    "ridge regression": ridge.predict(test["coarse"]),
}
errors = {name: nrmse(estimate, test["truth"]) for name, estimate in estimates.items()}
say(
    f"NRMSE on held-out windows, with k = {k} neighbours and a penalty of {ridge.penalty:,.0f}: "
    + ", ".join(f"{name} **{error:.3f}**" for name, error in errors.items())
    + "."
)
if is_full:
    assert (
        errors["ridge regression"]
        < errors["mean of the nearest windows"]
        < errors["network of the paper"]
        < errors["coarse simulator"]
    )

# %% [markdown]
# ## No network at all
#
# The paper uses two networks: one for the waveform and one for the noise. Neither is needed to generate telemetry. Predict each training
# window by a ridge regression that has not seen its block of time; what is left is a *residual window*. Generated telemetry is the ridge
# prediction plus a residual window, drawn at random. Does a detector that was trained on it accept real telemetry? Both kinds of generated
# windows get the same number of windows, the same detector, and a threshold that is set on further windows of their own kind.

# %%
from enhsim_tf.detection import metrics
from enhsim_tf.detection.detectors import PCAResidual

coarse, residual_windows = train["coarse"], np.empty_like(train["target"])
for learnt, held_out in packaged.time_blocks(train["start"], 5, coarse.shape[1]):
    fitted = packaged.fit_ridge(coarse[learnt], train["target"][learnt], train["start"][learnt])
    residual_windows[held_out] = train["target"][held_out] - fitted.predict(coarse[held_out])
number = pipeline.settings.detector_windows
more = pipeline.windows("train", 2 * number, "strong baselines")["coarse"]
rng = np.random.default_rng(3)
drawn = residual_windows[rng.integers(0, len(residual_windows), 2 * number)]
generated = {
    "two networks (the paper)": pipeline.enhance(more)
    + pipeline.generate_noise(2 * number, np.random.default_rng(3)),
    "no network (ridge + residual windows)": ridge.predict(more) + drawn,
}
alarms = {}
for name, windows in generated.items():
    detector = PCAResidual(pipeline.settings.num_components).fit(windows[:number])
    limit = metrics.finite_threshold(detector.score(windows[number:]), 0.01)[0]
    alarms[name] = np.mean(detector.score(test["target"]) > limit)
say(
    "False alarms of the PCA residual on real nominal windows, set for 1 %: "
    + "; ".join(f"{name} **{rate:.1%}**" for name, rate in alarms.items())
    + "."
)
assert (
    not is_full or alarms["no network (ridge + residual windows)"] < 0.1 < alarms["two networks (the paper)"]
)

# %% [markdown]
# The windows of this noise *are* real. It can only repeat what it has, though: notebook 28 asks how many windows that takes.
#
# ## Trap 1: a baseline that was not tuned
#
# A baseline is easily made weak. Many libraries start ridge regression with a penalty of 1 and leave the data in their unit. Suppose that
# the simulator reports volts in one file and kilovolts in another. Without scaling, the same penalty means something else. Move the slider.

# %%
penalties = np.logspace(-9, 8, 35)


def raw_ridge(scale, penalty):
    """Ridge regression on inputs that are not scaled, other than by the unit."""
    mean, target_mean = train["coarse"].mean(axis=0, dtype=float), train["target"].mean(axis=0, dtype=float)
    X, Y = scale * (train["coarse"] - mean), train["target"] - target_mean
    values, basis = decomposed
    weights = basis @ ((scale * moments) / np.maximum(scale**2 * values + penalty, 1e-300)[:, None])
    return lambda windows: scale * (windows - mean) @ weights + target_mean


centred = (train["coarse"] - train["coarse"].mean(axis=0, dtype=float)).astype(float)
decomposed = np.linalg.eigh(centred.T @ centred)  # once for all penalties
moments = decomposed[1].T @ (centred.T @ (train["target"] - train["target"].mean(axis=0, dtype=float)))
np.testing.assert_allclose(
    raw_ridge(1.0, 5.0)(test["coarse"][:50]),
    train["target"].mean(axis=0, dtype=float)
    + (test["coarse"][:50] - train["coarse"].mean(axis=0, dtype=float))
    @ np.linalg.solve(
        centred.T @ centred + 5.0 * np.eye(500),
        centred.T @ (train["target"] - train["target"].mean(axis=0, dtype=float)),
    ),
    atol=1e-6,
)
curves = {
    unit: [nrmse(raw_ridge(scale, penalty)(test["coarse"]), test["truth"]) for penalty in penalties]
    for unit, scale in (("volts", 1.0), ("kilovolts", 1e-3))
}


def draw(exponent):
    at = {unit: float(np.interp(exponent, np.log10(penalties), values)) for unit, values in curves.items()}
    winners = [unit for unit, error in at.items() if error < errors["network of the paper"]]
    title = (
        f"Penalty 10^{exponent:g}: error {at['volts']:.3f} in volts and {at['kilovolts']:.3f} in kilovolts; ridge regression beats "
        f"the network in {' and in '.join(winners) or 'neither'}"
    )
    alt = (
        "Error of ridge regression on held-out windows over the penalty, for inputs in volts and in kilovolts"
    )
    with drawing(alt, height=2.2, title=title) as panel:
        for (unit, values), style in zip(curves.items(), ("-", ":")):
            panel.plot(penalties, values, color=QUIET, linestyle=style, label=f"ridge, inputs in {unit}")
        panel.axhline(
            errors["network of the paper"],
            color=ENHANCED,
            linestyle=DASHED,
            linewidth=0.8,
            label="network of the paper",
        )
        panel.plot(
            [10.0**exponent] * 2,
            list(at.values()),
            "o",
            color=QUIET,
            markerfacecolor="none",
            label="at this penalty",
        )
        panel.set(xlabel="penalty (logarithmic)", ylabel="NRMSE", xscale="log", yscale="log")
        panel.set_yticks([0.03, 0.1, 0.3, 1.0], ["0.03", "0.1", "0.3", "1"])
        panel.minorticks_off()
        panel.legend(frameon=False, fontsize=7, loc="upper left", bbox_to_anchor=(1, 1))


slider(draw, "exponent of the penalty", list(range(-9, 9)), shown=(0, 2))

# %% [markdown]
# *What to see:* both curves have the same shape and the same lowest point, but at penalties that differ by the square of the unit. A fixed
# penalty hits that lowest point by luck alone. The package divides the inputs by their standard deviation first and chooses the penalty by
# blocks of training time.

# %%
best = {unit: (penalties[np.argmin(values)], min(values)) for unit, values in curves.items()}
say(
    f"Lowest error: in volts **{best['volts'][1]:.3f}** at {best['volts'][0]:.1e}, in kilovolts **{best['kilovolts'][1]:.3f}** at "
    f"{best['kilovolts'][0]:.1e}. Chosen without looking at test windows: **{errors['ridge regression']:.3f}**."
)
np.testing.assert_allclose(best["volts"][1], best["kilovolts"][1], rtol=0.02)
assert best["volts"][0] / best["kilovolts"][0] > 1e5
assert not is_full or errors["ridge regression"] < 1.1 * best["volts"][1]

# %% [markdown]
# ## A pair on which a network can win
#
# In the paper's example, few different coarse windows occur, and the map is close to linear. Here is a pair where neither is true. A
# heater's current varies at random. The coarse simulator reports the current, smoothed. The real temperature follows the current with a
# lag, and a share of it follows the *square* of the current, as Joule heating does. Two things are in the telemetry that no simulator
# knows: a slow drift and sensor noise. They set a floor for everyone.

# %%
from scipy.signal import lfilter

window = 100
num_samples = 60_000 if is_full else 9_000


def heater(num_samples, squared_share, seed=0):
    """A coarse and a real run of `num_samples` samples, and what of the real run could be known."""
    rng = np.random.default_rng(seed)

    def lagged(values, memory):
        values = lfilter([1.0], [1.0, -memory], values)
        return values / values[500:].std()

    current = lagged(lagged(rng.standard_normal(num_samples + 3_000), 0.95), 0.9)
    linear = 0.8 * current + 0.2 * lagged(current, 0.98)
    linear /= linear[500:].std()
    knowable = linear + squared_share * (linear**2 - 1) / np.sqrt(2)
    drift = lagged(rng.standard_normal(num_samples + 3_000), 0.998)
    real = knowable + 0.3 * drift + 0.05 * rng.standard_normal(len(drift))
    return current[3_000:], real[3_000:], knowable[3_000:]


def cut(values, starts):
    return np.stack([values[start : start + window] for start in starts])


def split(run, stride=25):
    """Windows of the first two thirds, and disjoint windows of the rest, one window later."""
    border = 2 * num_samples // 3
    first = np.arange(0, border - window, stride)
    last = np.arange(border + window, num_samples - window, window)
    return first, last, [cut(values, starts) for starts in (first, last) for values in run]


first, last, (inputs, targets, _, new_inputs, new_targets, _) = split(heater(num_samples, 0.5))
alt = "Ten windows of the heater: coarse and real, over time"
stretch = slice(2_000, 3_000)
coarse_run, real_run, _ = heater(num_samples, 0.5)
title = f"The coarse run has an error of {nrmse(coarse_run, real_run):.0%} of the signal's deviation: it misses the square and the drift"
with drawing(alt, height=1.8, title=title) as panel:
    panel.plot(coarse_run[stretch], color=COARSE, linewidth=0.9, label="coarse simulator")
    panel.plot(real_run[stretch], color=REAL, linewidth=0.8, label="telemetry")
    panel.set(xlabel="time (s)", ylabel="value (sd)")
    panel.legend(frameon=False, ncols=2)

# %% [markdown]
# ## The network on what ridge regression leaves
#
# The network need not learn what a matrix can. Fit the matrix, and train a small network on what it leaves. This is the whole enhancer:

# %%
from enhsim_tf.common.backend import keras

num_epochs = 12 if is_full else 2


def fit_ridge_and_network(inputs, targets, starts, epochs, seed=0):
    in_mean, in_scale, out_mean, out_scale = inputs.mean(), inputs.std(), targets.mean(), targets.std()
    X = ((inputs - in_mean) / in_scale).astype("float32")
    Y = ((targets - out_mean) / out_scale).astype("float32")
    linear = packaged.fit_ridge(X, Y, starts)
    left = Y - linear.predict(X)
    unit = left.std()
    uniform = keras.initializers.HeUniform
    network = keras.Sequential(
        [
            keras.Input((window,)),
            keras.layers.Dense(256, "relu", kernel_initializer=uniform(seed * 1000)),
            keras.layers.Dense(256, "relu", kernel_initializer=uniform(seed * 1000 + 1)),
            keras.layers.Dense(window, kernel_initializer=uniform(seed * 1000 + 2)),
        ]
    )
    falling = keras.optimizers.schedules.CosineDecay(5e-4, epochs * -(-len(X) // 15))
    network.compile(keras.optimizers.Adam(falling), loss="mean_squared_error")
    rng = np.random.default_rng(seed)
    for _ in range(epochs):
        order = rng.permutation(len(X))
        network.fit(X[order], left[order] / unit, batch_size=15, shuffle=False, verbose=0)

    def predict(windows):
        rows = ((windows - in_mean) / in_scale).astype("float32")
        return out_mean + out_scale * (linear.predict(rows) + unit * network.predict(rows, verbose=0))

    return predict


# %% [markdown]
# The package has the same enhancer under the name *ridge and network*. After one pass over a few windows it must predict the same, up to
# rounding that the steps of Adam magnify:

# %%
from enhsim_tf.enhancer.candidates import RIDGE_AND_NETWORK, fit_enhancer

mine = fit_ridge_and_network(inputs[:300], targets[:300], first[:300], 1)(new_inputs)
ours = fit_enhancer(RIDGE_AND_NETWORK, inputs[:300], targets[:300], first[:300], seed=0, epochs=1)
ours = ours.predict(new_inputs[:, :, None])[:, :, 0]
np.testing.assert_allclose(mine, ours, atol=0.01 * targets.std())

# %% [markdown]
# ## From which nonlinearity on does it pay?
#
# The share of the squared current goes from 0 to 1. Everything else is equal: the same windows, the same drift, the same test time.

# %%
shares = (0.0, 0.1, 0.2, 0.5, 1.0) if is_full else (0.0, 0.5)
rows = {"ridge regression": [], "nearest windows": [], "ridge + network": [], "floor (drift and noise)": []}
for share in shares:
    first, last, (inputs, targets, _, new_inputs, new_targets, knowable) = split(heater(num_samples, share))
    k = packaged.choose_num_neighbours(inputs, targets, first)
    predicted = {
        "ridge regression": packaged.fit_ridge(inputs, targets, first).predict(new_inputs),
        "nearest windows": nearest_mean(inputs, targets, new_inputs, k),
        "ridge + network": fit_ridge_and_network(inputs, targets, first, num_epochs)(new_inputs),
        "floor (drift and noise)": knowable,
    }
    for name, estimate in predicted.items():
        rows[name].append(nrmse(estimate, new_targets))

# %%
gains = [alone - both for alone, both in zip(rows["ridge regression"], rows["ridge + network"])]
paying = [share for share, gain in zip(shares, gains) if gain > 0]
title = (
    f"The network pays at a squared share of {', '.join(f'{share:g}' for share in paying) or 'none tried'}"
    + f"; without any it changes the error of ridge regression by {-gains[0]:+.3f}"
)
looks = {
    "ridge regression": (QUIET, "-", "s"),
    "nearest windows": (COARSE, ":", "^"),
    "ridge + network": (ENHANCED, DASHED, "o"),
    "floor (drift and noise)": (REAL, "-", ""),
}
alt = "Error on held-out time over the share of the squared current, for three enhancers and the floor"
with drawing(alt, height=2.4, title=title) as panel:
    for name, values in rows.items():
        color, style, marker = looks[name]
        panel.plot(
            shares,
            values,
            color=color,
            linestyle=style,
            marker=marker,
            markersize=4,
            linewidth=1,
            label=name,
        )
    panel.set(
        xlabel="share of the squared current",
        ylabel="NRMSE on held-out time",
        ylim=(0, 1.1 * max(map(max, rows.values()))),
    )
    panel.legend(frameon=False, loc="upper left")

# %% [markdown]
# *What to see:* without a square, the network has nothing to find and can only add error. The more of the signal is nonlinear, the further
# ridge regression falls behind. The error of the nearest windows hardly depends on the share: they can follow a curve, too, but are behind
# the network at every share.

# %%
for name, values in rows.items():
    print(f"{name:24}" + "".join(f"   share {share:g}: {value:.3f}" for share, value in zip(shares, values)))
assert gains[0] < 0.01  # nothing to find
assert not is_full or (gains[-1] > 0.1 and rows["ridge + network"][-1] < rows["nearest windows"][-1])

# %% [markdown]
# ## Trap 2: a random split of overlapping windows
#
# Windows are usually cut with a small stride, so neighbours share nearly all samples. Hold out a *random* fifth of them, and each held-out
# window has neighbours in training that are a few samples away. They know its drift, which no honest prediction can. Hold out blocks of
# time instead, without the training windows that touch the block, and this knowledge is gone. Same windows, same methods, two ways to
# split:

# %%
short, stride = 6_000, 5
coarse_run, real_run, _ = heater(short, 0.2)
starts = np.arange(0, short - window, stride)
inputs, targets = cut(coarse_run, starts), cut(real_run, starts)
shuffled = np.array_split(np.random.default_rng(1).permutation(len(starts)), 5)
folds = {
    "random fifths": [(np.setdiff1d(np.arange(len(starts)), fold), fold) for fold in shuffled],
    "blocks of time": packaged.time_blocks(starts, 5, window),
}


def error_of(predict, folds):
    """NRMSE over all held-out folds of a function of training inputs, training targets and held-out inputs."""
    squares = [
        (predict(inputs[learnt], targets[learnt], inputs[held_out]) - targets[held_out]) ** 2
        for learnt, held_out in folds
    ]
    return np.sqrt(np.mean(np.concatenate(squares))) / targets.std()


def ridge_at(penalty):
    def predict(train_inputs, train_targets, new):
        return packaged.fit_ridge(train_inputs, train_targets, penalties=[penalty]).predict(new)

    return predict


neighbours = (1, 3, 10, 30)
judged = {
    kind: {
        f"nearest windows, k = {k}": error_of(lambda *windows, k=k: nearest_mean(*windows, k), parts)
        for k in neighbours
    }
    | {"ridge regression": error_of(ridge_at(10.0), parts)}
    for kind, parts in folds.items()
}

# %%
nearest_names = [name for name in judged["random fifths"] if name != "ridge regression"]
verdicts = {
    kind: min(values[name] for name in nearest_names) < values["ridge regression"]
    for kind, values in judged.items()
}
winner = {
    kind: "nearest windows" if is_nearest else "ridge regression" for kind, is_nearest in verdicts.items()
}
title = f"With random fifths, {winner['random fifths']} have the smaller error; with blocks of time, {winner['blocks of time']} has"
alt = "Error of nearest windows and ridge regression, judged on random fifths and on blocks of time"
with drawing(alt, height=2.2, title=title) as panel:
    places = np.arange(len(judged["random fifths"]))
    for offset, (kind, values) in zip((-0.2, 0.2), judged.items()):
        is_random = kind == "random fifths"
        bars = panel.barh(
            places + offset,
            list(values.values()),
            0.38,
            color="white" if is_random else QUIET,
            hatch="////" if is_random else "",
            edgecolor=QUIET,
            label=f"judged on {kind}",
        )
        panel.bar_label(bars, [f"{value:.2f}" for value in values.values()], padding=2, fontsize=7)
    panel.set_yticks(places, list(judged["random fifths"]))
    panel.set(
        xlabel="NRMSE (standard deviations of the telemetry)",
        xlim=(0, 1.15 * max(judged["blocks of time"].values())),
    )
    panel.invert_yaxis()
    panel.legend(frameon=False, loc="upper left", bbox_to_anchor=(1, 1))

# %% [markdown]
# *What to see:* the random split makes every method look better, and most of all the one that can copy a neighbour. It even reverses the
# order of the methods. A comparison on random splits of overlapping windows would recommend the wrong one.

# %%
flattery = {
    name: judged["blocks of time"][name] / judged["random fifths"][name] for name in judged["random fifths"]
}
say(
    "Honest error divided by the flattering one: "
    + ", ".join(f"{name} **{ratio:.2f}**" for name, ratio in flattery.items())
    + "."
)
assert flattery["nearest windows, k = 3"] > flattery["ridge regression"] > 1
assert verdicts["random fifths"] and not verdicts["blocks of time"]

# %% [markdown]
# ## What published runs say
#
# Two studies of this project compare enhancers. The *battery* is a real pair of simulators ([study](../studies/battery/README.md)): near
# 1 C and at 15 °C it is *gentle*; in the *hard* regime, at −5 °C, it is discharged deeply, and the map is less linear. The *factorial
# experiment* combines windows, extraction, enhancer and generator in all ways and measures false alarms
# ([study](../studies/factorial/README.md)).

# %%
battery, _ = open_study("battery")
chosen = ("coarse itself", "nearest windows", "paper's network", "ridge, all columns", "ridge and network")
print(f"{'NRMSE on nominal orbits':26}" + "".join(f"{regime:>18}" for regime in battery["regimes"]))
for name in chosen:
    of = [found["nominal"][name] for found in battery["regimes"].values()]
    print(f"{name:26}" + "".join(f"{each['mean']:>11.3f} ± {each['standard_error']:.3f}" for each in of))
for regime, found in battery["regimes"].items():
    alone, both = found["nominal"]["ridge, all columns"], found["nominal"]["ridge and network"]
    lower = 1 - both["mean"] / alone["mean"]
    times = ", ".join(
        f"{name} for {number} of {found['num_seeds']} seeds" for name, number in found["chosen"].items()
    )
    say(
        f"*{regime}*: the network on what ridge regression leaves changes its error by **{-lower:+.0%}**. Held-out blocks choose {times}."
    )

# %%
factorial, _ = open_study("factorial")
contrasts = factorial["contrasts"]
told = {
    "the network instead of ridge regression, both with residual windows": "network, ridge",
    "no network instead of training on real windows": "no network, real",
    "no network instead of the paper's pipeline": "no network, paper",
}
for words, name in told.items():
    change = contrasts[name]["false_alarms"]
    say(
        f"False alarms, {words}: **{100 * change['mean']:+.1f} points** (95 % interval {100 * change['low']:+.1f} to "
        f"{100 * change['high']:+.1f})."
    )

# %% [markdown]
# **Answer.** A network pays where the map has a part that no matrix has. (How many windows it needs to learn that part, this lesson does
# not vary.) To be fair, give every method the same data; choose every setting, of the baseline too, on training time; set thresholds in the
# same way; and judge on blocks of time. Then the smaller error is worth believing, whichever method has it.
#
# ## Exercises
#
# **1.** Which penalty of `candidates` does an honest choice take for the overlapping windows of trap 2? Use `error_of` and `ridge_at`.

# %%
candidates = (1e-3, 1e-1, 1e1, 1e3, 1e5)
best_penalty = None  # your answer: one of the candidates

# %%
honest = {penalty: error_of(ridge_at(penalty), folds["blocks of time"]) for penalty in candidates}
check_answer(
    best_penalty,
    lambda penalty: honest[penalty] == min(honest.values()),
    "Compare error_of(ridge_at(penalty), folds[...]) over the candidates. Which of the two kinds of folds is honest?",
)

# %% [markdown]
# **2.** The table of trap 2 is computed from many windows. How many *disjoint* windows fit into the same telemetry? Give the number, from
# `short` and `window`. (A standard error that divides by the root of `len(starts)` is too small by the root of the ratio.)

# %%
num_disjoint = None  # your answer

# %%
check_answer(
    num_disjoint,
    lambda number: number == len(range(0, short - window + 1, window)),
    "Windows that share no sample begin a whole window apart.",
)

# %% [markdown]
# ## Solution
#
# <details><summary>1. The penalty</summary>
#
# ```python
# for penalty in candidates:
#     both = [f"{error_of(ridge_at(penalty), parts):.3f} by {kind}" for kind, parts in folds.items()]
#     print(f"penalty {penalty:8g}: {', '.join(both)}")
# best_penalty = min(candidates, key=lambda penalty: error_of(ridge_at(penalty), folds["blocks of time"]))
# ```
#
# A matrix can use neighbours, too, if its penalty is small: that is where the two columns differ most.
#
# </details>

# %% [markdown]
# <details><summary>2. The number of independent windows</summary>
#
# ```python
# num_disjoint = short // window
# factor = np.sqrt(len(starts) / num_disjoint)
# print(f"{len(starts):,} windows, {num_disjoint} of them disjoint: standard errors are too small by a factor of {factor:.1f}")
# ```
#
# Even disjoint windows are not independent here: the drift lasts for several of them. Blocks of time that are much longer than the drift
# would be.
#
# </details>
