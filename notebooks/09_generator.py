# %% [markdown]
# # The generator (Figure 9)
#
# **Question:** what limits the noise that a network can make of 16 random numbers?
#
# - **After this lesson** you can write the generator and one update of it in plain Keras, and find the bottleneck of a generator by
#   counting dimensions.
# - **You should know** what a Dense layer and a gradient are. The moving average is explained in notebook 08.
# - **Terms:** [generator and discriminator](../docs/glossary.md#generator-and-discriminator),
#   [adversarial loss](../docs/glossary.md#adversarial-loss), [effective rank](../docs/glossary.md#effective-rank).
#
# **What the paper says** (section 2.3): "The 16-element latent vector is densely connected to a layer of 64 neurons. These are then
# normalized and spread to a layer of 500 neurons, the number of samples in the time series."

# %%
import numpy as np
from lesson_tools import check_answer, drawing, open_pipeline, say, show

from enhsim_tf.common.plot_style import DASHED, GENERATED, REAL

pipeline, budget = open_pipeline()

# %% [markdown]
# ## The network
#
# The *latent vector* $z$ holds 16 independent random numbers from a normal distribution with standard deviation 4, as in the author's code.
# Each draw of $z$ gives one window of noise $G(z)$. Batch normalisation subtracts from each neuron its mean over the batch and divides by
# its standard deviation; a scale and a shift, both learned, follow. The tanh keeps the noise between −1 and 1.

# %%
import keras
from keras import layers

generator = keras.Sequential(
    [
        keras.Input((16,)),
        layers.Dense(64, activation="relu", kernel_initializer="he_uniform"),  # as in the author's code
        layers.BatchNormalization(),
        layers.Dense(500, activation="tanh"),
        layers.Reshape((500, 1)),
    ]
)
show(pipeline, "fig09_generator")

# %% [markdown]
# *What to see:* a small network, and a narrow one. All that differs from window to window enters through 16 numbers and passes
# 64 neurons. A Dense layer from $m$ to $n$ has $n\,(m+1)$ parameters, and a normalisation four for each neuron, of which two are running
# means and variances that no gradient changes:

# %%
by_hand = [64 * (16 + 1), 4 * 64, 500 * (64 + 1), 0]
say(f"Parameters by layer: {by_hand}, together **{generator.count_params():,}**.")
assert by_hand == [layer.count_params() for layer in generator.layers]

# %% [markdown]
# ## One update
#
# A second network, the *discriminator* $D$, returns the probability that a window is real (notebook 10). The generator has no noise to
# copy. It learns only from the discriminator's answer to its own windows, by minimising
#
# $$L_G=-\mathrm{mean}\,\ln D(G(z)),$$
#
# the binary cross-entropy for the label "real". The gradient flows through the discriminator to the generator's weights, and only these
# are changed.

# %%
import tensorflow as tf


def update_generator(generator, discriminator, optimizer, latent):
    with tf.GradientTape() as tape:
        judged = discriminator(generator(latent, training=True), training=True)
        loss = -tf.reduce_mean(
            tf.math.log(judged)
        )  # small if the discriminator takes the windows for real ones
    gradients = tape.gradient(loss, generator.trainable_variables)  # not those of the discriminator
    optimizer.apply(gradients, generator.trainable_variables)
    return float(loss)


# %% [markdown]
# The package has the same step in its class `NoiseGAN`. From the same weights and the same latent vectors, both must arrive at the same
# weights. *Adam*, the rule that turns gradients into steps of the weights, moves each by about its learning rate of 0.001 in the first
# step; the tolerance is a hundredth of it, for rounding.

# %%
import dataclasses

from enhsim_tf.paper.noise import build_discriminator, build_generator, connect

settings = dataclasses.replace(pipeline.settings, dropout=0.0)  # so that nothing is dropped at random
packaged, discriminator = build_generator(settings), build_discriminator(settings)
generator.set_weights(packaged.get_weights())
gan = connect(packaged, discriminator, settings)
# what the package draws first
latent = settings.latent_scale * keras.random.normal((200, 16), seed=keras.random.SeedGenerator(0))

first = generator.get_weights()
loss = update_generator(generator, discriminator, keras.optimizers.Adam(0.001), latent)
gan.train_generator()
for ours, theirs in zip(generator.get_weights(), packaged.get_weights()):
    np.testing.assert_allclose(ours, theirs, atol=1e-5)
moved = float(np.abs(generator.get_weights()[0] - first[0]).max())
say(
    f"Loss before the update: **{loss:.2f}**; guessing gives {np.log(2):.2f}. Neither network is trained. "
    f"The weights of the first layer moved by up to {moved:.4f}."
)

# %% [markdown]
# Notebook 11 repeats this a thousand times, in turn with the update of the discriminator. From here on, this lesson looks at the
# generator that was trained so.
#
# ## What the narrowness means
#
# The last Dense layer writes every window as a sum of 64 fixed shapes, the rows of its kernel $K$, and tanh then bends it a little:
#
# $$G(z)=\tanh\left(b+\sum_{i=1}^{64}h_i(z)\,K_i\right)$$
#
# Before the tanh, a thousand windows therefore vary in at most 64 of the 500 dimensions. Real noise varies in nearly all of them. To see
# it, sort the dimensions by their share of the variance, which are the squared singular values of the windows:

