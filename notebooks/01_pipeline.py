# %% [markdown]
# # The pipeline (Figure 1)
#
# **Question:** how do a crude simulator and two networks become realistic telemetry, also for faults that nobody has recorded?
#
# - **After this lesson** you can name the nine steps of the paper, compute a window of telemetry step by step, and say what the pipeline
#   assumes about noise.
# - **You should know** nothing in particular; every step has a lesson of its own.
# - **Terms:** [coarse simulator](../docs/glossary.md#coarse-simulator), [enhancer](../docs/glossary.md#enhancer),
#   [generator](../docs/glossary.md#generator-and-discriminator),
#   [degraded mode](../docs/glossary.md#degraded-mode-severity-onset); *latent vector*: the random numbers that a generator turns into
#   noise.
#
# **What the paper says** (section 2): nine numbered steps, whose results "are then combined to produce the final, high-fidelity
# output". Two networks are trained apart: one makes the waveform, one makes the noise.

# %%
import numpy as np
from lesson_tools import check_answer, claim, drawing, open_experiment, say, show

from enhsim_tf.common.plot_style import COARSE, ENHANCED, GENERATED

experiment = open_experiment()
claim("C2", "C7")

# %%
arrays = show(experiment, "fig01_pipeline")

# %% [markdown]
# Every curve in the boxes was computed: one window of held-out time on its way through the networks, and real telemetry of the same times
# beside the result. Solid arrows run whenever telemetry is made, dashed ones only in training.
#
# ## Step by step
#
# Both networks are plain Keras models. A window needs four lines:

# %%
simulator = experiment.simulator  # holds the coarse simulator and the networks, trained
enhancer, generator = simulator.enhancer, simulator.noise.generator

coarse = simulator.generate_coarse(num_windows=4, seed=7)  # steps 1 and 2: square waves
clean = enhancer.predict(coarse, verbose=0)  # steps 3 and 5: the waveform
latent = np.random.default_rng(8).standard_normal((4, 16), "float32")  # step 7: 16 random numbers a window
noise = generator.predict(latent, verbose=0)[:, :, 0]  # steps 8 and 9: the noise
telemetry = clean + noise  # combined

# %% [markdown]
# The package wraps these steps. It must give the same numbers; sums of thousands of 32-bit products differ in the sixth decimal:

# %%
np.testing.assert_allclose(simulator.enhance(coarse), clean, atol=1e-5)
np.testing.assert_allclose(simulator.noise.generate(num_windows=4, seed=8), noise, atol=1e-5)
say(f"{telemetry.shape[0]} windows of {telemetry.shape[1]} samples, as {telemetry.dtype}.")

# %%
alt = "One window on its way through the pipeline: coarse, enhanced, noise and their sum"
title = "Waveform and noise are made apart, and meet only where they are added"
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
# *What to see:* in the figure, the two rows meet only in the box *combined*. The noise is sampled independently of the waveform. A
# satellite that got stuck therefore gets the same noise as a healthy one from the same seed:

# %%
from enhsim_tf import Degraded

added = {}
for name, fault in {"healthy": None, "stuck": Degraded("stuck")}.items():
    waveform = simulator.generate_clean(num_windows=4, scenario=fault, seed=7)
    added[name] = simulator.generate(num_windows=4, scenario=fault, seed=7) - waveform
difference = np.abs(added["healthy"] - added["stuck"]).max()
say(
    f"Largest difference between the noise of the healthy and of the stuck satellite: **{difference:.0e}**, which is rounding."
)
assert difference < 1e-5

# %% [markdown]
# With telemetry of your own, the pipeline is one call. It fits the coarse simulator, and chooses the enhancer and the noise model by
# held-out telemetry:
#
# ```python
# simulator = EnhancedSimulator.fit(telemetry, seed=0)
# simulator.save("model_dir")
# ```
#
# ## Exercises
#
# **1.** A detector needs days, not windows. `simulator.generate_series` makes one long series of windows that overlap by half. Has it
# seams? Complete the function: the mean size of the step from sample to sample, at each of the 250 places within half a window.

# %%
half = simulator.window // 2
series = {
    "generated": simulator.generate_series(25_000, seed=3),
    "real": experiment.data.channels[0].test.values[:25_000],
}


def mean_step_by_place(values):
    steps = np.abs(np.diff(values, append=values[-1]))
    # your code: the mean of steps[0], steps[250], steps[500], ...; of steps[1], steps[251], ...; and so on
    return None


# %%
def expected(values):
    steps = np.abs(np.diff(values, append=values[-1]))
    return [steps[place::half].mean() for place in range(half)]


check_answer(
    mean_step_by_place(series["real"]),
    lambda found: np.allclose(found, expected(series["real"])),
    "steps.reshape(-1, half) has a row for each half window.",
)

# %% [markdown]
# **2.** In a real satellite, noise often grows with the signal. Which correlation does this pipeline give between the size of the waveform
# and the size of the noise, $\mathrm{corr}(|\mathrm{clean}|,|\mathrm{noise}|)$? Predict a round number, then compute it.

# %%
correlation = None  # your answer

# %%
many = simulator.generate_clean(num_windows=1_000, seed=1)
its_noise = simulator.generate(num_windows=1_000, seed=1) - many
check_answer(
    correlation,
    lambda answer: abs(answer - np.corrcoef(np.abs(many).ravel(), np.abs(its_noise).ravel())[0, 1]) < 0.05,
    "Does the generator get to see the waveform?",
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
#     return steps.reshape(-1, half).mean(axis=0)
#
#
# with drawing("Mean step by place within half a window", height=1.8, title="No seam, but a rhythm") as panel:
#     for name, color in {"generated": GENERATED, "real": REAL}.items():
#         panel.plot(mean_step_by_place(series[name]), color=color, linewidth=0.8, label=name)
#     panel.set(xlabel="place within half a window (s; an edge is at 249)", ylabel="mean step", ylim=(0, None))
#     panel.legend(frameon=False)
# ```
#
# There is no seam: the edge is one place among many. But there is a *rhythm*. Real telemetry is equally rough at every place; the
# generated series is smooth at some places and rough at others, and repeats this every half window. Blending the windows does not cause
# it. The windows of the generator share a fixed pattern, which notebook 21 extracts and shows.
#
# </details>

# %% [markdown]
# <details><summary>2. Noise that grows with the signal</summary>
#
# ```python
# correlation = 0
# ```
#
# The noise has the same size everywhere, the average over all levels of the signal: too large where the signal is small, too small
# where it is large. The arrow that is missing in the figure leads from *clean data* (5) into the GAN (8): a generator that is given the
# signal as a condition.
#
# </details>
