# %% [markdown]
# # The frozen discriminator: a trap
#
# **What the paper says** (section 2.3): after the discriminator's turn its "weights are frozen, and the generator is trained as part of
# the entire GAN model". The paper ran on TensorFlow 2.1, and so did the classic way to write that sentence down: compile the
# discriminator, set `trainable = False`, compile the stack. Countless tutorials have it. Under Keras 3 it trains nothing, and hardly
# says so. This notebook runs it, watches, and mends it.

# %%
import sys

sys.path.insert(0, "..")  # the clone that this notebook lies in

import numpy as np

from enhsim_tf.common.plot_style import GENERATED, REAL
from enhsim_tf.reproduce.notebook import claim, drawing, open_experiment, show

experiment = open_experiment()
claim("C5")

# %%
import warnings

import keras

print("Keras", keras.__version__)

# %% [markdown]
# ## The plan
#
# Both ways draw the same picture, so we keep it in view. In each phase one network learns and the other is frozen:

# %%
_ = show(experiment, "fig11_gan_training")

# %% [markdown]
# ## The classic pattern
#
# A small pair of networks and the real noise, so that sixty iterations take seconds.

# %%
from enhsim_tf.noise.discriminator import build_discriminator
from enhsim_tf.noise.generator import build_generator

real_noise = experiment.data.noise_windows("train", 1_000, "notebook")[:, :100, None]
discriminator, generator = build_discriminator(100, filters=32, seed=0), build_generator(100, seed=0)

discriminator.compile("adam", "binary_crossentropy")
discriminator.trainable = False  # meant for the stack below
combined = keras.Sequential([generator, discriminator])
combined.compile("adam", "binary_crossentropy")

# %%
rng, real, generated = np.random.default_rng(0), np.ones((64, 1)), np.zeros((64, 1))
start, frozen = discriminator.get_weights(), []
with warnings.catch_warnings(record=True) as heard:
    warnings.simplefilter("always")
    for _ in range(60):
        latent = rng.standard_normal((64, 16))
        of_real = discriminator.train_on_batch(rng.choice(real_noise, 64), real)
        of_generated = discriminator.train_on_batch(generator.predict_on_batch(latent), generated)
        frozen.append((of_real, of_generated, combined.train_on_batch(latent, real)))  # tags reversed

# %% [markdown]
# The loop ran to its end without an error and returned losses that move. Did the discriminator?

# %%
moved = [float(np.abs(now - before).max()) for now, before in zip(discriminator.get_weights(), start)]
print("largest change of each of its weights:", moved)
print("all that Keras said:", [f"{warning.category.__name__}: {warning.message}" for warning in heard])
assert moved == [0.0] * 6
assert [warning.category for warning in heard] == [UserWarning]

# %% [markdown]
# *What to see:* six times zero. `discriminator.train_on_batch` computed a loss, took the gradient with respect to an empty list of
# weights, and told nobody but in one warning, once.
#
# ## Why
#
# What a model may train is asked for at another moment than it used to be:
#
# | | when is `trainable` read? | so `discriminator.train_on_batch` |
# |---|---|---|
# | Keras 2 | at `compile`, before the freeze | trains all its weights |
# | Keras 3 | when the training step is first built, after the freeze | trains none |

# %%
models = {"discriminator": discriminator, "stack": combined, "generator": generator}
trainable = {name: len(model.trainable_weights) for name, model in models.items()}
print("trainable weights:", trainable)
assert trainable["discriminator"] == 0 and trainable["stack"] == trainable["generator"]

# %% [markdown]
# ## The right way
#
# Do not rely on a moment. Freezing is not a state of a layer but a *list*: the weights that the optimiser is handed. The package names
# them in each phase:

# %%
import inspect

from enhsim_tf import NoiseGAN

print(inspect.getsource(NoiseGAN._update_discriminator))

# %% [markdown]
# The same networks with the same first weights, trained for as long:

