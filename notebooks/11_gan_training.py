# %% [markdown]
# # Adversarial training (Figure 11)
#
# **Question:** how can two networks teach each other what noise looks like, although nobody tells the generator what to draw?
#
# - **After this lesson** you can write the whole training loop of a GAN in plain Keras, say which weights each step moves, and watch the
#   noise form.
# - **You should know** the generator (notebook 09) and the discriminator (notebook 10).
# - **Terms:** GAN: *generative adversarial network*; *tags*: the paper's word for labels;
#   [adversarial loss](../docs/glossary.md#adversarial-loss). *Freezing* a network means that a step uses its weights without changing them.
#
# **What the paper says** (section 2.3): two phases an iteration. The discriminator learns from a batch of 200 rows, half of them real ones
# tagged 1.0 and half generated ones tagged 0.0. Then its weights are frozen, "the tags for this pass are reversed, and the discriminator
# is 'told' that the generated values are real"; only the generator moves. About 1,000 iterations are needed.

# %%
import numpy as np
from lesson_tools import check_answer, drawing, open_pipeline, save_film, say, show, slider

from enhsim_tf.common.plot_style import GENERATED, REAL

pipeline, budget = open_pipeline()

# %%
show(pipeline, "fig11_gan_training")

# %% [markdown]
# *What to see:* in each phase exactly one box learns, and the error of the second phase travels *through* the box that does not.

# %%
settings = pipeline.settings
say(
    f"Rows in a batch: {settings.rows}, of which {settings.rows_of_each_kind} are real; latent numbers: {settings.latent}."
)
assert (settings.rows, settings.rows_of_each_kind, settings.latent) == (200, 100, 16)

# %% [markdown]
# ## The whole loop on one page
#
# Two networks, two optimisers, and a step that reads like the figure:

# %%
import keras
import tensorflow as tf
from keras import layers

he = "he_uniform"  # where the author's code has it; elsewhere Keras' default
generator = keras.Sequential(
    [
        keras.Input((16,)),
        layers.Dense(64, activation="relu", kernel_initializer=he),
        layers.BatchNormalization(),
        layers.Dense(500, activation="tanh"),
        layers.Reshape((500, 1)),
    ]
)
discriminator = keras.Sequential(
    [
        keras.Input((500, 1)),
        layers.Conv1D(500, 20, strides=4, activation="relu"),
        layers.Dropout(0.3),
        layers.GlobalMaxPooling1D(),
        layers.Dense(25, activation="relu", kernel_initializer=he),
        layers.Dropout(0.3),
        layers.Dense(1, activation="sigmoid"),
    ]
)

# %%
real_tags, generated_tags = tf.ones((100, 1)), tf.zeros((100, 1))
loss = keras.losses.BinaryCrossentropy()
optimizers = {"discriminator": keras.optimizers.Adam(0.001), "generator": keras.optimizers.Adam(0.001)}
optimizers["discriminator"].build(discriminator.trainable_variables)
optimizers["generator"].build(generator.trainable_variables)


@tf.function  # compiles the step; without this line it does the same, but slower
def train_step(real, latent, latent_again):
    # phase 1: the discriminator learns to tell real rows (tag 1) from generated ones (tag 0), on one batch of both
    rows = tf.concat([real, generator(latent, training=False)], 0)
    tags = tf.concat([real_tags, generated_tags], 0)
    with tf.GradientTape() as tape:
        error = loss(tags, discriminator(rows, training=True))
    weights = discriminator.trainable_variables
    optimizers["discriminator"].apply(tape.gradient(error, weights), weights)

    # phase 2: the tags are reversed, and the discriminator is frozen: its weights are not in the list
    with tf.GradientTape() as tape:
        judged = discriminator(generator(latent_again, training=True), training=True)
        error = loss(tf.ones_like(judged), judged)
    weights = generator.trainable_variables
    optimizers["generator"].apply(tape.gradient(error, weights), weights)


