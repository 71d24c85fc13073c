# %% [markdown]
# # Figure 9: the generator
#
# **What the paper says** (section 2.3): "The 16-element latent vector is densely connected to a layer of 64 neurons. These are then
# normalized and spread to a layer of 500 neurons, the number of samples in the time series."

# %%
import sys

sys.path.insert(0, "..")  # the clone that this notebook lies in

import numpy as np

from enhsim_tf.common.plot_style import AVERAGE, GENERATED, REAL
from enhsim_tf.reproduce.notebook import claim, drawing, open_experiment, show

experiment = open_experiment()
claim("C6")

# %% [markdown]
# ## How it is built

# %%
from enhsim_tf.noise.generator import build_generator

untrained = build_generator(window=500, latent=16, hidden_units=64, activation="tanh", seed=0)
layers = show(experiment, "fig09_generator")

# %% [markdown]
# *What to see:* a small network, and a narrow one. All that it knows of noise enters through 16 numbers and passes 64 neurons.

# %%
total, resting = int(layers["total"]), int(layers["total"] - layers["trainable"])
print(f"{total:,} parameters; {resting} of them are running means and variances")
assert layers["parameters"].tolist() == [64 * (16 + 1), 4 * 64, 500 * (64 + 1), 0]
assert resting == 2 * 64 and untrained.count_params() == total

# %% [markdown]
# ## What that narrowness means
#
# The last Dense layer writes every window as a sum of 64 fixed shapes, the rows of its kernel, and tanh then bends it a little. Before
# the tanh, no thousand windows can fill more than 64 of the 500 dimensions. Real noise fills them all. Sort the dimensions by how much
# of the variance they hold:

# %%
generator = experiment.simulator.noise.generator
latent = np.random.default_rng(0).standard_normal((1_000, generator.input_shape[1]), "float32")
first, normalise, last, _ = generator.layers
hidden = np.asarray(normalise(first(latent)), float)
before_tanh = hidden @ np.asarray(last.kernel, float) + np.asarray(last.bias, float)
generated = np.asarray(generator(latent))[:, :, 0]
assert np.abs(np.tanh(before_tanh) - generated).max() < 1e-4

# %%
real = experiment.data.noise_windows("train", 1_000, "notebook")
parts = {"real noise": real, "generated": generated, "generated, before tanh": before_tanh}
energy = {
    name: np.linalg.svd(rows - rows.mean(axis=0, dtype=float), compute_uv=False) ** 2
    for name, rows in parts.items()
}

# %%
alt = "Share of the variance by dimension, sorted: real noise, generated noise, and the same before the tanh"
with drawing(alt, height=2.2) as panel:
    for (name, shares), color in zip(energy.items(), (REAL, GENERATED, AVERAGE)):
        panel.plot(np.arange(1, 501), shares / shares.sum(), color=color, label=name)
    panel.set(xlabel="dimension", ylabel="share of the variance", yscale="log", ylim=(1e-9, 1))
    panel.legend(frameon=False)

# %% [markdown]
# *What to see:* real noise falls off gently; generated noise falls off a cliff, and before the tanh the cliff stands at 64 sharp.

# %%
beyond = {name: shares[64:].sum() / shares.sum() for name, shares in energy.items()}
print("variance beyond 64 dimensions:", {name: f"{share:.1g}" for name, share in beyond.items()})
assert beyond["generated, before tanh"] < 1e-9 and beyond["real noise"] > 0.5

# %% [markdown]
# ## Exercises
#
# 1. Sixteen numbers, but 64 dimensions: where do the others come from? How many would be left without the relu?
# 2. Would a longer latent vector help? Build untrained generators with 4 to 256 latent elements and compare the effective rank of what
#    they make. What is the next thing to widen?

# %% [markdown] jp-MarkdownHeadingCollapsed=true
# ## Solution

# %%
import keras

from enhsim_tf.realism.measures import effective_rank

linear = keras.Sequential([keras.Input((16,)), keras.layers.Dense(64), keras.layers.Dense(500)])
print("rank without relu and tanh:", np.linalg.matrix_rank(linear.predict(latent, verbose=0), tol=1e-2))

# %%
rng = np.random.default_rng(0)
for number, units in ((4, 64), (16, 64), (64, 64), (256, 64), (256, 512)):
    model = build_generator(latent=number, hidden_units=units, seed=0)
    made = model.predict(rng.standard_normal((1_000, number), "float32"), verbose=0)[:, :, 0]
    print(f"latent {number:3}, hidden {units:3}: effective rank {effective_rank(made):5.1f}")
print(f"real noise: {effective_rank(real):.1f}")

# %% [markdown]
# <details><summary>What to say about it</summary>
#
# 1. The relu folds the 16-dimensional space, so that its image bends through up to 64 dimensions. Without it everything is one linear
#    map from 16 dimensions, and 16 is the rank.
# 2. A longer vector helps until the 64 hidden neurons are the bottleneck; then they must be widened too. Even then, training decides
#    how much of the room is used. A generator that gets a random number for *every sample*, and works along time, does not have the
#    problem at all.
#
# </details>
