# %% [markdown]
# # Accuracy and loss (Figure 12)
#
# **Question:** when are the two networks of a GAN in balance, and what does this balance prove about the noise?
#
# - **After this lesson** you can compute accuracy and loss of a discriminator by hand, say how much of a curve is chance, and name a
#   property of noise that no such curve shows.
# - **You should know** the training loop (notebook 11) and the effective rank (notebook 09).
# - **Terms:** *accuracy*: share of rows that are classified correctly, where a probability above 0.5 means "real".
#   [Binary cross-entropy](../docs/glossary.md#adversarial-loss): $-\ln D$ for a real row, $-\ln(1-D)$ for a generated one.
#   *Standard error*: the standard deviation of an estimate over repeated samples.
#
# **What the paper says** (section 2.3): the noise "needed around 1,000 iterations"; "the discriminator improves slightly faster than
# the generator, which is the goal of a GAN. If the two elements are too imbalanced, the system cannot learn effectively."

# %%
import numpy as np
from lesson_tools import ROOT, check_answer, claim, drawing, open_pipeline, say, show, verdict

from enhsim_tf.common.plot_style import GENERATED, QUIET

pipeline, budget = open_pipeline()
claim("C4", "C5")

# %% [markdown]
# ## How the curves are measured
#
# Every 100 iterations, the discriminator judges 200 new real rows and 200 new generated ones. With its probabilities $D$, accuracy and
# loss are two lines of NumPy:

# %%
import keras
import tensorflow as tf

gan = experiment.simulator.noise
noise = pipeline.noise_windows("train", pipeline.settings.num_windows, "noise windows")
rows, seeds = tf.constant(noise[:, :, None]), keras.random.SeedGenerator(pipeline.settings.seed + 1)

real = tf.gather(rows, keras.random.randint((gan.batch_size,), 0, len(noise), seed=seeds))
generated = gan.generator(keras.random.normal((gan.batch_size, 16), seed=seeds), training=False)
by_hand = {}
for kind, batch, is_real in (("real", real, True), ("generated", generated, False)):
    D = np.asarray(gan.discriminator(batch, training=False), float)
    by_hand[f"accuracy_{kind}"] = np.mean((D > 0.5) == is_real)
    by_hand[f"loss_{kind}"] = np.mean(-np.log(D if is_real else 1 - D))

packaged = gan._evaluate(rows)  # what the package records; the same draws
for name, value in by_hand.items():
    np.testing.assert_allclose(value, packaged[name], rtol=1e-4)  # Keras computes the loss in 32 bits
say(", ".join(f"{name.replace('_', ', ')}: **{value:.2f}**" for name, value in by_hand.items()) + ".")

# %% [markdown]
# A discriminator that says "fifty-fifty" to everything has a loss of $-\ln\tfrac12=\ln 2\approx0.69$ for both kinds. That is the level of
# chance in the figure.

# %%
history = show(pipeline, "fig12_accuracy_loss")

# %% [markdown]
# *What to see:* the discriminator learns first. Then the generator catches up, and both losses stay near ln 2. In the second half, when
# one accuracy rises, the other falls: the discriminator has an opinion, but it is about as often wrong as right.

