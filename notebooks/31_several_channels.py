# %% [markdown]
# # Several channels
#
# **Question:** how is a fault found that no single channel shows?
#
# - **After this lesson** you can generate noise for several channels that keeps their correlation, and build a detector that uses it.
# - **You should know** ridge regression (notebook 04), the conformal threshold (notebook 13) and residual windows (notebook 25).
# - **Terms:** [residual](../docs/glossary.md#residual): telemetry minus enhanced run; *marginal*: the distribution of one channel alone;
#   *cross-correlation*: here the correlation of two channels at the same time; *Mahalanobis distance*: a distance in units of the spread
#   that is usual in that direction.
#
# **What the paper says:** its telemetry has one channel.

# %%
import numpy as np
import pandas as pd
from lesson_tools import check_answer, drawing
from scipy.signal import lfilter

from enhsim_tf.common.plot_style import COARSE, ENHANCED, REAL
from enhsim_tf.enhancer.ridge import fit_ridge, time_blocks

window, num_samples = 100, 60_000


def lagged(values, memory):
    """A slow version of a series, with a standard deviation of 1."""
    values = lfilter([1.0], [1.0, -memory], values, axis=0)
    return values / values[1_000:].std(axis=0)


rng = np.random.default_rng(0)
current = lagged(rng.standard_normal(num_samples), 0.97)  # what the simulator knows
sunlight = lagged(rng.standard_normal(num_samples), 0.99)  # what it does not know, and both channels feel
own = 0.1 * rng.standard_normal((num_samples, 2))
signal = lagged(np.stack([current, current], axis=1), 0.9) * [1.0, 0.6]
telemetry = signal + sunlight[:, None] * [0.3, 0.25] + own

# %% [markdown]
# Two temperatures of one panel follow a current that the simulator knows, and sunlight that it does not know. Cut windows, and map the
# simulator's windows to both channels at once. What this leaves of a window is a residual of two channels; those of the known windows are
# by [cross-fitting](../docs/glossary.md#cross-fitting), so that no window is judged by a matrix that was fitted to it:


# %%
def cut(values, starts):
    return np.stack([values[start : start + window] for start in starts])


starts = np.arange(1_000, num_samples - window + 1, 50)
known, later = starts[starts < 40_000], starts[starts >= 40_000 + window]
inputs, targets = cut(current, known), cut(telemetry, known)
ridge = fit_ridge(inputs, targets.reshape(len(known), -1), known, num_channels=2)
residuals = np.empty_like(targets)
for learnt, held_out in time_blocks(known, 5, window):
    fitted = fit_ridge(
        inputs[learnt], targets[learnt].reshape(len(learnt), -1), known[learnt], num_channels=2
    )
    residuals[held_out] = targets[held_out] - fitted.predict(inputs[held_out]).reshape(-1, window, 2)
new_residuals = cut(telemetry, later) - ridge.predict(cut(current, later)).reshape(-1, window, 2)
print(f"{len(known)} known windows, {len(later)} later ones")

# %% [markdown]
# ## Drawing noise for two channels
#
# A residual window is drawn at random. Draw it *for both channels at once*, or *separately*, each channel from a time of its own:


# %%
def draw_jointly(number, rng):
    return residuals[rng.integers(0, len(residuals), number)]


def draw_separately(number, rng):
    return np.stack(
        [residuals[rng.integers(0, len(residuals), number), :, channel] for channel in range(2)], axis=2
    )


def cross_correlation(windows):
    return np.corrcoef(windows[:, :, 0].ravel(), windows[:, :, 1].ravel())[0, 1]


noise = {
    "drawn jointly": draw_jointly(2_000, np.random.default_rng(1)),
    "drawn separately": draw_separately(2_000, np.random.default_rng(1)),
}
every = {"real": new_residuals} | noise
correlations = {name: cross_correlation(windows) for name, windows in every.items()}
table = pd.DataFrame({name: windows.std(axis=(0, 1)) for name, windows in every.items()}).T
table.columns = ["sd of the first channel", "sd of the second"]
print(table.assign(**{"cross-correlation": correlations}).round(2).to_string())
assert abs(correlations["drawn jointly"] - correlations["real"]) < 0.1
assert abs(correlations["drawn separately"]) < 0.1

