# %% [markdown]
# # Figures 5 to 7: real or generated?
#
# **What the paper says** (section 2.3): Figures 5, 6 and 7 are faces made by another system, StyleGAN2, "completely synthetic", to show
# what adversarial networks can do. They show nothing of this paper's data and cannot be made from it. These are *counterparts* in the
# paper's own domain, not reproductions: real telemetry among generated telemetry, for you to tell apart.

# %%
import sys

sys.path.insert(0, "..")  # the clone that this notebook lies in

import numpy as np

from enhsim_tf.reproduce.notebook import claim, open_experiment, show, verdict

experiment = open_experiment()
claim("C6", "C7")

# %% [markdown]
# ## Windows of telemetry
#
# `simulator.generate` beside windows cut from held-out telemetry, in random order. Guess before you read the foot of the figure.

# %%
windows = show(experiment, "fig05_real_or_generated")

# %% [markdown]
# *What to see:* no window that stands out at a glance. If you found three or four of the four, was it skill?

# %%
from math import comb

lucky = sum(comb(4, right) * comb(4, 4 - right) for right in (3, 4)) / comb(8, 4)
print(f"three or four right by pure guessing: {lucky:.0%}")
assert windows["is_generated"].sum() == 4 and round(lucky, 2) == 0.24

# %% [markdown]
# One try of eight windows is no test. A thousand windows, a classifier and held-out folds are:

# %%
(record,) = verdict(experiment, "C7")
print(f"a classifier separates sum and telemetry with an AUC of {record['value']:.2f}; chance is 0.5")
assert record["value"] > 0.8

# %% [markdown]
# ## Windows of noise

# %%
noise = show(experiment, "fig06_real_or_generated_noise")

# %% [markdown]
# *What to see:* again nothing at a glance. Draw the generated ones over each other: they begin with small values and rise and fall
# together, since all share the same pattern. With that in mind, the eye finds them.

# %%
rows, is_generated = noise["rows"], noise["is_generated"]
shared = {}
for name, four in {"generated": rows[is_generated], "real": rows[~is_generated]}.items():
    shared[name] = (np.corrcoef(four).sum() - 4) / 12  # the twelve pairs of two different windows
    begin = four[:, :60].std() / four.std()
    print(
        f"{name:9} correlation of two windows {shared[name]:5.2f}, sd of the first minute {begin:.2f} of all"
    )
assert shared["generated"] > {"full": 0.3, "smoke": 0.1}[experiment.settings.budget] > abs(shared["real"])
quiet = rows[is_generated][:, :60].std() / rows[is_generated].std()
assert experiment.settings.budget == "smoke" or quiet < 0.85

# %% [markdown]
# *What to see:* the effective ranks under the title differ greatly. Notebook 21 explains them.

# %%
share = float(noise["rank_generated"] / noise["rank_real"])
print(f"effective rank of generated noise as a share of the real: {share:.0%}")
assert share < {"full": 0.2, "smoke": 0.6}[experiment.settings.budget]  # few windows have little rank to lose

# %% [markdown]
# ## Long stretches
#
# `simulator.generate_series` fades overlapping windows into each other.

# %%
series = show(experiment, "fig07_real_or_generated_series")

# %% [markdown]
# *What to see:* no stretch has seams, and all keep the rhythm of the satellite for as long as you look.

# %%
from enhsim_tf.realism.measures import autocorrelation

rhythm = [autocorrelation(row[None], 480)[480] for row in series["rows"]]
print("correlation of each stretch with itself one orbit later:", np.round(rhythm, 2))
assert min(rhythm) > {"full": 0.6, "smoke": -0.5}[experiment.settings.budget]

# %% [markdown]
# What no seam betrays, the noise does. Each window brings the pattern that all of them hold, so the noise of a generated series repeats
# itself every half window, however long the series is:

# %%
from enhsim_tf.noise.extraction import extract_noise

repeats = []
for row, is_generated in zip(series["rows"], series["is_generated"]):
    rest, _ = extract_noise(row, experiment.settings.noise.moving_average)
    repeats.append(np.corrcoef(rest[:-250], rest[250:])[0, 1])
    print("generated" if is_generated else "real     ", f"correlation after half a window: {repeats[-1]:.2f}")
is_generated = np.array(series["is_generated"])
least = {"full": 0.3, "smoke": 0.05}[experiment.settings.budget]
assert np.min(np.array(repeats)[is_generated]) > least > np.max(np.array(repeats)[~is_generated])

# %% [markdown]
# ## Exercises
#
# 1. A classifier beats your eye, so what does it look at? Rank the features of `two_sample.window_features` by how well each one alone
#    separates generated from real noise.
# 2. How many windows would you have to classify, and how many of them correctly, before you may claim to see a difference?

# %% [markdown] jp-MarkdownHeadingCollapsed=true
# ## Solution

# %%
from sklearn.metrics import roc_auc_score

from enhsim_tf.realism.window_features import window_features

real = experiment.data.noise_windows("test", None)
generated = experiment.simulator.noise.generate(len(real), seed=1)
features = window_features(np.concatenate([generated, real]))
is_generated = np.repeat([1, 0], len(real))
alone = np.array([roc_auc_score(is_generated, column) for column in features.T])

# %%
names = ["mean", "log sd", "kurtosis", "maximum", "log sd of steps", "lag-1 correlation"]
names += [f"power in band {band}" for band in range(len(alone) - len(names))]
for best in np.argsort(-np.abs(alone - 0.5))[:4]:
    print(f"{names[best]:18} AUC {alone[best]:.2f}")
assert np.abs(alone - 0.5).max() > 0.25

# %% [markdown]
# <details><summary>What to say about it</summary>
#
# 1. (An AUC of 0 separates as well as one of 1.) At full budget a single feature is enough: the power in the band of four to seven
#    cycles a window. The 2-minute wave lies there, of which the moving average leaves a little in the real noise (notebook 08), in
#    every window the same amount. The generator misses it.
# 2. For a chance of error of 5 % in a test of $n$ windows, half of them generated, you need about $n/2+0.8\sqrt n$ right: 8 windows ask
#    for all, 100 windows for 58 to 59. The eye's failure on eight windows says little about it, and its success would too.
#
# </details>
