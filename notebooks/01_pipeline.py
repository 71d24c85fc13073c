# %% [markdown]
# # The pipeline (Figure 1)
#
# **Question:** how do a crude simulator and two networks make telemetry, and how fast?
#
# - **After this lesson** you can name the nine steps of the paper, and compute a window of telemetry step by step.
# - **You should know** NumPy, and what a trained Keras model is; every step has a lesson of its own.
# - **Terms:** *telemetry*: the measurements that a vehicle sends. *Window*: here 500 samples in a row, one a second. *Coarse simulator*: a
#   simple model, here a sum of square waves. *Enhancer*: the network that turns square waves into a waveform. *Generator*: the network that
#   turns random numbers, the *latent vector*, into noise. *GAN*: the generator together with the network that trains it. *Moving average*:
#   the mean of the samples around each sample. *Nominal*: without a fault.
#
# **What the paper says** (section 2): nine numbered steps, whose results "are then combined to produce the final, high-fidelity
# output". Two networks are trained apart: one makes the waveform, one makes the noise.

# %%
import numpy as np
from lesson_tools import check_answer, claim, degraded, drawing, open_pipeline, say, show, verdict

from enhsim_tf.common.plot_style import COARSE, ENHANCED, GENERATED
from enhsim_tf.paper.noise import extract_noise

pipeline, budget = open_pipeline()

# %%
show(pipeline, "fig01_pipeline")

# %% [markdown]
# The curves in the boxes were computed with seed 0: one window, of times on which nothing was trained, on its way through the networks, and
# real telemetry of the same times beside the result. Solid arrows run whenever telemetry is made, dashed ones only in training.
#
# ## Step by step
#
# Both networks are plain Keras models. They learn from telemetry of a vehicle or a fine simulator (step 4): the enhancer from the
# telemetry, the generator from the noise that is left when a moving average over 25 samples is subtracted (step 6). The example is a
# satellite with an orbit of 480 s and a rotation of 120 s, whose amplitudes are 0.5 and 0.25. The code makes four windows. Its last lines
# are steps 4 and 6, which only training needs:

# %%
enhancer, generator = pipeline.enhancer, pipeline.generator

held_out = pipeline.windows("test", 4, "lesson")
time_s = pipeline.parts["test"].time[held_out["start"][:, None] + np.arange(500)]
orbit, rotation = (np.where(time_s % P < P / 2, A, -A) for P, A in ((480.0, 0.5), (120.0, 0.25)))
coarse = (orbit + rotation).astype("float32")  # steps 1 and 2: square waves
clean = enhancer.predict(coarse, verbose=0)  # steps 3 and 5: the waveform
latent = np.random.default_rng(8).standard_normal((4, 16), "float32")  # step 7: 16 random numbers a window
noise = generator.predict(latent, verbose=0)[:, :, 0]  # steps 8 and 9: the noise
telemetry = clean + noise  # combined

recorded = pipeline.parts["train"].values.astype(float)  # step 4: real telemetry
extracted = recorded[12:-12] - np.convolve(recorded, np.ones(25) / 25, "valid")  # step 6: its noise

# %% [markdown]
# The package wraps these steps. It must give the same numbers up to rounding:

# %%
np.testing.assert_array_equal(held_out["coarse"], coarse)
np.testing.assert_allclose(pipeline.enhance(coarse), clean, atol=1e-5)
np.testing.assert_allclose(pipeline.generate_noise(4, np.random.default_rng(8)), noise, atol=1e-5)
np.testing.assert_allclose(extract_noise(recorded, 25)[0], extracted, atol=1e-5)
say(f"{telemetry.shape[0]} windows of {telemetry.shape[1]} samples, as {telemetry.dtype}.")

# %%
alt = "One window on its way through the pipeline: coarse, enhanced, noise and their sum"
title = "Waveform and noise are made apart and meet in the sum"
parts = {
    "coarse": (coarse, COARSE),
    "enhanced": (clean, ENHANCED),
    "noise": (noise, GENERATED),
    "sum": (telemetry, GENERATED),
}
with drawing(alt, 4, 1.6, title, sharey=True) as panels:
    for panel, (name, (windows, color)) in zip(panels, parts.items()):
        panel.plot(windows[0], color=color, linewidth=0.7)
        panel.set(title=name, xlabel="time (s)")
    panels[0].set_ylabel("value (dimensionless)")

# %% [markdown]
# *What to see:* only the last panel holds the work of both networks. A satellite that got stuck and no longer turns therefore gets the same
# noise as a healthy one from the same seed:

