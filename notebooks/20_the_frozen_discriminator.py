# %% [markdown]
# # The frozen discriminator: a pitfall of Keras 3
#
# **Question:** why does the classic way to train a GAN teach the discriminator nothing under Keras 3?
#
# - **After this lesson** you can recognise the pitfall in code, explain it, write the step that works, and write the test that would
#   have found it.
# - **You should know** adversarial training (notebook 11).
# - **Terms:** [generator and discriminator](../docs/glossary.md#generator-and-discriminator),
#   [adversarial loss](../docs/glossary.md#adversarial-loss); *freezing* a network: a step uses its weights and does not change them.
#
# **What the paper says** (section 2.3): after the discriminator's turn its "weights are frozen, and the generator is trained as part of the
# entire GAN model". The paper ran on TensorFlow 2.1, and so did the classic way to write that sentence down: compile the discriminator, set
# `trainable = False`, compile the *stack*, which is the generator and the discriminator in one model. Many tutorials have it, [for
# example](https://github.com/eriklindernoren/Keras-GAN/blob/master/gan/gan.py). Under Keras 3 it does not train the discriminator, and
# hardly says so.

# %%
import warnings

import numpy as np
from lesson_tools import check_answer, drawing, open_pipeline, show

from enhsim_tf.common.plot_style import DASHED, GENERATED, REAL

pipeline, budget = open_pipeline()

# %%
import keras
import tensorflow as tf
from keras import layers

print("Keras", keras.__version__)

# %% [markdown]
# ## The plan
#
# In each phase one network learns and the other is frozen:

# %%
show(pipeline, "fig11_gan_training")

# %% [markdown]
# ## The classic pattern
#
# A small pair of networks, the real noise, and sixty iterations.


# %%
def small_pair():
    keras.utils.set_random_seed(0)  # the same first weights each time
    he = {"kernel_initializer": "he_uniform"}
    generator = keras.Sequential(
        [
            keras.Input((16,)),
            layers.Dense(64, "relu", **he),
            layers.BatchNormalization(),
            layers.Dense(100, "tanh", **he),
            layers.Reshape((100, 1)),
        ]
    )
    discriminator = keras.Sequential(
        [
            keras.Input((100, 1)),
            layers.Conv1D(32, 20, strides=4, activation="relu", **he),
            layers.GlobalMaxPooling1D(),
            layers.Dense(25, "relu", **he),
            layers.Dense(1, "sigmoid", **he),
        ]
    )
    return generator, discriminator


real_noise = pipeline.noise_windows("train", 1_000, "notebook")[:, :100, None]
generator, discriminator = small_pair()

discriminator.compile("adam", "binary_crossentropy")
discriminator.trainable = False  # meant for the stack below
stack = keras.Sequential([generator, discriminator])
stack.compile("adam", "binary_crossentropy")

# %% [markdown]
# The loop of the tutorials. As there, the discriminator gets real and generated noise in two updates instead of one. The losses are
# computed separately, before each update.

# %%
rng, real_labels, generated_labels = np.random.default_rng(0), np.ones((64, 1)), np.zeros((64, 1))
loss, start, classic_losses = keras.losses.BinaryCrossentropy(), discriminator.get_weights(), []
with warnings.catch_warnings(record=True) as heard:
    warnings.simplefilter("always")
    for _ in range(60):
        latent = rng.standard_normal((64, 16))
        batches = (
            (rng.choice(real_noise, 64), real_labels),
            (generator.predict_on_batch(latent), generated_labels),
        )
        classic_losses.append([float(loss(labels, discriminator(rows))) for rows, labels in batches])
        for rows, labels in batches:
            discriminator.train_on_batch(rows, labels)
        stack.train_on_batch(latent, real_labels)  # labels reversed

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
# weights, and told it in one warning, once.
#
# ## Why
#
# What a model may train is asked for at another moment than it used to be ([documentation of Keras
# 2](https://github.com/keras-team/keras/blob/2.3.1/docs/templates/getting-started/faq.md)):
#
# | | when is `trainable` read? | so `discriminator.train_on_batch` |
# |---|---|---|
# | Keras 2 (by its documentation) | at `compile`, before the freeze | trains all its weights |
# | Keras 3 | when the training step is first built, after the freeze | trains none |

# %%
models = {"discriminator": discriminator, "stack": stack, "generator": generator}
trainable = {name: len(model.trainable_weights) for name, model in models.items()}
print("trainable weights:", trainable)
assert trainable["discriminator"] == 0 and trainable["stack"] == trainable["generator"]

# %% [markdown]
# If the table is right, a discriminator that is frozen while `compile` runs, and is free again when the step is built, learns:

# %%
_, other = small_pair()
other.trainable = False
other.compile("adam", "binary_crossentropy")
other.trainable = True
before = other.get_weights()
other.train_on_batch(real_noise[:64], real_labels)
learns = [bool((now != old).any()) for now, old in zip(other.get_weights(), before)]
print("weights that moved:", learns)
assert all(learns)

