# %% [markdown]
# # Adversarial training (Figure 11)
#
# **Question:** how can two networks teach each other what noise looks like, although nobody tells the generator what to draw?
#
# - **After this lesson** you can write the whole training loop of a GAN in plain Keras, say which weights each step moves, and watch the
#   noise form.
# - **You should know** the generator (notebook 09) and the discriminator (notebook 10).
# - **Terms:** GAN: *generative adversarial network*; [adversarial loss](../docs/glossary.md#adversarial-loss). *Freezing* a network
#   means that a step uses its weights without changing them.
#
# **What the paper says** (section 2.3): two phases an iteration. The discriminator learns from 200 real rows tagged 1.0 and 200
# generated rows tagged 0.0. Then its weights are frozen, "the tags for this pass are reversed, and the discriminator is 'told' that the
# generated values are real"; only the generator moves. About 1,000 iterations are needed.

# %%
import numpy as np
from lesson_tools import ROOT, check_answer, claim, drawing, open_pipeline, say, show, slider

from enhsim_tf.common.plot_style import GENERATED, REAL

pipeline, budget = open_pipeline()
claim("C4", "C5")

# %%
numbers = show(pipeline, "fig11_gan_training")

# %% [markdown]
# *What to see:* in each phase exactly one box learns, and the error of the second phase travels *through* the box that does not.

# %%
say(f"Rows of each kind in a batch: {int(numbers['batch_size'])}; latent numbers: {int(numbers['latent'])}.")
assert numbers["batch_size"] == 200 and numbers["latent"] == 16 and not numbers["mixed_batch"]

# %% [markdown]
# ## The whole loop on one page
#
# Two networks, two optimisers, and a step that reads like the figure:

# %%
import keras
import tensorflow as tf
from keras import layers

he = "he_uniform"
generator = keras.Sequential(
    [
        keras.Input((16,)),
        layers.Dense(64, activation="relu", kernel_initializer=he),
        layers.BatchNormalization(),
        layers.Dense(500, activation="tanh", kernel_initializer=he),
        layers.Reshape((500, 1)),
    ]
)
discriminator = keras.Sequential(
    [
        keras.Input((500, 1)),
        layers.Conv1D(500, 20, strides=4, activation="relu", kernel_initializer=he),
        layers.GlobalMaxPooling1D(),
        layers.Dense(25, activation="relu", kernel_initializer=he),
        layers.Dense(1, activation="sigmoid", kernel_initializer=he),
    ]
)

# %%
real_tags, generated_tags = tf.ones((200, 1)), tf.zeros((200, 1))
loss = keras.losses.BinaryCrossentropy()
optimizers = {"discriminator": keras.optimizers.Adam(0.001), "generator": keras.optimizers.Adam(0.001)}
optimizers["discriminator"].build(discriminator.trainable_variables)
optimizers["generator"].build(generator.trainable_variables)


@tf.function  # compiles the step; without this line it does the same, but slower
def train_step(real, latent, latent_again):
    # phase 1: the discriminator learns to tell real rows (tag 1) from generated ones (tag 0)
    generated = generator(latent, training=False)
    for rows, tags in ((real, real_tags), (generated, generated_tags)):
        with tf.GradientTape() as tape:
            error = loss(tags, discriminator(rows, training=True))
        weights = discriminator.trainable_variables
        optimizers["discriminator"].apply(tape.gradient(error, weights), weights)

    # phase 2: the tags are reversed, and the discriminator is frozen: its weights are not in the list
    with tf.GradientTape() as tape:
        error = loss(real_tags, discriminator(generator(latent_again, training=True), training=True))
    weights = generator.trainable_variables
    optimizers["generator"].apply(tape.gradient(error, weights), weights)


# %% [markdown]
# "Frozen" is not a property of the discriminator here. It means that its weights are missing from the list that the optimiser gets.
# Notebook 20 shows what happens under Keras 3 to those who set the property `trainable` instead.
#
# ## The same numbers as the package
#
# `NoiseGAN` in `enhsim_tf/noise/gan.py` has this loop. Both start from the same weights and draw the same rows and latent vectors. After
# five iterations Adam has moved weights by up to 0.01. Rounding is magnified by Adam, which divides small gradients by their own size;
# the tolerance is a tenth of that movement.

# %%
from enhsim_tf import NoiseGAN

noise = pipeline.noise_windows("train", pipeline.settings.num_windows, "noise windows")
rows = tf.constant(noise[:, :, None])
packaged = NoiseGAN(*experiment.untrained_noise_networks(), batch_size=200, seed=0)
generator.set_weights(packaged.generator.get_weights())
discriminator.set_weights(packaged.discriminator.get_weights())
seeds = keras.random.SeedGenerator(0)


def draw_batch():
    real = tf.gather(rows, keras.random.randint((200,), 0, len(noise), seed=seeds))
    return real, keras.random.normal((200, 16), seed=seeds), keras.random.normal((200, 16), seed=seeds)


for _ in range(5):
    train_step(*draw_batch())