# %%
pair = build_generator(100, seed=0), build_discriminator(100, filters=32, seed=0)
gan = NoiseGAN(*pair, batch_size=64, seed=0)
history = gan.fit(real_noise[:, :, 0], num_iterations=60, record_every=1, verbose=False)
rightly_moved = [
    float(np.abs(now - before).max()) for now, before in zip(gan.discriminator.get_weights(), start)
]
print("largest change of each of its weights:", np.round(rightly_moved, 3))
assert min(rightly_moved) > 0

# %%
losses = {
    "compile, freeze, compile": np.array(frozen).T[:2],
    "named weights": (history["loss_real"], history["loss_generated"]),
}
alt = "Loss of the discriminator on real and generated noise: the classic pattern, and named weights"
with drawing(alt, 2, 2.3, sharey=True) as panels:
    for panel, (name, (of_real, of_generated)) in zip(panels, losses.items()):
        panel.plot(of_real, color=REAL, label="real")
        panel.plot(of_generated, color=GENERATED, linestyle="--", label="generated")
        panel.set(title=name, xlabel="iteration", ylabel="loss of the discriminator", ylim=(0, None))
        panel.legend(frameon=False)

# %% [markdown]
# *What to see:* both losses change, so both look like training. On the left only the generator learns, against a discriminator
# that does not: the loss on generated noise *rises*. On the right the discriminator learns to recognise generated noise within a few
# steps.

# %%
first, last = np.array(frozen)[[0, -1], 1], history["loss_generated"][[0, -1]]
print("loss on generated noise, first and last: classic", first.round(2), " named weights", last.round(2))
assert first[1] > first[0] and last[1] < last[0] / 2

# %% [markdown]
# ## Exercises
#
# 1. Keras 3 reads `trainable` when the training step is *built*. Rescue the classic pattern with one added line, and say why you would
#    still not use it.
# 2. Write the test that would have caught this, in at most five lines, for any function that makes a training step.

# %% [markdown] jp-MarkdownHeadingCollapsed=true
# ## Solution

# %%
rescued = build_discriminator(100, filters=32, seed=0)
rescued.compile("adam", "binary_crossentropy")
rescued.train_on_batch(real_noise[:64], real)  # the added line: it builds the step while all is trainable
rescued.trainable = False
before = rescued.get_weights()
rescued.train_on_batch(real_noise[:64], real)
moved = [bool((now != old).any()) for now, old in zip(rescued.get_weights(), before)]
print("moved after the freeze:", moved)
assert all(moved)

# %%
before = rescued.get_weights()
with warnings.catch_warnings(action="ignore"):  # the warning that we know
    rescued.train_on_batch(real_noise[:32], real[:32])  # a new batch shape: the step is built anew
moved = [bool((now != old).any()) for now, old in zip(rescued.get_weights(), before)]
print("moved by a batch of another size:", moved)
assert not any(moved)


# %%
def moves_exactly(step, learns, rests):
    before = [weight.numpy().copy() for weight in learns + rests]
    step()
    moved = [bool((weight.numpy() != old).any()) for weight, old in zip(learns + rests, before)]
    assert moved == [True] * len(learns) + [False] * len(rests)


# %%
rows, tags = keras.ops.convert_to_tensor(real_noise[:64]), keras.ops.ones((64, 1))
learns, rests = gan.discriminator.trainable_variables, gan.generator.trainable_variables
moves_exactly(lambda: gan._update_discriminator(rows, tags), learns, rests)

# %% [markdown]
# <details><summary>What to say about it</summary>
#
# 1. A step that was built keeps the weights it was built with. The rescue works by the same accident that broke the pattern: what is
#    trained depends on *when something was first called*. A new batch shape, another `compile`, a saved and loaded model: each builds
#    the step again, frozen. (Setting `trainable` to `True` and `False` around the calls works no better: what counts is its value when
#    the step is built.)
# 2. Take the weights that should learn and those that should rest, do one step, and compare. The package's own tests do this for both
#    phases over several steps, and turn Keras' UserWarnings into errors. A plot of losses would not have caught it; the left panel
#    above is the proof.
#
# </details>
