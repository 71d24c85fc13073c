# %% [markdown]
# # The enhancer (Figure 3)
#
# **Question:** how does a network learn a smooth waveform if all that it is ever shown as a target is noisy?
#
# - **After this lesson** you can write and train the paper's first network in plain Keras, and say from the noise alone how low its loss
#   can fall.
# - **You should know** what a Dense layer and an epoch are. The training pairs are explained in notebook 02.
# - **Terms:** [window](../docs/glossary.md#window), [coarse simulator](../docs/glossary.md#coarse-simulator),
#   [enhancer](../docs/glossary.md#enhancer); *mean squared error* (MSE): $\mathrm{mean}[(\hat x-x)^2]$. *Held-out* windows are from a
#   later time, on which nothing was trained. *Adam*: the rule that turns gradients into steps of the weights.
#
# **What the paper says** (section 2.2): "a wide, shallow Multi-Layer Perceptron" of four Dense layers, the first and the last as wide
# as the window, the two between with 3,200 neurons each, trained for 40 epochs with batches of 15 windows.

# %%
import numpy as np
from lesson_tools import check_answer, drawing, open_pipeline, say, show

from enhsim_tf.common.plot_style import DASHED, ENHANCED, REAL

pipeline, budget = open_pipeline()

# %% [markdown]
# ## The network
#
# A window of 500 coarse samples goes in, and a window of 500 enhanced samples comes out:

# %%
import keras
from keras import layers

enhancer = keras.Sequential(
    [
        keras.Input((500,)),
        layers.Dense(500, activation="relu"),
        layers.Dense(3_200, activation="relu"),
        layers.Dense(3_200, activation="relu"),
        layers.Dense(500),  # linear, since telemetry may have any value
    ]
)
show(pipeline, "fig03_enhancer")

# %% [markdown]
# *What to see:* three quarters of all parameters lie between the two hidden layers. A Dense layer from $m$ to $n$ has $n(m+1)$.

# %%
sizes = [500, 500, 3_200, 3_200, 500]
by_hand = [n * (m + 1) for m, n in zip(sizes[:-1], sizes[1:])]
say(
    f"Parameters: {by_hand}, together **{sum(by_hand):,}**; share of the widest layer: **{max(by_hand) / sum(by_hand):.0%}**."
)
assert by_hand == [layer.count_params() for layer in enhancer.layers]
assert 0.74 < max(by_hand) / sum(by_hand) < 0.76

# %% [markdown]
# ## The training
#
# The inputs are coarse windows, the targets are windows of *noisy* telemetry at the same times. `compile` and `fit` are all that is
# needed. Only the order of the windows is drawn by hand, so that the numbers can be compared with those of the package; Keras' own
# shuffling would do as well.
#
# Set `num_epochs = 40` to train as long as the paper.

# %%
from enhsim_tf.paper.enhancer import build_enhancer

num_windows = pipeline.settings.num_windows
train = pipeline.windows("train", num_windows, "training windows")
held_out = pipeline.windows("test", min(200, num_windows), "validation windows")
num_epochs = 2

enhancer.set_weights(
    build_enhancer(pipeline.settings).get_weights()
)  # the same random start as in the package
enhancer.compile(keras.optimizers.Adam(0.001), loss="mean_squared_error")
rng, losses, held_out_losses = np.random.default_rng(pipeline.settings.seed), [], []
for _ in range(num_epochs):
    order = rng.permutation(num_windows)
    epoch = enhancer.fit(
        train["coarse"][order],
        train["target"][order],
        batch_size=15,
        shuffle=False,
        validation_data=(held_out["coarse"], held_out["target"]),
        verbose=0,
    )
    losses += epoch.history["loss"]
    held_out_losses += epoch.history["val_loss"]

# %% [markdown]
# The package trained the same network for all 40 epochs, with a faster implementation of the same Adam, and kept the loss of every epoch.
# Over two hundred steps, small differences of rounding can grow, and the loss still changes much from epoch to epoch (see the picture
# below), so the first losses need to agree only within 25 %:

# %%
from enhsim_tf.common.stages import load_arrays

history = load_arrays(pipeline.enhancer_folder)
np.testing.assert_allclose(losses[:2], history["loss"][:2], rtol=0.25)
np.testing.assert_allclose(held_out_losses[:2], history["val_loss"][:2], rtol=0.25)
say(
    f"Loss on 200 of the held-out windows after {num_epochs} epochs: **{held_out_losses[-1]:.4f}** here, "
    f"**{history['val_loss'][num_epochs - 1]:.4f}** in the package. After all {len(history['loss'])}: **{history['val_loss'][-1]:.4f}**."
)

