# %% [markdown]
# # Figure 8: the source noise
#
# **What the paper says** (section 2.3): "Noise and other stochastic environmental effects of real telemetry are extracted using a
# moving average filter. This average is subtracted from the original signal, leaving the noise that needs to be simulated." It cites
# pandas' rolling mean and gives no width; this project uses 25 samples.

# %%
import sys

sys.path.insert(0, "..")  # the clone that this notebook lies in

import numpy as np

from enhsim_tf.common.plot_style import AVERAGE, COARSE, REAL
from enhsim_tf.reproduce.notebook import claim, drawing, open_experiment, show

experiment = open_experiment()
claim("C6")

# %% [markdown]
# ## How it is built
#
# `extract_noise` splits a series into its centred moving average and the rest. Samples at the edges that have no full average are cut:
# padding with zeros would invent noise there.

# %%
from enhsim_tf import extract_noise

width = experiment.settings.noise.moving_average
telemetry = experiment.data.channels[0].train
noise, average = extract_noise(telemetry.values, width)
assert len(noise) == len(telemetry) - width + 1

# %%
arrays = show(experiment, "fig08_source_noise")

# %% [markdown]
# *What to see:* an even band of noise, almost as wide as the noise that was put in. "Almost" can be computed. The average holds a 25th
# of each sample's own noise, so white noise of variance $\sigma^2$ leaves $\sigma^2(1-1/w)$. And it smooths the waves a little, so that
# a small share of each stays in the noise.

# %%
half, chosen = width // 2, experiment.settings.telemetry
periods = np.array([chosen.orbit_period_s, chosen.rotation_period_s])
amplitudes = np.array([chosen.orbit_amplitude, chosen.rotation_amplitude])

# what the average keeps of each sine, and what it therefore leaves in the noise
kept = np.cos(2 * np.pi * np.arange(-half, half + 1) / periods[:, None]).mean(axis=1)
left = amplitudes * (1 - kept)
expected = np.sqrt(chosen.noise_sd**2 * (1 - 1 / width) + np.sum(left**2) / 2)
print(f"standard deviation of the noise: {noise.std():.5f} measured, {expected:.5f} computed")
print(f"left of the 2-minute wave: {left[1] / amplitudes[1]:.1%} of its amplitude")
assert abs(noise.std() / expected - 1) < 0.01

# %% [markdown]
# So what the noise networks learn from is not quite white, though white noise was put in. Subtracting an average makes neighbours repel
# each other; the closed form below holds for lags up to half the width.

# %%
from enhsim_tf.realism.measures import autocorrelation

lags = np.arange(1, 40)
near, far = (width - lags) / width**2 - 2 / width, np.clip(width - lags, 0, None) / width**2
of_noise = chosen.noise_sd**2 * np.where(lags <= half, near, far)
of_waves = left**2 / 2 @ np.cos(2 * np.pi * lags / periods[:, None])
closed_form = (of_noise + of_waves) / expected**2
measured = autocorrelation(noise[None, :50_000], 39)[1:]

# %%
alt = "Correlation of the extracted noise with itself, measured and in closed form"
with drawing(alt, height=1.8) as panel:
    panel.plot(lags, closed_form, color=AVERAGE, label="closed form")
    panel.plot(lags, measured, "o", color=REAL, markersize=2.5, label="measured")
    panel.set(xlabel="lag in samples", ylabel="correlation")
    panel.legend(frameon=False)

# %% [markdown]
# *What to see:* small negative correlations at short lags, a step at half the width, and the points on the line.

# %%
print(f"lag 1: {measured[0]:.4f} measured, {closed_form[0]:.4f} computed")
assert np.abs(measured - closed_form).max() < 0.02

# %% [markdown]
# ## Exercises
#
# 1. Choose the width yourself. Plot the standard deviation of the extracted noise for widths from 3 to 121. Where is it closest to what
#    was put in, and what goes wrong on either side?
# 2. Most of the noise in a real channel is not white. Which noise would a moving average of 25 samples not see at all?

# %% [markdown] jp-MarkdownHeadingCollapsed=true
# ## Solution

# %%
widths = np.arange(3, 122, 2)
deviations = [extract_noise(telemetry.values[:50_000], int(candidate))[0].std() for candidate in widths]
alt = "Standard deviation of the extracted noise by the width of the moving average"
with drawing(alt, height=1.8) as panel:
    panel.plot(widths, deviations, color=REAL)
    panel.axhline(chosen.noise_sd, color=COARSE, linestyle=":")
    panel.set(xlabel="width in samples", ylabel="standard deviation", xlim=(0, 121))
best = widths[np.argmin(np.abs(np.array(deviations) - chosen.noise_sd))]
print("closest to the noise that was put in:", best, "samples")
assert 15 < best < 45

# %% [markdown]
# <details><summary>What to say about it</summary>
#
# 1. A narrow average swallows part of the noise: each sample is a third, a fifth, ... of its own average. A wide one smooths the
#    2-minute wave away and calls it noise. In between the two errors cancel in the standard deviation, and *only* there: the noise
#    still holds a trace of the wave. The right width is short against the fastest signal and long against the noise.
# 2. Slow noise. A drift over hours passes the average untouched and ends up in the *waveform*, for which the enhancer has no input. Red
#    noise (random walks, thermal drifts) is mostly of this kind.
#
# </details>
