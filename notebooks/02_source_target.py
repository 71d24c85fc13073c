# %% [markdown]
# # Source and target (Figures 2 and 14)
#
# **Question:** what does a crude simulator know about the signal, and what does it not know?
#
# - **After this lesson** you can write the paper's coarse simulator, compute its error in closed form, and say how many different
#   windows it can ever produce.
# - **You should know** sines, mean and variance.
# - **Terms:** [coarse simulator](../docs/glossary.md#coarse-simulator), [window](../docs/glossary.md#window);
#   *enhancer*: the network that turns the square waves into a waveform (notebook 03);
#   [NRMSE](../docs/glossary.md#nrmse): $\sqrt{\mathrm{mean}[(\hat x-x)^2]}\,/\,\mathrm{sd}(x)$ for an estimate $\hat x$ of a signal $x$.
#
# **What the paper says** (sections 1, 2 and 2.1): a coarse simulation is enough to start from, since "a square wave can be used for
# nearly any periodic waveform". The signals are sines with periods of 8 and 2 minutes. Figure 2 shows the coarse source and the target
# that the enhancer has to make of it.

# %%
import numpy as np
from lesson_tools import check_answer, drawing, open_pipeline, say, show

from enhsim_tf.common.plot_style import COARSE, DASHED, REAL

pipeline, budget = open_pipeline()

# %% [markdown]
# ## The simulator and the truth
#
# The truth is a sum of two sines: the orbit (480 s) and the rotation (120 s) of a satellite. The simulator knows both periods and draws
# a square wave for each: high where the sine is positive, low where it is negative.

# %%
periods, amplitudes = (480.0, 120.0), (0.5, 0.25)


def true_signal(time_s):
    return sum(A * np.sin(2 * np.pi * time_s / P) for P, A in zip(periods, amplitudes))


def square_waves(time_s):
    return sum(np.where(time_s % P < P / 2, A, -A) for P, A in zip(periods, amplitudes))


time_s = np.arange(10 * 480.0)  # ten orbits, one sample a second
coarse, truth = square_waves(time_s), true_signal(time_s)

# %% [markdown]
# The package has the same simulator. Both must give the same values, to the bit:

# %%
from enhsim_tf import SquareWave, SquareWaveSimulator

simulator = SquareWaveSimulator([SquareWave(P, low=-A, high=A) for P, A in zip(periods, amplitudes)])
np.testing.assert_array_equal(simulator(time_s), coarse)
np.testing.assert_allclose(pipeline.simulator(time_s), coarse)

# %% [markdown]
# The telemetry is the truth with white noise. It is written to a store once, and every later step reads it from there (the paper's figure
# 14, which its source has commented out):

# %%
show(pipeline, "fig14_telemetry_store")

# %% [markdown]
# Training pairs are windows of 500 samples, cut from the telemetry at random times. The source is simulated for exactly the same times.

# %%
show(pipeline, "fig02_source_target")

# %% [markdown]
# *What to see:* the source is right about *when* and wrong about *how*. It switches exactly where a sine crosses zero, and is wrong in
# between.

# %%
for P, A in zip(periods, amplitudes):
    wave, sine = np.where(time_s % P < P / 2, A, -A), np.sin(2 * np.pi * time_s / P)
    between = time_s % (P / 2) != 0  # at a crossing itself the sine has no sign
    assert (wave[between] * sine[between] > 0).all()

# %% [markdown]
# ## How wrong?
#
# Over half a period, a square wave of levels $\pm A$ differs from a sine of amplitude $A$ by $A(1-\sin x)$. The mean square of that is
# $A^2\left(\tfrac32-\tfrac4\pi\right)$, and the variance of the sine is $A^2/2$. So the NRMSE is $\sqrt{3-8/\pi}$ for each wave, and
# also for their sum if their errors are uncorrelated.

# %%
from enhsim_tf.common import measures


