# %% [markdown]
# # Figure 1: the pipeline
#
# **What the paper says** (section 2): nine numbered steps, whose results "are then combined to produce the final, high-fidelity
# output". Two networks are trained apart: one makes the waveform, one makes the noise.

# %%
import sys

sys.path.insert(0, "..")  # the clone that this notebook lies in

from enhsim_tf.common.plot_style import GENERATED, REAL
from enhsim_tf.reproduce.notebook import claim, drawing, open_experiment, show

experiment = open_experiment()
claim("C2", "C7")

# %%
arrays = show(experiment, "fig01_pipeline")

# %% [markdown]
# Every curve in the boxes is real: one window of held-out time on its way through the networks, and real telemetry of the same times
# beside the result.
#
# ## How it is built
#
# `EnhancedSimulator` combines the packages of the four steps. Each step can also be called by itself:

# %%
simulator = experiment.simulator
coarse = simulator.generate_coarse(num_windows=4, seed=7)  # steps 1 and 2
clean = simulator.enhance(coarse)  # steps 3 and 5
noise = simulator.noise.generate(num_windows=4, seed=8)  # steps 7 to 9
combined = clean + noise

telemetry = simulator.generate(num_windows=4, seed=7)  # all of that in one call
print("windows, samples:", telemetry.shape, telemetry.dtype)

# %% [markdown]
# *What to see:* the two rows of the figure meet only where they are added. The noise is sampled independently of the waveform: a
# satellite that got stuck gets the same noise as a healthy one from the same seed.

# %%
import numpy as np

from enhsim_tf import Degraded

stuck = simulator.generate_clean(num_windows=4, scenario=Degraded("stuck"), seed=7)
added = simulator.generate(num_windows=4, scenario=Degraded("stuck"), seed=7) - stuck
print(f"largest difference between the noises: {np.abs(added - (telemetry - clean)).max():.0e}")
assert np.allclose(added, telemetry - clean, atol=1e-5) and np.abs(stuck - clean).max() > 0.1

# %% [markdown]
# With telemetry of your own, the whole pipeline is one call. It fits the square wave, trains both networks and keeps them:
#
# ```python
# simulator = EnhancedSimulator.fit(telemetry, seed=0)
# simulator.save("model_dir")
# ```

# %% [markdown]
# ## Exercises
#
# 1. A detector needs days, not windows. `simulator.generate_series` makes one long series of windows that overlap by half. Are there
#    seams? Take the steps from sample to sample, average them by their place within half a window, and compare with real telemetry.
# 2. In a real satellite, noise often grows with the signal. What does this pipeline make of such telemetry, and where in the figure
#    would you draw the missing arrow?

# %% [markdown] jp-MarkdownHeadingCollapsed=true
# ## Solution

# %%
half, number = simulator.window // 2, 25_000
real = experiment.data.channels[0].test.values[:number]
series = {"generated": simulator.generate_series(number, seed=3), "real": real}
steps = {name: np.abs(np.diff(values, append=values[-1])) for name, values in series.items()}
by_place = {name: step.reshape(-1, half).mean(axis=0) for name, step in steps.items()}
for name, means in by_place.items():
    print(f"{name:9} mean step {means.mean():.3f}, by place from {means.min():.3f} to {means.max():.3f}")

# %%
alt = "Mean step from sample to sample by its place within half a window, generated and real"
with drawing(alt, height=1.8) as panel:
    for (name, means), color in zip(by_place.items(), (GENERATED, REAL)):
        panel.plot(means, color=color, linewidth=0.8, label=name)
    panel.set(
        xlabel="place within half a window (samples; an edge is at 249)", ylabel="mean step", ylim=(0, None)
    )
    panel.legend(frameon=False)

# %% [markdown]
# <details><summary>What to say about it</summary>
#
# 1. There is no seam: the edge is one place among many. But there is a *rhythm*. Real telemetry is equally rough at every place; the
#    generated series is smooth at some places and rough at others, and repeats this every half window. Blending the windows does not
#    cause it. The generator's windows share a fixed pattern, which notebook 21 extracts and shows.
# 2. The noise would have the same size everywhere, the average over all levels of the signal: its standard deviation would be too
#    large where the signal is small, and too small where it is large. The arrow that is missing leads from *Clean data* (5) into the
#    GAN (8): a generator that is given the signal as a condition.
#
# </details>
