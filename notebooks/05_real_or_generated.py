# %% [markdown]
# # Real or generated? (Figures 5 to 7)
#
# **Question:** if you cannot see the difference between real and generated telemetry, is there none?
#
# - **After this lesson** you can test your own eye honestly, measure what it misses, and find out what a classifier looks at.
# - **You should know** nothing in particular; notebook 09 explains how the noise is made. The quiz comes first; do not read ahead.
# - **Terms:** [AUC](../docs/glossary.md#auc): the probability that a classifier gives a generated window a higher score than a real one,
#   0.5 by chance and 1 if it always does; [effective rank](../docs/glossary.md#effective-rank): the number of dimensions in which a set
#   of windows varies.
#
# **What the paper says** (section 2.3): Figures 5, 6 and 7 are faces made by another system, StyleGAN2, "completely synthetic", to show
# what adversarial networks can do. They cannot be made from this paper's data. The figures here are *counterparts*: real telemetry among
# generated telemetry, for you to tell apart.

# %%
import numpy as np
from lesson_tools import check_answer, claim, drawing, open_pipeline, say, show, verdict

from enhsim_tf.common.plot_style import DASHED, GENERATED, REAL
from enhsim_tf.paper.claims import measured

pipeline, budget = open_pipeline()
claim("C6", "C7")

# %% [markdown]
# ## The quiz
#
# Four of these windows were made by both networks, and four were cut from held-out telemetry. Enter the four letters of the
# generated ones before you read the foot of the figure, for example `"aceg"`.

# %%
show(pipeline, "fig05_real_or_generated")

# %%
my_guess = None  # your answer, four letters

# %%
letters = "abcdefgh"
rng = pipeline.draw("figure 5")  # of the noise, then of the order
pipeline.generate_noise(4, rng)
truly_generated = {letter for letter, number in zip(letters, rng.permutation(8)) if number >= 4}
if my_guess is None:
    print("Not yet answered.")
else:
    print(f"{len(set(my_guess) & truly_generated)} of {len(truly_generated)} right.")

# %% [markdown]
# *What to see:* little at a glance. If three or four of your four letters are right, was it skill? By pure guessing, the number of right
# letters has a hypergeometric distribution: $P(k)=\binom{4}{k}\binom{4}{4-k}/\binom{8}{4}$.

# %%
from math import comb

lucky = sum(comb(4, right) * comb(4, 4 - right) for right in (3, 4)) / comb(8, 4)
say(f"Three or four right by pure guessing: **{lucky:.0%}**. One try of eight windows is no test.")
assert len(truly_generated) == 4

# %% [markdown]
# A thousand windows of each kind, and a classifier that judges windows it was not trained on, are a test. (The boosted trees see
# fourteen features of a window, such as scale and spectrum. C7 asks for less: generated telemetry must not be easier to recognise than
# telemetry that is 10 % larger.)

# %%
(record,) = verdict(pipeline, "C7")
auc = record["measured"]["auc"]
say(f"AUC of the classifier: **{auc:.2f}**. Chance is 0.5.")
assert auc > 0.8

# %% [markdown]
# ## The noise alone

# %%
show(pipeline, "fig06_real_or_generated_noise")

# %% [markdown]
# *What to see:* little at a glance. But what windows share is invisible in a single one. Here are the mean of the four real windows and
# the mean of the four generated ones:

# %%
four_generated = pipeline.generate_noise(4, pipeline.draw("figure 6"))
four_real = pipeline.noise_windows("test", 4, "figure 6, real")
groups = {"real": (four_real, REAL, "-"), "generated": (four_generated, GENERATED, DASHED)}
means = {name: group.mean(axis=0) for name, (group, _, _) in groups.items()}
ratio = {name: means[name].std() / group.std() for name, (group, _, _) in groups.items()}
alt = "Mean of four real and of four generated windows of noise"
title = f"The mean of four windows keeps {ratio['generated']:.2f} of a generated size, {ratio['real']:.2f} of a real one"
with drawing(alt, 2, 1.8, title, sharey=True) as panels:
    for panel, (name, (_, color, _)) in zip(panels, groups.items()):
        panel.plot(means[name], color=color, linewidth=0.6)
        panel.set(title=f"mean of the four {name} windows", xlabel="time (s)")
    panels[0].set_ylabel("noise (dimensionless)")

# %%
correlation = {name: (np.corrcoef(group).sum() - 4) / 12 for name, (group, _, _) in groups.items()}
say(
    f"Standard deviation of the mean, in units of that of a window: **{ratio['real']:.2f}** real (independent windows: 0.50), "
    f"**{ratio['generated']:.2f}** generated. Mean correlation of two windows: **{correlation['real']:.2f}** real, "
    f"**{correlation['generated']:.2f}** generated."
)
assert correlation["generated"] > {"full": 0.3, "smoke": 0.1}[budget] > abs(correlation["real"])

