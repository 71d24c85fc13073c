# %% [markdown]
# # Noise from a moving average (Figure 8)
#
# **Question:** how can the noise be separated from telemetry if nobody knows the true signal?
#
# - **After this lesson** you can write the moving-average filter of the paper, predict from a formula what it removes and what it leaves
#   behind, and choose its width.
# - **You should know** mean, variance and correlation.
# - **Terms:** [moving average](../docs/glossary.md#moving-average), standard deviation (sd), *lag-k correlation*: the correlation of a
#   series with itself $k$ samples later, $\rho_k=\mathrm{mean}\left((x_t-\bar x)(x_{t+k}-\bar x)\right)/\mathrm{var}(x)$.
#   *White* noise has $\rho_k=0$ for all $k>0$.
#
# **What the paper says** (section 2.3): "Noise and other stochastic environmental effects of real telemetry are extracted using a
# moving average filter. This average is subtracted from the original signal, leaving the noise that needs to be simulated." It cites
# the rolling mean of pandas and gives no width. This project uses 25 samples.

# %%
import numpy as np
from lesson_tools import check_answer, drawing, open_pipeline, say, show, slider

from enhsim_tf.common.plot_style import AVERAGE, DASHED, QUIET, REAL

pipeline, budget = open_pipeline()

# %% [markdown]
# ## The filter
#
# The average of $w$ samples around a sample estimates the signal there, and what is left is called noise:
#
# $$a_t=\frac1w\sum_{k=-h}^{h}x_{t+k},\qquad n_t=x_t-a_t,\qquad w=2h+1$$
#
# The first and the last $h$ samples have no full average. They are cut off. If they were padded with zeros, the edges would get noise
# that is not in the telemetry.

# %%
telemetry = pipeline.parts["train"]
values, width = telemetry.values.astype(float), pipeline.settings.moving_average


def moving_average(values, width):
    return np.convolve(values, np.ones(width) / width, mode="valid")  # "valid": full averages only


def extract(values, width):
    half = width // 2
    return values[half:-half] - moving_average(values, width)


noise = extract(values, width)
say(f"{len(values):,} samples of telemetry, a width of {width} samples, {len(noise):,} samples of noise.")

# %% [markdown]
# The package does the same. It stores 32-bit numbers, which for values below 1 are rounded by less than $10^{-7}$, so both results may
# differ by a little more than that:

# %%
from enhsim_tf.paper.noise import extract_noise

packaged, _ = extract_noise(telemetry.values, width)
np.testing.assert_allclose(noise, packaged, atol=1e-6)

# %%
show(pipeline, "fig08_source_noise")

# %% [markdown]
# *What to see:* an even band of noise. In this example the true noise is known, because the telemetry was made by adding white noise to
# two sines. The filter finds almost its standard deviation:

# %%
chosen = pipeline.settings
true_sd, half = chosen.noise_sd, width // 2
say(f"Standard deviation of the noise: **{noise.std():.4f}** extracted, **{true_sd}** put in.")
assert abs(noise.std() / true_sd - 1) < 0.03

# %% [markdown]
# ## Why "almost"
#
# Two errors can be computed beforehand.
#
# 1. The average contains $1/w$ of each sample's own noise. White noise of variance $\sigma^2$ therefore leaves
#    $\sigma^2\,(1-1/w)$.
# 2. The average also flattens the waves. Of a sine of period $P$ it keeps the share $c=\frac1w\sum_{k=-h}^{h}\cos(2\pi k/P)$, so
#    $1-c$ of its amplitude $A$ is called noise, with a variance of $A^2(1-c)^2/2$.

# %%
periods = np.array([chosen.orbit_period, chosen.rotation_period])
amplitudes = np.array([chosen.orbit_amplitude, chosen.rotation_amplitude])