# %%
last = {key: float(values[-1]) for key, values in history.items()}
both = (last["accuracy_real"] + last["accuracy_generated"]) / 2
mean_loss = (last["loss_real"] + last["loss_generated"]) / 2
half = slice(len(history["iteration"]) // 2, None)
of_real, of_generated = (history[f"accuracy_{kind}"][half] for kind in ("real", "generated"))
varies = of_real.std() > 0 and of_generated.std() > 0  # at smoke budget they may not
together = np.corrcoef(of_real, of_generated)[0, 1] if varies else 0.0
say(
    f"At the end, over both kinds: accuracy **{both:.2f}**, loss **{mean_loss:.2f}** (ln 2 = {np.log(2):.2f}). Correlation of the two "
    f"accuracies in the second half: **{together:.2f}**."
)
assert abs(both - 0.5) < 0.2
assert abs(mean_loss - np.log(2)) < {"full": 0.15, "smoke": 3.0}[budget]
assert budget == "smoke" or together < -0.5

# %% [markdown]
# How much of the wiggling is chance? An accuracy $p$ from $n$ rows has a standard error of $\sqrt{p(1-p)/n}$:

# %%
error = np.sqrt(0.5 * 0.5 / gan.batch_size)
say(
    f"Standard error of an accuracy near one half, from {gan.batch_size} rows: **{error:.1%}**. Differences of "
    f"less than about {2 * error:.0%} mean nothing."
)

# %% [markdown]
# ## What the figure does not show
#
# A balanced game says that *this* discriminator cannot tell the noises apart. It does not say that they are alike. During training, the
# generated noise itself was measured as well: its standard deviation, and its effective rank.

# %%
followed = experiment.noise_history
size, rank = followed["sd_ratio"], followed["rank"] / followed["real_rank"]
alt = "Standard deviation and effective rank of the generated noise, divided by those of the real noise, by iteration"
title = "The noise finds its standard deviation, but not its number of dimensions"
with drawing(alt, 2, 2.3, title) as panels:
    names = {"standard deviation, generated ÷ real": size, "effective rank, generated ÷ real": rank}
    for panel, (name, ratio) in zip(panels, names.items()):
        panel.axhline(1, color=QUIET, linestyle=":", label="as real noise")
        panel.plot(followed["iteration"], ratio, "o-", color=GENERATED, markersize=3, label="generated")
        panel.set(title=name, xlabel="iteration", yscale="log", ylim=(0.02, 12))
        panel.set_yticks([0.1, 1, 10], ["0.1", "1", "10"])
    panels[0].legend(frameon=False, loc="lower left")

# %% [markdown]
# *What to see:* on the left the noise finds its standard deviation, as the claim says. On the right, on the same logarithmic axis, it
# stays a factor below the real noise: no curve of Figure 12 would ever tell.

# %%
say(
    f"At the end, the generated noise has **{size[-1]:.2f}** times the standard deviation and **{rank[-1]:.2f}** times the effective rank "
    f"of real noise (from 200 windows of each; with more windows, real noise fills more dimensions, and the ratio falls)."
)
assert rank.max() < {"full": 0.5, "smoke": 0.9}[budget]
assert abs(np.log(size[-1])) < {"full": 0.1, "smoke": 3.0}[budget]

# %% [markdown]
# One seed is not enough. The reproduction was repeated with other seeds; this cell reads its results:

# %%
import json

spread = json.loads((ROOT / "figures" / "spread.json").read_text())
smallest, largest = spread["claims"]["C4"]["details"]["sd_ratio"]
shares = np.array(spread["claims"]["C5"]["values"])
say(
    f"Over {len(spread['seeds'])} seeds, the noise after 1,000 iterations has between **{smallest:.2f}** and **{largest:.2f}** times "
    f"the standard deviation of real noise. The smallest is {abs(smallest - 1):.0%} off. Meanwhile, the share of rows that the "
    f"discriminator classifies correctly ranges only from {shares.min():.2f} to {shares.max():.2f}: balance does not tell a good "
    f"run from a bad one."
)
assert np.ptp(shares) < 0.15 and smallest < 0.95

# %% [markdown]
# ## The verdicts

# %%
records = verdict(pipeline, "C4", "C5")
assert records[1]["verdict"] in ("reproduced", "partly")

# %% [markdown]
# ## Exercises
#
# **1.** A discriminator has an accuracy of 75 % on real rows and 25 % on generated ones. Somebody concludes that it knows real noise
# well. Which probability of *being real* does a row have after this discriminator has called it "real", if half of all rows are real?

# %%
probability_real = None  # your answer

# %%
called_real = np.array([0.75, 1 - 0.25])  # share of real and of generated rows that it calls real
check_answer(
    probability_real,
    lambda answer: abs(answer - called_real[0] / called_real.sum()) < 1e-6,
    "Which share of the generated rows does it call real?",
)

# %% [markdown]
# **2.** Unbalance the game. Train a small pair with a discriminator that learns ten times too slowly, and one that learns ten times too
# fast, for 400 iterations each. Return the standard deviation of the noise, divided by that of the real noise.

# %%
from enhsim_tf.noise.discriminator import build_discriminator
from enhsim_tf.noise.generator import build_generator

from enhsim_tf import NoiseGAN

short = noise[:500, :100]


def size_after_training(speed):
    pair = build_generator(100, seed=0), build_discriminator(100, filters=32, seed=0)
    small = NoiseGAN(*pair, batch_size=50, discriminator_learning_rate=0.001 * speed, seed=0)
    # your code: train `small` for 400 iterations with small.fit, generate 500 windows, and return the ratio
    return None


# %%
sizes = [size_after_training(speed) for speed in (0.1, 10)]
check_answer(
    None if sizes[0] is None else sizes,
    lambda found: found[1] < 0.7 * found[0],
    "history = small.fit(short, num_iterations=400, verbose=False); windows = small.generate(500, seed=0)",
)

# %% [markdown]
# ## Solution
#
# <details><summary>1. What "75 % of real rows" is worth</summary>
#
# ```python
# probability_real = 0.75 / (0.75 + 0.75)
# ```
#
# One half: it calls three quarters of everything real, so its word says nothing. That is why the claim is evaluated on both kinds
# together.
#
# </details>

# %% [markdown]
# <details><summary>2. An unbalanced game</summary>
#
# ```python
# def size_after_training(speed):
#     pair = build_generator(100, seed=0), build_discriminator(100, filters=32, seed=0)
#     small = NoiseGAN(*pair, batch_size=50, discriminator_learning_rate=0.001 * speed, seed=0)
#     small.fit(short, num_iterations=400, verbose=False)
#     return small.generate(500, seed=0).std() / short.std()
#
#
# for speed in (0.1, 10):
#     print(f"speed {speed}: {size_after_training(speed):.1f} times the real standard deviation")
# ```
#
# The slow discriminator is no teacher: the noise keeps nearly the size that it began with. With the fast one, the generator learns
# *fastest* of all, since reversed tags pull hard while the discriminator is sure (notebook 11). With this loss, a discriminator that
# is ahead does no harm here; one that learns too little does. "Slightly faster" is no condition for learning.
#
# </details>