# %% [markdown]
# ## How low can the loss fall?
#
# Write the target as $y=\mu(x)+\varepsilon$: the true signal for a coarse window $x$, plus noise of variance $\sigma^2$ that nobody can
# predict from $x$. Then, on windows that the network has not seen,
#
# $$\mathrm{mean}[(f(x)-y)^2]=\mathrm{mean}[(f(x)-\mu(x))^2]+\sigma^2 .$$
#
# So the loss cannot fall below $\sigma^2$, and the best $f$ is $\mu$, the signal *without* noise. That is why a noisy target teaches a
# clean waveform. In this example $\mu$ is known, and the equation can be checked:

# %%
variance = pipeline.settings.noise_sd**2
test = pipeline.windows("test", None)
estimate = pipeline.enhance(test["coarse"]).astype(float)  # the enhancer after 40 epochs
of_target, of_truth = (np.mean((estimate - test[name]) ** 2) for name in ("target", "truth"))
say(
    f"On all held-out windows: {of_target:.5f} measured on telemetry = {of_truth:.5f} on the true signal + {of_target - of_truth:.5f}; "
    f"σ² = {variance:.5f}."
)
assert abs((of_target - of_truth) / variance - 1) < 0.05

# %%
above = history["val_loss"][-1] / variance - 1
epochs = np.arange(1, len(history["loss"]) + 1)
alt = "Training and held-out loss of the enhancer by epoch, and the variance of the noise"
title = f"The held-out loss ends {100 * above:.0f} % above the variance of the noise"
with drawing(alt, height=2.3, title=title) as panel:
    panel.plot(epochs, history["loss"], color=ENHANCED, linestyle=DASHED, label="training windows")
    panel.plot(epochs, history["val_loss"], color=ENHANCED, label="held-out windows")
    panel.axhline(variance, color=REAL, linestyle=":", label="variance of the noise")
    panel.set(xlabel="epoch", ylabel="MSE (dimensionless)")
    panel.legend(frameon=False)

# %% [markdown]
# *What to see:* the held-out loss stays above the dotted line and falls little after about fifteen epochs, here apart from a jump. At the
# end the training loss is lower. Nearly all inputs of the held-out windows also occur in training (notebook 04), so that the error to the
# true signal is about the same in both: only learnt noise can explain the difference. The network has seen it 40 times.

# %%
of_training = np.mean((pipeline.enhance(train["coarse"]) - train["truth"]) ** 2)
say(
    f"Last epoch: training **{history['loss'][-1]:.4f}**, held out (200 windows) **{history['val_loss'][-1]:.4f}**, σ² **{variance:.4f}**. "
    f"To the true signal: training **{of_training:.4f}**, held out (all windows) **{of_truth:.4f}**."
)
assert variance * 0.9 < history["val_loss"][-1] < variance * {"full": 1.3, "smoke": 30}[budget]
assert budget == "smoke" or history["loss"][-1] < history["val_loss"][-1]

# %% [markdown]
# **Answer.** Noise cannot be predicted from the coarse window, so the waveform without noise has the smallest loss. The network comes near
# it, and learns some of the noise of its training windows by heart.
#
# ## Exercises
#
# **1.** How many parameters has the enhancer for a window of $w$ samples? Complete the function.


# %%
def num_parameters(w): ...  # your code


# %%
import dataclasses


def enhancer_of(**changed):
    return build_enhancer(dataclasses.replace(pipeline.settings, **changed))


check_answer(
    num_parameters(500),
    lambda _: all(num_parameters(w) == enhancer_of(window=w).count_params() for w in (100, 500, 1_000)),
    "The layers are w → w → 3,200 → 3,200 → w.",
)

# %% [markdown]
# **2.** A Dense layer does not know that sample 7 comes before sample 8. Prove it: put the samples of all windows, coarse and target,
# into one random order. Permute the initial weights of the network such that its training is *exactly* the same, except that all
# samples are in the other order.

# %%
order = np.random.default_rng(0).permutation(500)


def permuted(weights):
    """From the weights [kernel, bias, kernel, bias, kernel, bias, kernel, bias] of a network to those of the other."""
    ...  # your code: which two kernels and which bias touch samples?


# %%
def trained(weights, order):
    small = enhancer_of(hidden_units=64)
    small.set_weights(weights)
    small.compile(keras.optimizers.Adam(0.001), loss="mean_squared_error")
    source, target = (train[name][:60][:, order] for name in ("coarse", "target"))
    return small.fit(source, target, batch_size=15, epochs=3, shuffle=False, verbose=0).history["loss"]


start = enhancer_of(hidden_units=64, seed=1).get_weights()
check_answer(
    permuted(start),
    lambda weights: np.allclose(trained(weights, order), trained(start, np.arange(500)), rtol=1e-3),
    "The first kernel has a row for each input sample, the last kernel a column for each output sample.",
)