def nrmse(estimate, truth):
    return np.sqrt(np.mean((estimate - truth) ** 2)) / truth.std()


error, closed_form = nrmse(coarse, truth), np.sqrt(3 - 8 / np.pi)
np.testing.assert_allclose(error, measures.nrmse(coarse, truth), rtol=1e-9)
say(f"NRMSE of the simulator: **{error:.4f}**; in closed form **{closed_form:.4f}**.")
assert abs(error - closed_form) < 0.01

# %%
x = np.linspace(0, 1, 100_001)
alt = "The NRMSE of a square wave for a sine, by the height of the square wave"
best_height = 2 / np.pi
title = f"The best square wave has {best_height:.2f} of the height of the sine"
heights = np.linspace(0, 1.2, 121)
by_height = [np.sqrt(np.mean((h - np.sin(np.pi * x)) ** 2) * 2) for h in heights]
with drawing(alt, 2, 2.1, title) as panels:
    panels[0].plot(x, np.sin(np.pi * x), color=REAL, label="sine")
    panels[0].plot(x, np.ones_like(x), color=COARSE, label="height 1")
    best = np.full_like(x, best_height)
    panels[0].plot(x, best, color=COARSE, linestyle=DASHED, label=f"height {best_height:.2f}")
    panels[0].set(xlabel="time (half periods)", ylabel="value (amplitudes)", ylim=(0, 1.3))
    panels[0].legend(frameon=False, ncols=3, loc="upper center")
    panels[1].plot(heights, by_height, color=COARSE)
    panels[1].set(xlabel="height of the square wave (amplitudes)", ylabel="NRMSE", ylim=(0, None))

# %% [markdown]
# *What to see:* the error has its minimum where the height is the mean of the sine over half a period, $2/\pi$. Rescaling the levels cannot
# bring the error below this minimum; the rest is shape.

# %%
say(f"The error on the right is smallest at a height of **{heights[np.argmin(by_height)]:.2f}**.")
assert abs(heights[np.argmin(by_height)] - 2 / np.pi) < 0.01

# %% [markdown]
# ## How many different windows are there?
#
# One more thing hides in the figure. Both periods are whole numbers of samples, and the longer is a multiple of the shorter, so
# the simulator repeats itself after 480 samples:

# %%
windows = np.lib.stride_tricks.sliding_window_view(square_waves(np.arange(20_000.0)), 500)
distinct = len({window.tobytes() for window in windows})
say(f"**{distinct}** different windows among {len(windows):,}.")
assert distinct == 480

# %% [markdown]
# However much telemetry is recorded, the enhancer only ever sees these inputs. "Held out" in this example means other noise and other
# times, not other inputs. A real channel, whose period is no whole number of samples, may be harder.
#
# **Answer.** The simulator knows *when* each of the two sines changes its sign and how high it rises, and nothing of what lies between: its
# error is 0.67 standard deviations of the signal. It can produce only 480 different windows.
#
# ## Exercises
#
# **1.** What is the smallest NRMSE that a square wave of the right period can have for a sine? Give a formula.

# %%
smallest_nrmse = None  # your answer

# %%
from notebooks import answers_paper

check_answer(
    smallest_nrmse,
    lambda answer: abs(answer - answers_paper.smallest_nrmse()) < 1e-5,
    "At the best height, the mean square error over half a period is the variance of the sine there.",
)

# %% [markdown]
# **2.** Another satellite rotates in 100 s instead of 120 s, on the same orbit of 480 s. How many different windows does its
# simulator have? And with a rotation of 120.5 s? Complete the function.


# %%
def num_distinct(orbit_s, rotation_s): ...  # your code: count samples; a period may end in half a second


# %%
check_answer(
    num_distinct(480, 100),
    lambda number: number == answers_paper.num_distinct(480, 100) and num_distinct(480, 120.5) > 100_000,
    "After how many samples do both waves start again together?",
)
