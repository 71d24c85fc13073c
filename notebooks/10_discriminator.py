# %% [markdown]
# # The discriminator (Figure 10)
#
# **Question:** what can the network that judges the noise see, and what can it not see?
#
# - **After this lesson** you can write the discriminator and one update of it in plain Keras, compute its first two layers by hand, and
#   test which differences between two kinds of noise it detects.
# - **You should know** what a convolution is. The generator is explained in notebook 09.
# - **Terms:** [discriminator](../docs/glossary.md#generator-and-discriminator): the network that gets a window of noise and answers with
#   the probability that it is real; [adversarial loss](../docs/glossary.md#adversarial-loss); [AUC](../docs/glossary.md#auc): the
#   probability that a judge gives a higher score to a generated window than to a real one. 0.5 means that it cannot tell them apart.
#
# **What the paper says** (section 2.3): one convolutional layer "using a window 20 neurons wide with a stride of 4 neurons per step"; it
# "pools each convolution based on the maximum value of the sample". Then the layers narrow to one neuron that says real or not. The paper
# gives no number of filters; 500 is from the author's public code.

# %%
import numpy as np
from lesson_tools import check_answer, drawing, open_pipeline, show

from enhsim_tf.common.plot_style import GENERATED, QUIET, REAL

pipeline, budget = open_pipeline()
is_full = budget == "full"

# %% [markdown]
# ## The network

# %%
import keras
from keras import layers

discriminator = keras.Sequential(
    [
        keras.Input((500, 1)),
        layers.Conv1D(500, 20, strides=4, activation="relu"),
        layers.Dropout(0.3),
        layers.GlobalMaxPooling1D(),
        layers.Dense(25, activation="relu", kernel_initializer="he_uniform"),
        layers.Dropout(0.3),
        layers.Dense(1, activation="sigmoid"),
    ]
)
show(pipeline, "fig10_discriminator")

# %% [markdown]
# *What to see:* the maximum in the third row. (Dropout, from the author's code, sets a random 30 % of its inputs to zero in training,
# and does nothing afterwards.) Each filter is a pattern of 20 samples. It is compared with the window at 121 places, and
# only the best match is kept: the discriminator knows that a pattern was *somewhere*, not where, and not how often.

# %%
positions = (500 - 20) // 4 + 1
by_hand = [500 * (20 + 1), 0, 0, 25 * (500 + 1), 0, 25 + 1]
print(f"{positions} places; parameters by layer {by_hand}, together {sum(by_hand):,}")
assert discriminator.layers[0].output.shape[1] == positions
assert by_hand == [layer.count_params() for layer in discriminator.layers]

# %% [markdown]
# ## Convolution and maximum by hand
#
# With the kernel $K_f$ and the bias $b_f$ of filter $f$, the two layers compute the number
#
# $$m_f=\max_{p}\;\mathrm{relu}\left(b_f+\sum_{k=0}^{19}K_{f,k}\,x_{4p+k}\right),\qquad p=0,\ldots,120.$$

# %%
real = pipeline.noise_windows("train", 400, "notebook")
kernel, bias = discriminator.layers[0].get_weights()

pieces = np.lib.stride_tricks.sliding_window_view(real[:8], 20, axis=1)[:, ::4]  # (windows, places, 20)
matches = pieces @ kernel[:, 0] + bias  # (windows, places, filters)
by_hand = np.maximum(matches, 0).max(axis=1)

of_keras = discriminator.layers[2](discriminator.layers[0](real[:8, :, None]))
np.testing.assert_allclose(by_hand, of_keras, atol=1e-5)  # 32-bit sums of 20 products

# %% [markdown]
# ## One update
#
# The discriminator gets a batch of 200 rows: 100 real windows with the label 1 and 100 generated ones with the label 0. It minimises the
# binary cross-entropy
#
# $$L_D=-\tfrac12\,\mathrm{mean}\,\ln D(x)-\tfrac12\,\mathrm{mean}\,\ln\left(1-D(G(z))\right).$$
#
# The paper "trains on the entire batch (200 rows) of real and generated data", so there is one step for both terms. The generated windows
# are given: no gradient goes to the generator.

# %%
import tensorflow as tf


def update_discriminator(discriminator, optimizer, real, generated):
    with tf.GradientTape() as tape:
        judged_real, judged_generated = (discriminator(rows, training=True) for rows in (real, generated))
        of_real, of_generated = (-tf.reduce_mean(tf.math.log(p)) for p in (judged_real, 1 - judged_generated))
        loss = (of_real + of_generated) / 2
    gradients = tape.gradient(loss, discriminator.trainable_variables)
    optimizer.apply(gradients, discriminator.trainable_variables)
    return float(loss)