# %% [markdown]
# ## The right way
#
# Do not rely on a moment. Freezing is not a state of a layer but a *list*: the weights that the optimiser is handed. Both updates name
# theirs:

# %%
generator, discriminator = small_pair()
optimizers = [keras.optimizers.Adam(0.001) for _ in range(2)]


def update(optimizer, weights, error):
    with tf.GradientTape() as tape:
        value = error()
    optimizer.apply(tape.gradient(value, weights), weights)  # these weights move, and no others
    return float(value)


rng, named_losses = np.random.default_rng(0), []
for _ in range(60):
    latent = rng.standard_normal((64, 16)).astype("float32")
    batches = (rng.choice(real_noise, 64), real_labels), (generator(latent), generated_labels)
    weights = discriminator.trainable_variables
    named_losses.append(
        [
            update(optimizers[0], weights, lambda: loss(labels, discriminator(rows)))
            for rows, labels in batches
        ]
    )
    weights = generator.trainable_variables
    update(optimizers[1], weights, lambda: loss(real_labels, discriminator(generator(latent, training=True))))

rightly_moved = [float(np.abs(now - before).max()) for now, before in zip(discriminator.get_weights(), start)]
print("largest change of each of its weights:", np.round(rightly_moved, 3))
assert min(rightly_moved) > 0

# %% [markdown]
# `NoiseGAN` in the package lists the discriminator's weights before it freezes it, and trains the generator through a combined model
# (notebook 11 compares it, number by number). Now look at the losses of both ways:

# %%
losses = {
    "compile, freeze, compile: it never learns": np.array(classic_losses),
    "named weights: it learns": np.array(named_losses),
}
alt = "Loss of the discriminator on real and generated noise: the classic pattern, and named weights"
title = "The loss on generated noise always moves; only the right-hand discriminator learns"
with drawing(alt, 2, 2.4, title, sharey=True) as panels:
    for panel, (name, curves) in zip(panels, losses.items()):
        panel.plot(curves[:, 0], color=REAL, label="real noise")
        panel.plot(curves[:, 1], color=GENERATED, linestyle=DASHED, label="generated noise")
        panel.set(title=name, xlabel="iteration", ylim=(0, None))
        panel.legend(frameon=False)
    panels[0].set_ylabel("cross-entropy (nats)")

# %% [markdown]
# *What to see:* in both panels the loss on generated noise moves, which looks like training. On the left it rises, and the loss on real
# noise stands still: only the generator learns. On the right the discriminator learns to recognise generated noise within some twenty
# steps, while its loss on real noise rises at first. (The first losses differ, because the right-hand loop updates on the real noise before
# it computes the loss on generated noise.)

# %%
(classic_first, classic_last), (named_first, named_last) = (
    np.array(curves)[[0, -1], 1] for curves in losses.values()
)
print(f"loss on generated noise, first and last: classic pattern {classic_first:.2f}, {classic_last:.2f}")
print(f"named weights {named_first:.2f}, {named_last:.2f}")
assert classic_last > classic_first and named_last < named_first / 2

# %% [markdown]
# **Answer.** Keras 3 reads `trainable` when the training step is built, which is after the freeze. It is easy to miss: there is one
# warning, and the loss moves all the same, because the generator learns.
#
# ## Exercises
#
# **1.** Keras 3 reads `trainable` when the training step is *built*. Rescue the classic pattern: change one line of the function, or add
# one. Then say why you would still not use it.


# %%
def rescued_pattern():
    _, judge = small_pair()
    judge.compile("adam", "binary_crossentropy")
    # your code: one line
    judge.trainable = False
    return judge


# %%
judge, was = rescued_pattern(), small_pair()[1].get_weights()
with warnings.catch_warnings(action="ignore"):  # the warning that we know
    judge.train_on_batch(real_noise[:64], real_labels)
changed = [bool((now != before).any()) for now, before in zip(judge.get_weights(), was)]
check_answer(
    changed if any(changed) else None,
    lambda moves: all(moves) and not judge.trainable,
    "The step is built at the first call that trains.",
)

# %% [markdown]
# **2.** Write the test that would have found the pitfall, for any function `step()`: return whether it moves *every* weight of the list
# `learns` and *no* weight of the list `rests`.


# %%
def moves_exactly(step, learns, rests): ...  # your code; weight.numpy() is the value of a weight


# %%
def honest():
    update(
        optimizers[0],
        discriminator.trainable_variables,
        lambda: loss(real_labels, discriminator(real_noise[:64])),
    )


def lazy():
    pass


def partial():
    discriminator.trainable_variables[0].assign_add(tf.ones_like(discriminator.trainable_variables[0]))


def greedy():
    honest()
    generator.trainable_variables[0].assign_add(tf.ones_like(generator.trainable_variables[0]))


lists = discriminator.trainable_variables, generator.trainable_variables
answers = [moves_exactly(step, *lists) for step in (honest, lazy, partial, greedy)]
check_answer(
    None if answers[0] is None else answers,
    lambda found: [bool(answer) for answer in found] == [True, False, False, False],
    "Copy all weights before the step, and compare each of them after it.",
)
