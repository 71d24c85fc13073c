# %% [markdown]
# # The discriminator (Figure 10)
#
# **Question:** what can the network that judges the noise see, and what can it not see?
#
# - **After this lesson** you can write the discriminator and one update of it in plain Keras, compute its first two layers by hand, and
#   name differences between noises that it cannot detect.
# - **You should know** what a convolution is. The generator is explained in notebook 09.
# - **Terms:** [discriminator](../docs/glossary.md#generator-and-discriminator),
#   [adversarial loss](../docs/glossary.md#adversarial-loss), [AUC](../docs/glossary.md#auc).
#
# **What the paper says** (section 2.3): one convolutional layer "using a window 20 neurons wide with a stride of 4 neurons per step";
# it "pools each convolution based on the maximum value of the sample". Then the layers narrow to one neuron that says real or not. The
# paper gives no number of filters; 500 is the author's, in the public code of his 1-D GAN.

# %%
import numpy as np
from lesson_tools import check_answer, claim, drawing, open_experiment, say, show

from enhsim_tf.common.plot_style import QUIET, REAL

experiment = open_experiment()
claim("C5")

# %% [markdown]
# ## The network

# %%
import keras
from keras import layers

discriminator = keras.Sequential(
    [
        keras.Input((500, 1)),
        layers.Conv1D(500, 20, strides=4, activation="relu", kernel_initializer="he_uniform"),
        layers.GlobalMaxPooling1D(),
        layers.Dense(25, activation="relu", kernel_initializer="he_uniform"),
        layers.Dense(1, activation="sigmoid", kernel_initializer="he_uniform"),
    ]
)
table = show(experiment, "fig10_discriminator")

# %% [markdown]
# *What to see:* the maximum in the second row. Each filter is a pattern of 20 samples. It is compared with the window at 121 places, and
# only the best match is kept: the discriminator knows that a pattern was *somewhere*, not where, and not how often.

# %%
positions = (500 - 20) // 4 + 1
by_hand = [500 * (20 + 1), 0, 25 * (500 + 1), 25 + 1]
say(f"{positions} places; parameters by layer {by_hand}, together **{sum(by_hand):,}**.")
assert discriminator.layers[0].output.shape[1] == positions
assert table["parameters"].tolist() == by_hand and discriminator.count_params() == sum(by_hand)

# %% [markdown]
# ## The first two layers by hand
#
# With the kernel $K_f$ and the bias $b_f$ of filter $f$, the two layers compute the number
#
# $$m_f=\max_{p}\;\mathrm{relu}\left(b_f+\sum_{k=0}^{19}K_{f,k}\,x_{4p+k}\right),\qquad p=0,\ldots,120.$$

# %%
real = experiment.data.noise_windows("train", 400, "notebook")
kernel, bias = discriminator.layers[0].get_weights()

pieces = np.lib.stride_tricks.sliding_window_view(real[:8], 20, axis=1)[:, ::4]  # (windows, places, 20)
matches = pieces @ kernel[:, 0] + bias  # (windows, places, filters)
by_hand = np.maximum(matches, 0).max(axis=1)

of_keras = discriminator.layers[1](discriminator.layers[0](real[:8, :, None]))
np.testing.assert_allclose(by_hand, of_keras, atol=1e-5)  # 32-bit sums of 20 products

# %% [markdown]
# ## One update
#
# The discriminator gets 200 real windows with the label 1 and 200 generated ones with the label 0. It minimises the binary cross-entropy
#
# $$L_D=-\mathrm{mean}\,\ln D(x)-\mathrm{mean}\,\ln\left(1-D(G(z))\right).$$
#
# Like the author's code, we take one step for each of the two terms. The generated windows are given: no gradient goes to the generator.

# %%
import tensorflow as tf


def update_discriminator(discriminator, optimizer, windows, label):
    with tf.GradientTape() as tape:
        judged = discriminator(windows, training=True)
        loss = -tf.reduce_mean(tf.math.log(judged if label == 1 else 1 - judged))
    gradients = tape.gradient(loss, discriminator.trainable_variables)
    optimizer.apply(gradients, discriminator.trainable_variables)
    return float(loss)


# %% [markdown]
# The package has the same step. The loop below compares them over five updates of each kind. The package computes the first two layers
# by a faster path in another order of summation; the tolerance, a thirtieth of what a weight moves, allows for its rounding.

# %%
from enhsim_tf import NoiseGAN

generator, packaged = experiment.untrained_noise_networks()
discriminator.set_weights(packaged.get_weights())
gan = NoiseGAN(generator, packaged, batch_size=200, seed=0)
optimizer, rng = keras.optimizers.Adam(0.001), np.random.default_rng(0)

for _ in range(5):
    real_batch = rng.choice(real, 200)[:, :, None]
    generated_batch = np.asarray(generator(rng.standard_normal((200, 16), "float32")))
    losses = [
        update_discriminator(discriminator, optimizer, real_batch, 1),
        update_discriminator(discriminator, optimizer, generated_batch, 0),
    ]
    for windows, label in ((real_batch, 1.0), (generated_batch, 0.0)):
        gan._update_discriminator(tf.constant(windows), tf.fill((200, 1), label))