# %% [markdown]
# "Frozen" is not a property of the discriminator here. It means that its weights are missing from the list that the optimiser gets.
# Notebook 20 shows what happens under Keras 3 to those who set the property `trainable` instead.
#
# ## The same numbers as the package
#
# `NoiseGAN` in `enhsim_tf/paper/noise.py` is a Keras model with this step. Both start from the same weights and get the same rows and
# latent vectors; without dropout, whose draws would differ. Adam moves a weight by about its learning rate of 0.001 an iteration. Rounding
# is magnified by Adam, which divides small gradients by their own size; the tolerance after five iterations is one such step.

# %%
import dataclasses

from enhsim_tf.paper.noise import build_discriminator, build_generator, connect

without_dropout = dataclasses.replace(settings, dropout=0.0)
packaged = connect(build_generator(settings), build_discriminator(without_dropout), without_dropout)
generator.set_weights(packaged.generator.get_weights())
discriminator.set_weights(packaged.discriminator.get_weights())
drops = [layer for layer in discriminator.layers if isinstance(layer, layers.Dropout)]
noise = pipeline.noise_windows("train", settings.num_windows, "noise windows")
rng, seeds = np.random.default_rng(0), keras.random.SeedGenerator(settings.seed)


def draw_batch():
    real = tf.constant(rng.choice(noise, 100)[:, :, None])
    latents = (keras.random.normal((number, 16), seed=seeds) for number in (100, 200))
    return real, *(settings.latent_scale * latent for latent in latents)


for drop in drops:
    drop.rate = 0.0
for _ in range(5):
    batch = draw_batch()
    train_step(*batch)
    packaged.train_step(batch[0])  # draws the same latent vectors, because its seed is the same
pairs = ((generator, packaged.generator), (discriminator, packaged.discriminator))
for ours, theirs in ((a, b) for pair in pairs for a, b in zip(*(model.get_weights() for model in pair))):
    np.testing.assert_allclose(ours, theirs, atol=1e-3)

# %% [markdown]
# ## Training, and the noise forming
#
# From here on with dropout, the loop goes on to the paper's number of iterations. Every 20 iterations, we keep what the generator makes
# of the same 500 latent vectors. The *size* of noise is its standard deviation.

# %%
for drop in drops:
    drop.rate = 0.3