packaged.fit(noise, num_iterations=5, verbose=False)
pairs = ((generator, packaged.generator), (discriminator, packaged.discriminator))
for ours, theirs in ((a, b) for pair in pairs for a, b in zip(*(model.get_weights() for model in pair))):
    np.testing.assert_allclose(ours, theirs, atol=1e-3)

# %% [markdown]
# ## Training, and the noise forming
#
# The loop goes on to the paper's number of iterations. Every 20 iterations, we keep what the generator makes of the same 500 latent
# vectors.

# %%
num_iterations = pipeline.settings.iterations
latent = np.random.default_rng(0).standard_normal((500, 16), "float32")
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
    title = f"After {iteration} iterations, the generated noise has {share[iteration]:.2f} times the real standard deviation"
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
# *What to see:* the untrained generator fills the whole range of its tanh. The discriminator recognises that at once, and the generator
# learns first of all to make smaller noise.

# %%
history = np.array(list(share.values()))
say(
    f"Standard deviation of the generated noise, as a share of the real one: **{history[0]:.1f}** after {recorded[0]} "
    f"iterations, **{history[len(history) // 5]:.1f}** after {recorded[len(history) // 5]}, and **{history[-1]:.2f}** at the end."
)
assert budget == "smoke" or (history[0] > 2 and abs(np.log(history[-1])) < 0.3)

# %% [markdown]
# The same as an animation, which the next cell writes at full budget:

# %%
import matplotlib.pyplot as plt
from matplotlib.animation import FuncAnimation, PillowWriter

if budget == "full":
    figure, panel = plt.subplots(figsize=(5.6, 2.2), dpi=80, layout="constrained")
    (line,) = panel.plot(frames[recorded[0]][0], color=GENERATED, linewidth=0.6)
    panel.axhspan(-2 * real_sd, 2 * real_sd, color=REAL, alpha=0.12, linewidth=0, label="±2 sd of real noise")
    panel.set(xlabel="time (s)", ylabel="noise (dimensionless)", ylim=(-1, 1), xlim=(0, 500))
    panel.legend(frameon=False, loc="lower right")

    def redraw(iteration):
        line.set_ydata(frames[iteration][0])
        panel.set_title(
            f"The noise forms: iteration {iteration:,}", loc="left", fontweight="bold", fontsize=10
        )

    film = FuncAnimation(figure, redraw, recorded[::2] + recorded[-1:] * 5)
    film.save(ROOT / "figures" / "noise_forming.gif", PillowWriter(fps=4))
    plt.close(figure)

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
# **2.** "It then trains on the entire batch" could also mean *one* update of the discriminator on 400 mixed rows instead of two on 200
# each. Write this update. The check compares it with the package's setting `mixed_batch`.


# %%
def update_on_mixed_batch(
    discriminator, optimizer, real, generated
): ...  # your code: one step of the optimizer; return the error


# %%
judges = [experiment.untrained_noise_networks()[1] for _ in range(2)]
maker = experiment.untrained_noise_networks()[0]
reference = NoiseGAN(maker, judges[1], mixed_batch=True, seed=0)
draws = keras.random.SeedGenerator(0)
real_rows = tf.gather(rows, keras.random.randint((200,), 0, len(noise), seed=draws))
generated_rows = maker(keras.random.normal((200, 16), seed=draws), training=False)
error = update_on_mixed_batch(judges[0], keras.optimizers.Adam(0.001), real_rows, generated_rows)
reference.fit(noise, num_iterations=1, verbose=False)
check_answer(
    error,
    lambda _: all(np.allclose(*w, atol=3e-4) for w in zip(*(judge.get_weights() for judge in judges))),
    "Join rows and tags with tf.concat(..., 0), and take one gradient of the loss of all 400.",
)

# %% [markdown]
# ## Solution
#
# <details><summary>1. The pull on the generator</summary>
#
# ```python
# def pull_reversed_tags(D):
#     return 1 - D
#
#
# def pull_maximised_loss(D):
#     return D
# ```
#
# Early in training the discriminator is sure: D is near 0 for generated rows. There the maximised loss is flat and teaches nothing,
# while the reversed tags pull with full strength. Both have their optimum in the same place.
#
# </details>

# %% [markdown]
# <details><summary>2. One mixed update</summary>
#
# ```python
# def update_on_mixed_batch(discriminator, optimizer, real, generated):
#     all_rows, tags = tf.concat([real, generated], 0), tf.concat([real_tags, generated_tags], 0)
#     with tf.GradientTape() as tape:
#         error = loss(tags, discriminator(all_rows, training=True))
#     weights = discriminator.trainable_variables
#     optimizer.apply(tape.gradient(error, weights), weights)
#     return float(error)
# ```
#
# Two updates take two steps of Adam in the time of one, so the discriminator learns faster with them. The paper's text leaves it open;
# the author's public code takes two. The setting of the reproduction is `adversarial.mixed_batch`, so that you can try what it changes.
#
# </details>