def left_of_the_waves(width):
    steps = np.arange(-(width // 2), width // 2 + 1)
    kept = np.cos(2 * np.pi * steps / periods[:, None]).mean(axis=1)
    return amplitudes * (1 - kept)


def predicted_sd(width):
    return np.sqrt(true_sd**2 * (1 - 1 / width) + np.sum(left_of_the_waves(width) ** 2) / 2)


left = left_of_the_waves(width)
say(
    f"Predicted: **{predicted_sd(width):.5f}**; measured: **{noise.std():.5f}**. Of the 2-minute wave, "
    f"**{left[1] / amplitudes[1]:.1%}** of the amplitude stay in the noise."
)
assert abs(noise.std() / predicted_sd(width) - 1) < 0.01

# %% [markdown]
# ## Which width?
#
# The slider changes the width. The left panel shows one window of telemetry and its average, the right one what is left.

# %%
margin = 120 + 1  # half the widest average, so that each width shows the same 500 s
piece = values[: 500 + 2 * margin]


def draw(width):
    half, extracted = width // 2, extract(values[:100_000], width)
    title = f"Width {width} leaves a standard deviation of {extracted.std():.3f}; {true_sd} was put in"
    with drawing(
        f"Telemetry, its moving average over {width} samples, and the rest", 2, 1.9, title
    ) as panels:
        panels[0].plot(piece[margin:][:500], color=REAL, linewidth=0.5, label="telemetry")
        panels[0].plot(moving_average(piece, width)[margin - half :][:500], color=AVERAGE, label="average")
        panels[0].set(xlabel="time (s)", ylabel="value (dimensionless)")
        panels[0].legend(frameon=False)
        panels[1].plot(extract(piece, width)[margin - half :][:500], color=REAL, linewidth=0.5)
        panels[1].set(xlabel="time (s)", ylabel="rest (dimensionless)", ylim=(-0.8, 0.8))


slider(draw, "width", range(3, 242, 2), shown=(25, 3, 121), unit="samples")

# %% [markdown]
# *What to see:* a narrow average follows the noise itself, so that subtracting it removes a part of the noise. A wide one no longer follows
# the 2-minute wave, which then is called noise. A good width is therefore short against the fastest signal, and so long that $1/w$ is
# small. (Noise with a memory: exercise 2.) The formula says the same for all widths:

# %%
widths = np.arange(3, 122, 2)
measured = np.array([extract(values[:50_000], each).std() for each in widths])
predicted = np.array([predicted_sd(each) for each in widths])
alt = "Standard deviation of the extracted noise by the width of the moving average, measured and predicted"
title = "A narrow average removes noise; a wide one adds the wave"
with drawing(alt, height=2.1, title=title) as panel:
    panel.plot(widths, predicted, color=AVERAGE, label="predicted")
    panel.plot(widths[::3], measured[::3], "o", color=REAL, markersize=2.5, label="measured")
    panel.axhline(true_sd, color=QUIET, linestyle=":", label="put in")
    panel.set(
        xlabel="width of the moving average (samples)",
        ylabel="sd (dimensionless)",
        xlim=(0, 122),
    )
    panel.legend(frameon=False)
assert np.abs(measured / predicted - 1).max() < 0.03

# %% [markdown]
# ## The filter leaves a mark
#
# White noise was put in, but what comes out is not quite white. Up to half the width, the noise of a sample is also a part of the average
# that is subtracted from its neighbour at lag $k$, and the other way round: this gives a covariance of $-2\sigma^2/w$. The two averages
# share $w-k$ samples, which gives $+\sigma^2\,(w-k)/w^2$. The sum is $-\sigma^2\,(w+k)/w^2$: the first effect is larger. Beyond half
# the width, only the second is left, hence the step, and beyond the width none. The remains of the waves add a little at all lags.

# %%
lags = np.arange(1, 40)
near, far = -(width + lags) / width**2, np.clip(width - lags, 0, None) / width**2
of_noise = true_sd**2 * np.where(lags <= half, near, far)
of_waves = left**2 / 2 @ np.cos(2 * np.pi * lags / periods[:, None])
closed_form = (of_noise + of_waves) / predicted_sd(width) ** 2

centred = noise[:100_000] - noise[:100_000].mean()
correlations = np.array([np.mean(centred[:-lag] * centred[lag:]) for lag in lags]) / centred.var()

alt = "Correlation of the extracted noise with itself by lag, measured and in closed form"
title = "Extracted noise is not white: near samples are negatively correlated"
with drawing(alt, height=2.1, title=title) as panel:
    panel.plot(lags, closed_form, color=AVERAGE, linestyle=DASHED, label="closed form")
    panel.plot(lags, correlations, "o", color=REAL, markersize=2.5, label="measured")
    panel.axhline(0, color=QUIET, linewidth=0.5)
    panel.set(xlabel="lag (samples; one sample is 1 s)", ylabel="correlation")
    panel.legend(frameon=False)

# %% [markdown]
# *What to see:* negative correlations up to lag 12, a step there, and the measured points close to the line. The noise networks of the
# next lessons learn from this noise, and have to learn this mark too.

# %%
say(f"Lag 1: **{correlations[0]:.3f}** measured, **{closed_form[0]:.3f}** computed.")
assert np.abs(correlations - closed_form).max() < 0.01

# %% [markdown]
# **Answer.** Subtract a moving average that is many samples wide, but short against the fastest signal. What is
# left has nearly the right standard deviation, but 7 % of the 2-minute wave stay in it, and near samples become negatively correlated.
#
# ## Exercises
#
# **1.** For which odd width from 3 to 121 is the standard deviation of the extracted noise closest to the one that was put in? Is the
# extracted noise then the noise that was put in, or do two errors cancel?

# %%
best_width = None  # your answer, in samples

# %%
from notebooks import answers_paper

check_answer(
    best_width,
    lambda width: width in answers_paper.best_widths(values[:50_000], widths, true_sd),
    "Compare with the dotted line in the plot above, then compute.",
)

# %% [markdown]
# **2.** Real noise is often slow, for example a thermal drift. The cell makes noise of standard deviation 0.1 whose memory fades
# over 500 samples. Which share of its standard deviation is left after the extraction?

# %%
slow, kicks = np.zeros(100_000), np.random.default_rng(0).standard_normal(100_000)
for t in range(1, len(slow)):
    slow[t] = 0.998 * slow[t - 1] + 0.1 * np.sqrt(1 - 0.998**2) * kicks[t]


def surviving_share(series, width): ...  # your code


# %%
check_answer(
    surviving_share(slow, 25),
    lambda share: abs(share - answers_paper.share_of_sd(slow, 25)) < 1e-3,
    "What is left of a series by the filter of this lesson?",
)