for ours, theirs in zip(discriminator.get_weights(), packaged.get_weights()):
    np.testing.assert_allclose(ours, theirs, atol=3e-4)
say(
    f"Losses after four updates: **{losses[0]:.2f}** for real windows, **{losses[1]:.2f}** for generated ones."
)

# %% [markdown]
# ## What it cannot see
#
# Now the discriminator that was trained for 1,000 iterations. Cut real windows into five blocks of 100 samples and put the blocks into
# another order. Only the few filter places across the cuts change. Then, for comparison, put all 500 samples into another order.

# %%
trained, rng = experiment.simulator.noise.discriminator, np.random.default_rng(0)
blocks = real.reshape(-1, 5, 100)[:, [3, 0, 4, 2, 1]].reshape(-1, 500)
samples = real[:, rng.permutation(500)]
judged, judged_blocks, judged_samples = (
    trained.predict(windows[:, :, None], verbose=0)[:, 0] for windows in (real, blocks, samples)
)

# %%
alt = "Judgement of real windows before and after reordering: blocks, and single samples"
title = "The discriminator hardly notices that a window was cut and reordered, if the pieces stay whole"
reordered = {"blocks of 100 samples reordered": judged_blocks, "single samples reordered": judged_samples}
with drawing(alt, 2, 2.7, title, sharex=True, sharey=True) as panels:
    for panel, (name, other) in zip(panels, reordered.items()):
        panel.plot(judged, other, "o", color=REAL, markersize=2, alpha=0.5)
        panel.axline((judged.mean(), judged.mean()), slope=1, color=QUIET, linewidth=0.8)
        panel.set(title=name, xlabel="probability real, as recorded", ylabel="probability real, reordered")

# %% [markdown]
# *What to see:* on the left the points stay near the diagonal. For this discriminator, a window is an unordered set of pieces of 20
# samples. It cannot detect differences over longer stretches, so the generator does not learn to avoid them.

# %%
moved = {name: float(np.mean(np.abs(other - judged))) for name, other in reordered.items()}
blocks_moved, samples_moved = moved.values()
say(
    f"Mean change of the probability: **{blocks_moved:.3f}** for blocks, **{samples_moved:.3f}** for single samples, "
    f"a factor of {samples_moved / blocks_moved:.1f}."
)
assert blocks_moved < samples_moved / 1.5

# %% [markdown]
# It also judges one window at a time. That a thousand windows are all mixtures of the same few shapes (notebook 09) is visible only in
# the thousand together.
#
# ## Exercises
#
# **1.** Without the maximum, the Dense layer of 25 neurons would see all 121 places of all 500 filters. How many parameters would the
# discriminator then have?

# %%
parameters_without_maximum = None  # your answer

# %%
flat = [
    keras.Input((500, 1)),
    layers.Conv1D(500, 20, strides=4),
    layers.Flatten(),
    layers.Dense(25),
    layers.Dense(1),
]
check_answer(
    parameters_without_maximum,
    lambda answer: answer == keras.Sequential(flat).count_params(),
    "Count layer by layer: the convolution stays the same, and the Dense layer has 25 (n + 1) parameters.",
)

# %% [markdown]
# **2.** Help the discriminator: write a function from a *batch* of windows, shape `(200, 500)`, to one number that separates batches of
# real noise from batches of generated noise. The check tries it on twenty batches of each.


# %%
def number_of_batch(windows): ...  # your code


# %%
from sklearn.metrics import roc_auc_score

batches = [experiment.data.noise_windows("test", 200, f"batch {number}") for number in range(20)]
batches += [experiment.simulator.noise.generate(200, seed=number) for number in range(20)]
numbers = [number_of_batch(windows) for windows in batches]
check_answer(
    None if numbers[0] is None else numbers,
    lambda found: abs(roc_auc_score([0] * 20 + [1] * 20, found) - 0.5) > 0.49,
    "What do all windows of a generated batch have in common? Notebook 09 has one answer, the mean window another.",
)

# %% [markdown]
# ## Solution
#
# <details><summary>1. Without the maximum</summary>
#
# ```python
# parameters_without_maximum = 500 * (20 + 1) + 25 * (121 * 500 + 1) + 25 + 1
# ```
#
# More than a million: the maximum is what keeps the discriminator small, and it is what makes it blind to order.
#
# </details>

# %% [markdown]
# <details><summary>2. A number for a batch</summary>
#
# ```python
# def number_of_batch(windows):
#     return windows.mean(axis=0).std()
# ```
#
# Windows of real noise cancel in the mean; generated windows share a pattern that remains. The effective rank separates them as well. A
# discriminator that is given such a number beside each window ("minibatch standard deviation" in the literature) would force the
# generator to vary more. The convolutional GAN of this package (`noise/convolutional_gan.py`) goes another way: its generator gets a
# random number for every sample, and its discriminator also sees statistics and the spectrum of the whole window.
#
# </details>
