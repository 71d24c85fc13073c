# %% [markdown]
# # Figure 2: source and target
#
# **What the paper says** (sections 1, 2 and 2.1): a coarse simulation is enough to start from, since "a square wave can be used for
# nearly any periodic waveform". The signals are sines with periods of 8 and 2 minutes. Figure 2 shows the coarse source and the target
# that the enhancer has to make of it.

# %%
import sys

sys.path.insert(0, "..")  # the clone that this notebook lies in

import numpy as np

from enhsim_tf.reproduce.notebook import claim, open_experiment, show

experiment = open_experiment()
claim("C1")

# %% [markdown]
# ## How it is built
#
# The simulator is a sum of square waves, the truth a sum of sines of the same periods and amplitudes:

# %%
from enhsim_tf import SquareWave, SquareWaveSimulator
from enhsim_tf.reproduce.paper.signals import sines

orbit = SquareWave(period_s=480, low=-0.5, high=0.5)
rotation = SquareWave(period_s=120, low=-0.25, high=0.25)
simulator = SquareWaveSimulator([orbit, rotation])
assert simulator.get_config() == experiment.data.channels[0].coarse.get_config()

time_s = np.arange(10 * 480.0)  # ten orbits
coarse, truth = simulator(time_s), sines(time_s, periods_s=(480, 120), amplitudes=(0.5, 0.25))

# %% [markdown]
# Training pairs are cut from the series at random offsets, 500 samples each; the source is simulated for the same times:

# %%
pairs = show(experiment, "fig02_source_target")

# %% [markdown]
# *What to see:* the source is right about *when* and wrong about *how*: it switches exactly where the sines cross zero, and is wrong in
# between by an amount that can be computed.

# %%
from enhsim_tf.realism.measures import nrmse

for wave in simulator.waves:
    between = time_s % (wave.period_s / 2) != 0  # at a crossing itself the sine has no sign
    assert (wave(time_s)[between] * np.sin(2 * np.pi * time_s / wave.period_s)[between] > 0).all()
error, closed_form = nrmse(coarse, truth), np.sqrt(3 - 8 / np.pi)
print(f"error in standard deviations of the truth: {error:.4f}, in closed form {closed_form:.4f}")
assert abs(error - closed_form) < 0.01

# %% [markdown]
# One more thing hides in the figure, and later matters more than any other. Both periods are whole numbers of samples, and the longer
# is a multiple of the shorter, so the simulator repeats itself after 480 samples:

# %%
from enhsim_tf.telemetry.windows import cut_windows

windows = cut_windows(simulator(np.arange(20_000.0)), np.arange(19_000), 500)
distinct = len(np.unique(windows, axis=0))
print(f"{distinct} different windows among {len(windows):,}")
assert distinct == 480

# %% [markdown]
# However much telemetry is recorded, the enhancer only ever sees these inputs. "Held out" in this example means other noise and other
# times, not other inputs. A real channel, whose period is no whole number of samples, is harder.

# %% [markdown]
# ## Exercises
#
# 1. Derive the closed form above: the error of a square wave of levels $\pm A$ for a sine of amplitude $A$, in standard deviations of
#    the sine.
# 2. A square wave as high as the sine is not the best one. Which levels make the error smallest, and what is it then? Would it change
#    what the enhancer can learn?

# %% [markdown] jp-MarkdownHeadingCollapsed=true
# ## Solution
#
# <details><summary>1. The closed form</summary>
#
# Over half a period the error is $A(1-\sin x)$, so its mean square is
# $A^2\,\left(1-2\cdot\tfrac{2}{\pi}+\tfrac12\right)=A^2\left(\tfrac32-\tfrac4\pi\right)$. The variance of the sine is $A^2/2$. The
# ratio is $3-8/\pi$, and the error its root. The two waves have the same ratio, and their errors are nearly uncorrelated over an orbit,
# so the sum has it too, up to the small difference printed above.
#
# </details>

# %% [markdown]
# <details><summary>2. The best levels</summary>
#
# The best constant for half a period is the mean of the sine there, $2A/\pi$. Then the mean square error is
# $A^2\left(\tfrac12-\tfrac4{\pi^2}\right)$, in units of the variance $1-8/\pi^2$. The cell below checks it. For the enhancer nothing
# changes: the first Dense layer can scale its input as it likes. What the enhancer reads is *when* the levels switch.
#
# </details>

# %%
waves = [SquareWave(480, low=-1 / np.pi, high=1 / np.pi), SquareWave(120, low=-0.5 / np.pi, high=0.5 / np.pi)]
best = nrmse(SquareWaveSimulator(waves)(time_s), truth)
print(f"error with the best levels: {best:.4f}, in closed form {np.sqrt(1 - 8 / np.pi**2):.4f}")
assert best < error and abs(best - np.sqrt(1 - 8 / np.pi**2)) < 0.01