# %%
title = f"Only noise drawn jointly keeps the channels' correlation of {correlations['real']:.2f}"
alt = "Scatter of the residuals of two channels: real, drawn jointly, drawn separately"
with drawing(alt, columns=3, height=2.4, title=title, sharex=True, sharey=True) as panels:
    for panel, (name, windows), color in zip(panels, every.items(), (REAL, ENHANCED, COARSE)):
        points = windows[:200, ::10].reshape(-1, 2)
        panel.plot(points[:, 0], points[:, 1], ".", color=color, markersize=2)
        panel.set(xlabel="first channel (dimensionless)", title=name)
    panels[0].set_ylabel("second channel (dimensionless)")

# %% [markdown]
# Each channel alone keeps its marginal, however the noise is drawn: its windows are whole windows of residuals in both draws.
#
# ## A detector that sees both
#
# Describe a residual window by the means $f$ of its four quarters, of one channel or of both. The score is the square of the *Mahalanobis
# distance*, $(f-m)^\top C^{-1}(f-m)$, with the mean $m$ and the covariance $C$ of the training windows. With both channels, $C$ holds how
# they move together.


# %%
def quarters(windows):
    return windows.reshape(len(windows), 4, window // 4, -1).mean(axis=2).reshape(len(windows), -1)


def fit_distance(windows):
    features = quarters(windows)
    mean, precision = features.mean(axis=0), np.linalg.inv(np.cov(features, rowvar=False))
    return lambda others: np.einsum(
        "wi,ij,wj->w", quarters(others) - mean, precision, quarters(others) - mean
    )


def conformal(scores, rate=0.01):
    return np.sort(scores)[int(np.ceil((len(scores) + 1) * (1 - rate))) - 1]


alone = [fit_distance(residuals[:, :, [channel]]) for channel in range(2)]
detectors = {
    "each channel alone": lambda windows: np.maximum(*(alone[n](windows[:, :, [n]]) for n in range(2))),
    "both, noise drawn separately": fit_distance(noise["drawn separately"]),
    "both, noise drawn jointly": fit_distance(noise["drawn jointly"]),
}

# %% [markdown]
# The fault: the second sensor feels the sunlight of another time, as if it sat elsewhere. The residual windows of each channel stay as they
# were; only their pairs change. The last row asks whether the simulator is needed at all: its detector learns the telemetry itself. (The
# same windows, from which all training windows are drawn, set the thresholds. With 4 or 8 numbers for each of 780 windows this hardly
# changes the threshold, as the false alarms show. A PCA residual of 20 directions of 500 needs other windows for its threshold, see the
# study of [few windows](../studies/few_windows/README.md).)

# %%
other = np.random.default_rng(2).permutation(len(new_residuals))
wrong_time = np.stack([new_residuals[:, :, 0], new_residuals[other][:, :, 1]], axis=2)
rates = {}
for name, score in detectors.items():
    limit = conformal(score(residuals))
    rates[name] = np.mean(score(wrong_time) > limit), np.mean(score(new_residuals) > limit)
raw, enhanced = fit_distance(targets), ridge.predict(cut(current, later)).reshape(-1, window, 2)
limit = conformal(raw(targets))
rates["both, without a simulator"] = (
    np.mean(raw(enhanced + wrong_time) > limit),
    np.mean(raw(cut(telemetry, later)) > limit),
)
title = (
    f"Noise drawn jointly lets the detector find {rates['both, noise drawn jointly'][0]:.0%} of the windows"
)
alt = "Share of windows found with one channel of another time, for four detectors"
with drawing(alt, height=1.7, title=title) as panel:
    colors = [COARSE, COARSE, ENHANCED, REAL]
    bars = panel.barh(list(rates), [100 * found for found, _ in rates.values()], color=colors)
    panel.bar_label(bars, fmt="%.0f", padding=2, fontsize=7)
    panel.invert_yaxis()
    panel.set(xlabel="windows found (%; thresholds set for 1 %)", xlim=(0, 105))

# %% [markdown]
# *What to see:* the detector of each channel alone finds little more than its false alarms. Looking at both is not enough: trained on
# noise without correlation, a detector does not notice that the correlation is gone. Trained on noise drawn jointly, it finds nearly
# every window. Without a simulator it finds nearly as many here.

# %%
print(pd.DataFrame(rates, index=["found", "false alarms"]).T.round(3).to_string())
assert rates["both, noise drawn jointly"][0] > 0.5 > 0.1 > rates["both, noise drawn separately"][0]
assert rates["each channel alone"][0] < 0.05 and rates["both, without a simulator"][0] > 0.5

# %% [markdown]
# ## The same with the package
#
# `fit` learns all columns of a file together: one enhancer, and residual windows drawn for all channels at once. Its report compares the
# cross-correlation of the noise with that of two halves of real noise. `score` adds up simple *views* of telemetry minus enhanced run
# ([how](../docs/forms.md#how-telemetry-is-scored)). One of them, *relation*, is what a linear prediction from the past of all channels
# leaves. In the later telemetry below, the second sensor feels the sunlight of another time from 5,000 s to 7,000 s:

# %%
from enhsim_tf import FitOptions, clean, fit, read_recording, read_source

clock = pd.Index(np.arange(20_000.0), name="time")
measured = read_source(pd.DataFrame(telemetry[1_000:21_000], clock, ["sunny side", "back"]))
simulated = read_recording(pd.DataFrame({"current": current[1_000:21_000]}, clock))
options = FitOptions(window=window, num_windows=600, enhancer="ridge", noise="residual windows")
model, report = fit({name: clean(series).parts for name, series in measured.items()}, simulated, options)
print("\n".join(line for line in report.lines() if "correlation of the noise" in line))

from enhsim_tf import events_table, read_telemetry, score

later_on = telemetry[21_000:31_000].copy()
later_on[5_000:7_000, 1] += 0.25 * (sunlight[41_000:43_000] - sunlight[26_000:28_000])
clock = clock[:10_000]
(new,) = read_telemetry(pd.DataFrame(later_on, clock, ["sunny side", "back"]))
events = events_table(
    score(model, new, read_recording(pd.DataFrame({"current": current[21_000:31_000]}, clock)))
)
print(events[["begin", "end", "detected", "views", "channels"]].to_string(index=False))
of_the_fault = events[events["begin"].between(4_900, 5_200)]
assert len(of_the_fault) == 1 and of_the_fault["views"].str.startswith("relation").all()

# %% [markdown]
# The noise's correlation is about as near to the real one as two halves of real noise are to each other. The event of the fault begins near
# its onset, and the relation of the channels raised most of it. The first event is a false alarm, and the last one lies within the event of
# the fault.
#
# **Answer.** By a detector that sees all channels and has learnt how they move together. If it learns from generated windows, these must
# keep the relation; residual windows drawn for all channels at once do.
#
# ## Exercises
#
# **1.** Another fault that no channel shows alone: the second sensor feels the *sunlight* a tenth of a window late, while its response to
# the current stays on time. The next cell makes these residuals, `delayed`. Give the share that the detector of noise drawn jointly finds.

# %%
earlier = cut(telemetry, later - 10) - ridge.predict(cut(current, later - 10)).reshape(-1, window, 2)
delayed = np.stack([new_residuals[:, :, 0], earlier[:, :, 1]], axis=2)
share_late = None  # your answer

# %%
from notebooks import answers_tool

score_jointly = detectors["both, noise drawn jointly"]
check_answer(
    share_late,
    lambda share: abs(share - answers_tool.share_late(score_jointly, delayed, residuals)) < 0.02,
    "Score `delayed` with the detector of both channels and the threshold of the known residuals.",
)

# %% [markdown]
# **2.** How closely do the means of the quarters agree between the channels? Give the correlation of the first quarter of the first
# channel with the first quarter of the second, over the known residuals.

# %%
correlation = None  # your answer

# %%
check_answer(
    correlation,
    lambda value: abs(value - answers_tool.shared_quarters(quarters(residuals))) < 0.002,
    "quarters gives the channels of a quarter side by side: columns 0 and 1 belong to the first quarter.",
)