# %% [markdown]
# In how many dimensions do many windows vary? The *effective rank* counts them:

# %%
found = measured("noise resemblance", pipeline)
rank_generated, rank_real = found["rank"], found["real_rank"]
say(
    f"Effective rank of {len(pipeline.noise_windows('test')):,} windows: **{rank_generated:.0f}** generated, **{rank_real:.0f}** real, "
    f"a share of {rank_generated / rank_real:.0%}."
)
assert rank_generated / rank_real < {"full": 0.2, "smoke": 0.6}[budget]

# %% [markdown]
# ## Long stretches
#
# Four windows in a row, each with noise of its own.

# %%
show(pipeline, "fig07_real_or_generated_series")

# %% [markdown]
# *What to see:* all stretches keep the rhythm of the satellite. The next cell makes one of each kind anew, as long as the whole test
# part.

# %%
orbit, size = 480, pipeline.settings.window  # samples
test = pipeline.windows("test")
series = {"real": test["target"].ravel()}
series["generated"] = pipeline.combine(test["coarse"], np.random.default_rng(7)).ravel()
rhythm = [np.corrcoef(row[:-orbit], row[orbit:])[0, 1] for row in series.values()]
say(
    "Correlation of a real and of a generated series with itself one orbit later: "
    + ", ".join(f"{value:.2f}" for value in rhythm)
    + "."
)
assert min(rhythm) > {"full": 0.6, "smoke": -0.5}[budget]

# %% [markdown]
# The noise betrays them all the same: each window brings the shared pattern along.

# %%
from enhsim_tf.paper.noise import extract_noise

repeats = {}
for name, row in series.items():
    rest, _ = extract_noise(row, pipeline.settings.moving_average)
    repeats[name] = np.corrcoef(rest[:-size], rest[size:])[0, 1]
    print(f"{name:10} correlation of the noise with itself one window later: {repeats[name]:.2f}")
assert repeats["generated"] > {"full": 0.3, "smoke": 0.05}[budget] > abs(repeats["real"])

# %% [markdown]
# **Answer.** No. A difference that a glance misses can be the one that a detector sees best (notebook 13).
#
# ## Exercises
#
# **1.** A classifier beats your eye, so what does it look at? The table below has 14 features of each window. Which *single* feature
# separates real from generated noise best, and how well? Set `best_auc` to its AUC (an AUC of 0.1 separates as well as one of 0.9, so
# give the larger of the AUC and 1 − AUC).

# %%
from sklearn.metrics import roc_auc_score

from enhsim_tf.common.window_features import window_features

real = pipeline.noise_windows("test", None)
generated = pipeline.generate_noise(len(real), np.random.default_rng(1))
features, label = window_features(np.concatenate([generated, real])), np.repeat([1, 0], len(real))
names = ["mean", "log sd", "kurtosis", "maximum", "log sd of steps", "lag-1 correlation"]
names += [f"power in band {band}" for band in range(features.shape[1] - len(names))]
best_auc = None  # your answer

# %%
alone = [roc_auc_score(label, column) for column in features.T]
check_answer(
    best_auc,
    lambda answer: abs(answer - max(max(auc, 1 - auc) for auc in alone)) < 0.005,
    "roc_auc_score(label, features[:, 0]) is the AUC of the first feature.",
)

# %% [markdown]
# **2.** How many of $n=100$ windows, half of them generated, must you classify correctly before you may claim to see a difference, at a
# chance of error of 5 %? Treat your answers as independent guesses.

# %%
needed = None  # your answer: the smallest number of right answers that pure guessing reaches in at most 5 % of tries

# %%
from scipy.stats import binom

check_answer(
    needed,
    lambda number: binom.sf(number - 1, 100, 0.5) <= 0.05 < binom.sf(number - 2, 100, 0.5),
    "The number of right guesses is binomial with n = 100 and p = 1/2.",
)

# %% [markdown]
# ## Solution
#
# <details><summary>1. What the classifier looks at</summary>
#
# ```python
# aucs = [roc_auc_score(label, column) for column in features.T]
# best = max(range(len(aucs)), key=lambda number: abs(aucs[number] - 0.5))
# best_auc = max(aucs[best], 1 - aucs[best])
# print(f"{names[best]}: AUC {best_auc:.2f}")
# ```
#
# Which frequencies does the best feature describe? The moving average leaves a little of the 2-minute wave in real noise (notebook 08), and
# notebook 21 looks for it in generated noise.
#
# </details>

# %% [markdown]
# <details><summary>2. How many right answers</summary>
#
# ```python
# needed = next(number for number in range(101) if binom.sf(number - 1, 100, 0.5) <= 0.05)
# print(needed)
# ```
#
# About $n/2+1/2+0.82\sqrt{n}$, rounded up. In the quiz above, all four letters must be right.
#
# </details>
