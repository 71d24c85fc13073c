# %% [markdown]
# # Real or generated? (Figures 5 to 7)
#
# **Question:** if you cannot see the difference between real and generated telemetry, is there none?
#
# - **After this lesson** you can test your own eye honestly, measure what it misses, and find out what a classifier looks at.
# - **You should know** what a correlation and a Fourier transform are; the quiz needs neither. Notebook 09 explains how the noise is made.
#   The quiz comes first; do not read ahead.
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
from enhsim_tf.paper.claims import noise_resemblance

pipeline, budget = open_pipeline()
claim("C7")

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
# A thousand windows of each kind, and a classifier that judges windows it was not trained on, are a test. It sees twelve numbers of each
# window, its *features*: the mean, the size (the logarithm of the standard deviation), the size of the steps from sample to sample, the
# correlation of neighbouring samples (*lag-1 correlation*), and the power in eight bands of frequencies.


# %%
def features_of(windows):
    centred = windows.astype(float) - windows.mean(axis=1, keepdims=True, dtype=float)
    size, steps = np.log(centred.std(axis=1)), np.log(np.diff(centred).std(axis=1))
    lag_one = np.mean(centred[:, 1:] * centred[:, :-1], axis=1) / centred.var(axis=1)
    power = np.abs(np.fft.rfft(centred, axis=1)) ** 2
    edges = [1, 2, 4, 8, 16, 32, 63, 126, 251]  # in cycles per window
    bands = [np.log(power[:, low:high].mean(axis=1)) for low, high in zip(edges[:-1], edges[1:])]
    return np.stack([windows.mean(axis=1), size, steps, lag_one, *bands], axis=1)


# %% [markdown]
# The classifier sums small decision trees (*gradient boosting*). It learns four fifths of the time and judges the last one, for each fifth
# in turn:

# %%
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.metrics import roc_auc_score
from sklearn.model_selection import KFold, cross_val_predict

test = pipeline.windows("test")
generated = pipeline.combine(test["coarse"], np.random.default_rng(5))
pairs = np.stack([features_of(generated), features_of(test["target"])], axis=1)  # of the same times
features, is_generated = pairs.reshape(-1, pairs.shape[2]), np.tile([1, 0], len(pairs))
trees = HistGradientBoostingClassifier(random_state=0)
scores = cross_val_predict(trees, features, is_generated, cv=KFold(5), method="predict_proba")[:, 1]
auc = roc_auc_score(is_generated, scores)
say(f"AUC of the classifier: **{auc:.2f}**. Chance is 0.5.")
assert auc > {"full": 0.8, "smoke": 0.5}[budget]

# %% [markdown]
# To hold in full, C7 needs an AUC of at most 0.1 above the *floor*, which is the AUC of real telemetry against other real telemetry. It
# holds *partly* if standard deviation, distribution and roughness are right. (The package draws the noise anew and uses two more features,
# so that its AUC differs a little from the one above.)

# %%
(record,) = verdict(pipeline, "C7", limits=False)
auc, floor = (record["measured"][name] for name in ("auc", "floor_auc"))
say(f"AUC of generated telemetry **{auc:.2f}**, floor **{floor:.2f}**.")
assert budget == "smoke" or auc - floor > 0.1

# %% [markdown]
# ## The noise alone

# %%
show(pipeline, "fig06_real_or_generated_noise")

# %% [markdown]
# *What to see:* little, but for one spike at the same place in *c* and *f*. But what windows share is invisible in a single one. Here is
# the first minute of the mean of the four windows of each kind, with that of four others:

# %%
four_generated = pipeline.generate_noise(4, pipeline.draw("figure 6"))
four_real = pipeline.noise_windows("test", 4, "figure 6, real")
groups = {"real": four_real, "generated": four_generated}
others = {
    "real": pipeline.noise_windows("test", 4, "others"),
    "generated": pipeline.generate_noise(4, pipeline.draw("others")),
}
ratio = {name: group.mean(axis=0).std() / group.std() for name, group in groups.items()}
alt = "Means of four and of four other windows of noise, for real and for generated ones"
title = "Means of generated windows share a pattern, those of real ones none"
with drawing(alt, 2, 1.8, title, sharey=True) as panels:
    for panel, color, name in zip(panels, (REAL, GENERATED), groups):
        panel.plot(groups[name].mean(axis=0)[:60], color=color, linewidth=0.9)
        panel.plot(others[name].mean(axis=0)[:60], color=color, linestyle=DASHED, linewidth=0.9)
        panel.set(title=f"{name}: mean of the four; dashed: of four others", xlabel="time (s)")
    panels[0].set_ylabel("noise (dimensionless)")

# %%
correlation = {name: (np.corrcoef(group).sum() - 4) / 12 for name, group in groups.items()}
say(
    f"Standard deviation of the mean, in units of that of a window: **{ratio['real']:.2f}** real (independent windows: 0.50), "
    f"**{ratio['generated']:.2f}** generated. Mean correlation of two windows: **{correlation['real']:.2f}** real, "
    f"**{correlation['generated']:.2f}** generated."
)
assert correlation["generated"] > {"full": 0.3, "smoke": 0.1}[budget] > abs(correlation["real"])

# %% [markdown]
# In how many dimensions do many windows vary? The *effective rank* counts them: it is e to the entropy of the shares of the variance that
# the principal components have ([09](09_generator.ipynb) has its four lines of code).

# %%
found = noise_resemblance(pipeline)
share = found["rank_ratio"]
say(
    f"Effective rank of {len(pipeline.noise_windows('test')):,} windows of generated noise: **{share:.1%}** of that of real noise."
)
assert share < {"full": 0.2, "smoke": 0.6}[budget]

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
assert repeats["generated"] > {"full": 0.1, "smoke": 0.05}[budget] > abs(repeats["real"])

# %% [markdown]
# **Answer.** There is a difference, although little shows at first. A classifier has an AUC above 0.9, and windows of generated noise
# share a pattern: on average, two of them are correlated, and two real ones are not.
#
# ## Exercises
#
# **1.** What does the classifier look at? Which *single* feature separates real from generated *noise* best, and how
# well? Set `best_auc` to its AUC (an AUC of 0.1 separates as well as one of 0.9, so give the larger of the AUC and 1 − AUC).

# %%
real = pipeline.noise_windows("test")
generated = pipeline.generate_noise(len(real), np.random.default_rng(1))
features, is_generated = features_of(np.concatenate([generated, real])), np.repeat([1, 0], len(real))
names = ["mean", "size", "size of steps", "lag-1 correlation"]
names += [f"band {number}, from {2**number} cycles per window" for number in range(8)]
best_auc = None  # your answer

# %%
from notebooks import answers_paper

check_answer(
    best_auc,
    lambda answer: abs(answer - answers_paper.auc_of_best_feature(features, is_generated)) < 0.005,
    "roc_auc_score(is_generated, features[:, 0]) is the AUC of the first feature.",
)

# %% [markdown]
# **2.** How many of $n=100$ windows, half of them generated, must you classify correctly before you may claim to see a difference, at a
# chance of error of 5 %? Treat your answers as independent guesses.

# %%
needed = None  # your answer: the smallest number of right answers that pure guessing reaches in at most 5 % of tries

# %%
check_answer(
    needed,
    lambda number: number == answers_paper.right_guesses_needed(100, 0.05),
    "The number of right guesses is binomial with n = 100 and p = 1/2; scipy.stats.binom has its tail.",
)