# %% [markdown]
# The package has the same step. The loop below compares them over five updates, without dropout, whose random draws would differ. The
# package computes convolution and maximum by a faster path in another order of summation; the tolerance, a tenth of what a weight moves,
# allows for its rounding.

# %%
import dataclasses

from enhsim_tf.paper.noise import build_discriminator, build_generator, connect, labels

settings = dataclasses.replace(pipeline.settings, dropout=0.0)
generator, packaged = build_generator(settings), build_discriminator(settings)
discriminator.set_weights(packaged.get_weights())
for layer in discriminator.layers:
    if isinstance(layer, layers.Dropout):
        layer.rate = 0.0
gan = connect(generator, packaged, settings)
optimizer, rng = keras.optimizers.Adam(0.001), np.random.default_rng(0)

for _ in range(5):
    real_batch = rng.choice(real, 100)[:, :, None]
    generated_batch = np.asarray(generator(rng.standard_normal((100, 16), "float32")))
    loss = update_discriminator(discriminator, optimizer, real_batch, generated_batch)
    both = tf.constant(np.concatenate([real_batch, generated_batch]))
    gan.train_discriminator(both, tf.concat([labels(100, 1.0), labels(100, 0.0)], 0))

for ours, theirs in zip(discriminator.get_weights(), packaged.get_weights()):
    np.testing.assert_allclose(ours, theirs, atol=5e-4)
print(f"loss before the fifth update: {loss:.2f}; guessing gives {np.log(2):.2f}")

# %% [markdown]
# ## Which changes it notices
#
# Take the discriminator after its training of 1,000 iterations, and 400 real windows that it judges twice: as recorded, and changed in one
# of three ways.
#
# - *Reordered blocks*: each window is cut into five blocks of 100 samples, and the blocks are put into another order.
# - *Reordered samples*: all 500 samples are put into another order.
# - *Larger*: all samples are multiplied by 1.2.
#
# A filter looks at 20 samples and moves in steps of 4, so after reordering blocks, only 4 places at each of the 4 cuts see other samples
# than before.

# %%
trained, rng = build_discriminator(pipeline.settings), np.random.default_rng(0)
trained.load_weights(pipeline.gan_folder / "discriminator.weights.h5")


def probability_real(windows):
    return trained.predict(windows[:, :, None], verbose=0)[:, 0]


changed = {
    "reordered blocks": real.reshape(-1, 5, 100)[:, [3, 0, 4, 2, 1]].reshape(-1, 500),
    "reordered samples": real[:, rng.permutation(500)],
    "larger": 1.2 * real,
}
recorded = probability_real(real)
judged = {name: probability_real(windows) for name, windows in changed.items()}

# %%
alt = "Judgement of real windows as recorded and after each of three changes: points near the diagonal are windows judged alike"
title = "In this run, the discriminator overlooks the order of blocks, and notices size"
with drawing(alt, 3, 2.5, title, sharex=True, sharey=True) as panels:
    for panel, (name, other) in zip(panels, judged.items()):
        panel.plot(recorded, other, "o", color=REAL, markersize=2, alpha=0.4)
        panel.axline((recorded.mean(), recorded.mean()), slope=1, color=QUIET, linewidth=0.8)
        panel.set(title=name, xlabel="probability real, as recorded")
        panel.margins(0.06)
        panel.locator_params(axis="x", nbins=3)
    panels[0].set(ylabel="probability real, changed")

# %% [markdown]
# *What to see:* on the left, the points lie near the diagonal. In the middle they scatter more widely, and on the right they scatter most,
# and nearly all lie far below it. But all probabilities are within 0.11 of one half. (The axes differ in scale.) Reordered blocks keep
# nearly all pieces of 20 samples, reordered samples keep none, and in the larger windows every piece has grown.

# %%
moved = {name: float(np.mean(np.abs(other - recorded))) for name, other in judged.items()}
for name, change in moved.items():
    print(f"{name:18} mean change of the probability {change:.4f}")
assert moved["reordered blocks"] < moved["reordered samples"] / 1.5
assert not is_full or moved["reordered blocks"] < moved["larger"] / 1.5

# %% [markdown]
# ## What it misses after its training
#
# Let two other judges look at windows of the trained GAN. Each is a linear classifier, trained on four fifths of the windows and asked
# about the last fifth, for each fifth in turn. One sees the 500 values at their places, the other the power of each frequency. Every
# judge is also asked to tell two sets of *real* windows apart, which nobody can: the result is its *floor*.

# %%
from sklearn.linear_model import RidgeClassifier
from sklearn.model_selection import PredefinedSplit, cross_val_predict
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