# %%
added = {}
for mode, severity in {"nominal": 0.0, "stuck": 1.0}.items():
    source, _ = degraded(pipeline, mode, severity)
    added[mode] = pipeline.combine(source, np.random.default_rng(7)) - pipeline.enhance(source)
difference = np.abs(added["nominal"] - added["stuck"]).max()
say(
    f"Largest difference between the noise of the healthy and of the stuck satellite: **{difference:.0e}**, which is rounding."
)
assert difference < 1e-5

# %% [markdown]
# The paper promises speed (C2). Nobody measured memory, so *reproduced* covers speed only. Two limits compare with simulators of a
# [battery](../studies/battery/README.md). The last one, time against square waves, is this project's and does not decide: any network is
# slower than one line of NumPy, here by far. A claim is *reproduced* if all other limits hold, and *partly* if only those not marked *to
# hold in full* do ([verdict](../docs/glossary.md#verdict)).

# %%
claim("C2")
_ = verdict(pipeline, "C2")

# %% [markdown]
# `python -m enhsim_tf.reproduce --telemetry my.csv` runs these steps on telemetry of your own.
#
# **Answer.** One network turns square waves into a waveform, another turns random numbers into noise, and the two are added, much faster
# than real time. Whether the result is realistic is the question of notebooks 05 and 13, and whether the waveform of a fault is right, of
# notebook 23.
#
# ## Exercises
#
# **1.** A detector needs days, not windows. The next cell puts generated windows of noise end to end on the enhanced signal. Are the edges
# of the windows visible in the series? Complete the function: the mean size of the step from sample to sample, at each of the 500 places
# within a window. Then plot it for both series: where should an edge show?

# %%
window = pipeline.settings.window
real = pipeline.windows("test")
series = {
    "generated": pipeline.combine(real["coarse"], np.random.default_rng(3)).ravel(),
    "real": real["target"].ravel(),
}


def mean_step_by_place(values):
    steps = np.abs(np.diff(values, append=values[-1]))
    # your code: the mean of steps[0], steps[500], steps[1_000], ...; of steps[1], steps[501], ...; and so on
    return None


# %%
from notebooks import answers_paper

check_answer(
    mean_step_by_place(series["real"]),
    lambda found: np.allclose(found, answers_paper.mean_step_by_place(series["real"], window)),
    "Place 0 of every window is at 0, 500, 1,000, ...",
)

# %% [markdown]
# **2.** In telemetry, noise may grow with the signal. Which correlation does this pipeline give between the size of the waveform and the
# size of the noise, $\mathrm{corr}(|\mathrm{clean}|,|\mathrm{noise}|)$? Predict it from the diagram, then compute it for the windows
# `real["coarse"]`.

# %%
correlation = None  # your answer

# %%
check_answer(
    correlation,
    lambda answer: abs(answer - answers_paper.correlation_of_sizes(pipeline)) < 0.05,
    "`pipeline.combine` returns clean plus noise; take the sizes of all samples of all windows.",
)

# %% [markdown]
# ## Solution
#
# <details><summary>1. Seams</summary>
#
# ```python
# from enhsim_tf.common.plot_style import REAL
#
#
# def mean_step_by_place(values):
#     steps = np.abs(np.diff(values, append=values[-1]))
#     return steps.reshape(-1, window).mean(axis=0)
#
#
# with drawing("Mean step by place within a window", height=1.8, title="Hardly a seam, but a rhythm") as panel:
#     for name, color in {"generated": GENERATED, "real": REAL}.items():
#         panel.plot(mean_step_by_place(series[name]), color=color, linewidth=0.8, label=name)
#     panel.set(xlabel="place within a window (s; an edge is at 499)", ylabel="mean step", ylim=(0, None))
#     panel.legend(frameon=False)
# ```
#
# The edge is one place among many. But there is a *rhythm*. Real telemetry is equally rough at every place; the generated series is smooth
# at some places and rough at others, and repeats this in every window. The windows of the generator share a fixed pattern, which notebook
# 21 extracts and shows.
#
# </details>

# %% [markdown]
# <details><summary>2. Noise that grows with the signal</summary>
#
# ```python
# clean = pipeline.enhance(real["coarse"])
# noise = pipeline.combine(real["coarse"], np.random.default_rng(5)) - clean
# correlation = np.corrcoef(np.abs(clean).ravel(), np.abs(noise).ravel())[0, 1]
# print(f"{correlation:.3f}")
# ```
#
# About 0: the noise is drawn independently of the waveform. Where real noise grows with the signal, the generated noise is therefore too
# large at small levels and too small at large ones. The arrow that is missing in the figure leads from *clean data* (5) into the GAN (8): a
# generator that is given the signal as a condition.
#
# </details>