train_step = tf.function(
    train_step.python_function
)  # compiled anew, because the first one was compiled without dropout
num_iterations = settings.iterations
latent = settings.latent_scale * np.random.default_rng(0).standard_normal((500, 16), "float32")
every, frames = max(num_iterations // 50, 1), {}

for iteration in range(5, num_iterations + 1):
    if iteration % every == 0 or iteration == 5:
        frames[iteration] = np.asarray(generator(latent, training=False))[:, :, 0]
    if iteration < num_iterations:
        train_step(*draw_batch())

real_sd = noise.std(dtype=float)
share = {iteration: windows.std(dtype=float) / real_sd for iteration, windows in frames.items()}


# %%
def draw(iteration):
    title = f"After {iteration:,} iterations the noise has {share[iteration]:.2f} times the real size"
    with drawing(
        f"Real and generated noise after {iteration} iterations", 2, 1.7, title, sharey=True
    ) as panels:
        panels[0].plot(noise[0], color=REAL, linewidth=0.5)
        panels[0].set(title="real", xlabel="time (s)", ylabel="noise (dimensionless)", ylim=(-1, 1))
        panels[1].plot(frames[iteration][0], color=GENERATED, linewidth=0.5)
        panels[1].set(title="generated, always from the same latent vector", xlabel="time (s)")


recorded = list(frames)
slider(draw, "iteration", recorded, shown=(recorded[0], recorded[len(recorded) // 5], recorded[-1]))

# %% [markdown]
# *What to see:* after five iterations the noise is far too large, and the generator learns first of all to make smaller noise. Later it
# comes near to the real size.

# %%
history = np.array(list(share.values()))
say(
    f"Standard deviation of the generated noise, as a share of the real one: **{history[0]:.1f}** after {recorded[0]} "
    f"iterations, **{history[len(history) // 5]:.1f}** after {recorded[len(history) // 5]}, and **{history[-1]:.2f}** at the end."
)
assert budget == "smoke" or (history[0] > 2 and abs(np.log(history[-1])) < 0.3)

# %% [markdown]
# The same as an animation:

# %%
save_film(frames, real_sd)  # writes the picture below, when the lessons are built

# %% [markdown]
# ![One window of generated noise, which shrinks during training into the band of the real noise](../figures/noise_forming.gif)
#
# ## Which weights move
#
# The claim "the discriminator is frozen while the generator learns" can be tested. With the learning rate of one optimiser at zero, only
# the other network may change:

# %%
networks, moved = {"discriminator": discriminator, "generator": generator}, {}
for phase in networks:
    for name, optimizer in optimizers.items():
        optimizer.learning_rate = 0.001 if name == phase else 0.0
    before = {name: [w.numpy().copy() for w in model.trainable_variables] for name, model in networks.items()}
    train_step(*draw_batch())
    for name, model in networks.items():
        changed = [bool((w.numpy() != old).any()) for w, old in zip(model.trainable_variables, before[name])]
        moved[phase, name] = sum(changed), len(changed)
        print(f"the {phase:13} learns: {sum(changed)} of {len(changed)} weights of the {name} move")
for (phase, name), (number, total) in moved.items():
    assert number == (total if phase == name else 0)

# %% [markdown]
# **Answer.** The discriminator learns from tags, and its gradient tells the generator how to change its windows so that they are taken for
# real. After 1,000 iterations, the noise has about the size of real noise. This is not yet the same as looking real: notebooks 05 and 10
# find differences. (The GAN of notebook 12 is the pipeline's, with other draws, so its curve is another.)
#
# ## Exercises
#
# **1.** "The tags are reversed" is a choice. One could also let the generator *maximise* the discriminator's loss, that is, minimise
# $\ln(1-D)$ instead of $-\ln D$. Complete the two functions with the size of the slope of each loss with respect to the discriminator's
# last sum $a$, where $D=1/(1+e^{-a})$.


# %%
def pull_reversed_tags(D): ...  # your code: |d(−ln D)/da|


def pull_maximised_loss(D): ...  # your code: |d(ln(1 − D))/da|


# %%
sums = np.linspace(-6, 6, 401)


def slope(function):  # by differences, as a check
    return np.abs(np.gradient(function(1 / (1 + np.exp(-sums))), sums))[1:-1]


D = (1 / (1 + np.exp(-sums)))[1:-1]
answer = pull_reversed_tags(D), pull_maximised_loss(D)
check_answer(
    None if any(part is None for part in answer) else answer,
    lambda found: np.allclose(
        found, (slope(lambda d: -np.log(d)), slope(lambda d: np.log(1 - d))), atol=1e-3
    ),
    "The derivative of D with respect to a is D (1 − D). Use the chain rule.",
)

# %% [markdown]
# **2.** The author's code reads the paper otherwise: *two* updates of the discriminator, one on real rows and one on generated ones.
# Write this pair of updates. The check compares it with the package's setting `update="two of 200"`.


# %%
def update_twice(
    discriminator, optimizer, real, generated
): ...  # your code: two steps of the optimizer, first on the real rows; return the second error


# %%
twice = dataclasses.replace(without_dropout, update="two of 200")
judges = [build_discriminator(twice) for _ in range(2)]
reference = connect(build_generator(twice), judges[1], twice)
real_rows = tf.constant(np.random.default_rng(1).choice(noise, 200)[:, :, None])
first_latent = keras.random.normal((200, 16), seed=keras.random.SeedGenerator(settings.seed))
first_latent = settings.latent_scale * first_latent
generated_rows = reference.generator(first_latent, training=False)
error = update_twice(judges[0], keras.optimizers.Adam(0.001), real_rows, generated_rows)
reference.train_step(real_rows)
check_answer(
    error,
    lambda _: all(np.allclose(*w, atol=3e-4) for w in zip(*(judge.get_weights() for judge in judges))),
    "The tags of real rows are tf.ones((200, 1)), those of generated rows tf.zeros((200, 1)).",
)