held_out = pipeline.noise_windows("test")[:1_000]
number = len(held_out)
more_real = pipeline.noise_windows("train", number, "second sample")
generated = pipeline.generate_noise(number, np.random.default_rng(10))


def auc(scores, scores_of_real):
    difference = scores[:, None] - scores_of_real[None, :]
    return np.mean(difference > 0) + np.mean(difference == 0) / 2  # equal scores count one half


def log_power(windows):
    tapered = windows * np.hanning(500)  # falls to 0 at the ends of each window
    return np.log(np.abs(np.fft.rfft(tapered, axis=1)[:, 1:]) ** 2 + 1e-12)


def linear_judge(windows, of_real):
    features, labels = np.concatenate([windows, of_real]), np.repeat([1, 0], number)
    fifths = PredefinedSplit(np.tile(np.arange(number) * 5 // number, 2))  # neighbours in time stay together
    classifier = make_pipeline(StandardScaler(), RidgeClassifier(alpha=100.0))  # linear, with small weights
    scores = cross_val_predict(classifier, features, labels, cv=fifths, method="decision_function")
    return auc(scores[:number], scores[number:])


judges = {
    "discriminator": lambda a, b: auc(-probability_real(a), -probability_real(b)),
    "values at their places": linear_judge,
    "power of each frequency": lambda a, b: linear_judge(log_power(a), log_power(b)),
}
found = {name: judge(generated, held_out) for name, judge in judges.items()}
floors = {name: judge(more_real, held_out) for name, judge in judges.items()}

# %%
alt = "AUC of three judges that tell the noise of the GAN from real noise, each with its floor"
title = "Two simple judges recognise generated noise far better than the discriminator"
with drawing(alt, height=1.7, title=title) as panel:
    for row, name in enumerate(judges):
        panel.plot([floors[name], found[name]], [row, row], color=QUIET, linewidth=0.8)
    panel.plot(list(floors.values()), list(floors), "s", color=REAL, label="floor: real against real")
    panel.plot(list(found.values()), list(found), "o", color=GENERATED, label="generated against real")
    left = min(0.4, found["discriminator"] - 0.05)
    panel.set(xlabel="AUC (0.5: cannot tell; 1: always right)", xlim=(left, 1.02), ylim=(2.5, -0.5))
    panel.legend(frameon=False, loc="upper left", bbox_to_anchor=(1, 1))

# %% [markdown]
# *What to see:* two judges are nearly always right, and far from their floors. The discriminator is far from them. How far differs from run
# to run: with another seed it takes generated windows for real more often than real ones (AUC below 0.5), with a third it gives nearly the
# same probability to all (not shown here). (A floor below 0.5 shows how far chance, or a difference between training and held-out windows,
# moves the AUC.) Generated windows differ from real ones, and a linear classifier is enough to find it. The lost places are not the whole
# reason: the power of each frequency holds no places either. The generator learns from the discriminator alone, which at this point sees
# little of that difference.

# %%
for name in judges:
    print(f"{name:24} AUC {found[name]:.2f}   floor {floors[name]:.2f}")
if is_full:
    assert 0.1 < found["discriminator"] < 0.9
    assert min(found["values at their places"], found["power of each frequency"]) > 0.9
    assert max(floors.values()) < 0.6

# %% [markdown]
# **Answer.** It can see which short pieces a window holds and how large they are. It cannot see their order. As trained, it also misses
# most of the difference that a linear classifier finds in single windows; whether it could learn to see it was not tested.
#
# ## Exercises
#
# **1.** Without the maximum, the Dense layer of 25 neurons would see all 121 places of all 500 filters. How many parameters would the
# discriminator then have?

# %%
parameters_without_maximum = None  # your answer

# %%
check_answer(
    parameters_without_maximum,
    lambda answer: answer % 9_973 == 7_155,  # the remainder, so that the answer is not in sight
    "Count layer by layer: the convolution stays the same, and the Dense layer has 25 (n + 1) parameters.",
)

# %% [markdown]
# **2.** Help the discriminator: write a function from a *batch* of windows, shape `(200, 500)`, to one number that separates batches of
# real noise from batches of generated noise. The check tries it on twenty batches of each.


# %%
def number_of_batch(windows): ...  # your code


# %%
from sklearn.metrics import roc_auc_score

batches = [pipeline.noise_windows("test", 200, f"batch {number}") for number in range(20)]
batches += [pipeline.generate_noise(200, np.random.default_rng(number)) for number in range(20)]
numbers = [number_of_batch(windows) for windows in batches]
check_answer(
    None if numbers[0] is None else numbers,
    lambda found: abs(roc_auc_score([0] * 20 + [1] * 20, found) - 0.5) > 0.49,
    "What would you compute from all 200 windows that you cannot compute from one?",
)