# %%
trained = pipeline.generator
first, normalise, last, _ = trained.layers
latent = settings.latent_scale * np.random.default_rng(0).standard_normal((1_000, 16), "float32")
hidden = np.asarray(normalise(first(latent)), float)
before_tanh = hidden @ np.asarray(last.kernel, float) + np.asarray(last.bias, float)
generated = np.asarray(trained(latent))[:, :, 0]
np.testing.assert_allclose(np.tanh(before_tanh), generated, atol=1e-4)  # 32-bit sums of 64 products

real = pipeline.noise_windows("train", 1_000, "notebook")


def shares_of_variance(windows):
    energy = np.linalg.svd(windows - windows.mean(axis=0, dtype=float), compute_uv=False) ** 2
    return energy / energy.sum()


parts = {"real noise": real, "generated": generated, "generated, before the tanh": before_tanh}
shares = {name: shares_of_variance(windows) for name, windows in parts.items()}

# %%
alt = "Share of the variance by dimension, sorted: real noise, generated noise, and the same before the tanh"
title = "Generated noise fills 64 dimensions before the tanh, real noise nearly all"
styles = ((REAL, "-"), (GENERATED, DASHED), (GENERATED, ":"))
with drawing(alt, height=2.3, title=title) as panel:
    for (name, values), (color, style) in zip(shares.items(), styles):
        panel.plot(np.arange(1, 501), values, color=color, linestyle=style, label=name)
    panel.set(
        xlabel="dimension, sorted",
        ylabel="share of the variance",
        yscale="log",
        ylim=(1e-9, 1),
        xlim=(0, 500),
    )
    panel.legend(frameon=False)

# %% [markdown]
# *What to see:* the shares of real noise decrease slowly up to the last twenty. Those of generated noise fall steeply, and before the
# tanh they end at 64. One number says it: the *effective rank*, the exponential of the entropy of the shares $p_i$,
#
# $$\mathrm{rank}=\exp\left(-\sum_i p_i\ln p_i\right).$$

# %%
from enhsim_tf.common.measures import effective_rank


def rank(windows):
    p = shares_of_variance(windows)
    p = p[p > 0]
    return np.exp(-np.sum(p * np.log(p)))


for windows in parts.values():
    np.testing.assert_allclose(rank(windows), effective_rank(windows), rtol=1e-5)
beyond = {name: values[64:].sum() for name, values in shares.items()}
say(
    f"Effective rank of 1,000 windows: **{rank(generated):.0f}** generated, **{rank(real):.0f}** real. "
    f"Beyond 64 dimensions lie {beyond['real noise']:.0%} of the variance of real noise, and {beyond['generated']:.2%} of that of "
    f"generated noise."
)
assert beyond["generated, before the tanh"] < 1e-9 and beyond["real noise"] > 0.5
assert rank(generated) < rank(real) / 2

# %% [markdown]
# **Answer.** Both numbers: before the tanh, every window is a sum of 64 shapes, so that generated windows differ from each other in at most
# 64 dimensions. The 16 numbers decide how the shapes are mixed, so that most of the variance lies in far fewer dimensions: the curve bends
# near the seventeenth. Real windows differ in nearly all 500. The PCA residual of notebook 13 looks at just that: what lies outside the
# main dimensions.
#
# ## Exercises
#
# **1.** Sixteen numbers go in, and 64 dimensions come out. Where do the others come from? Say first: what is the rank of the windows
# if relu, normalisation and tanh are left out?

# %%
rank_without_relu = None  # your answer

# %%
linear = keras.Sequential([keras.Input((16,)), layers.Dense(64), layers.Dense(500)])
windows = linear.predict(latent, verbose=0)
check_answer(
    rank_without_relu,
    lambda answer: answer == np.linalg.matrix_rank(windows, tol=1e-2),
    "Without relu and tanh, the network is a product of matrices.",
)

# %% [markdown]
# **2.** Is one of two changes enough to reach half the rank of real noise: 256 latent numbers instead of 16, or 512 hidden neurons instead
# of 64? Complete the function, compare, and decide.


# %%
def rank_of_untrained(latent, hidden):
    keras.utils.set_random_seed(0)
    # your code: build the generator with these sizes and return rank(windows) of 1,000 windows
    return None


one_is_enough = None  # your answer: True or False


# %%
from notebooks import answers_paper


def is_right(answer):
    sizes = (256, 64), (16, 512)
    found = [rank_of_untrained(*each) for each in sizes]
    expected = [answers_paper.rank_of_untrained(settings, *each) for each in sizes]
    return np.allclose(found, expected, rtol=0.15) and answer == (max(found) > rank(real) / 2)


check_answer(
    one_is_enough,
    is_right,
    "Draw latent vectors of shape (1000, latent) with settings.latent_scale, as above, and drop the last axis: windows[:, :, 0].",
)
