# %% [markdown]
# # Figure 3: the enhancer
#
# **What the paper says** (section 2.2): "a wide, shallow Multi-Layer Perceptron" of four Dense layers, the first and the last as wide
# as the window, the two between with 3,200 neurons each.

# %%
import sys

sys.path.insert(0, "..")  # the clone that this notebook lies in

import numpy as np

from enhsim_tf.common.plot_style import COARSE, ENHANCED, REAL
from enhsim_tf.reproduce.notebook import claim, open_experiment, show

experiment = open_experiment()
claim("C1")

# %% [markdown]
# ## How it is built
#
# One call; every size is an argument. The layer table of the figure is read from the trained model itself.

# %%
from enhsim_tf import build_enhancer

enhancer = build_enhancer(window=500, hidden_units=3_200, num_hidden=2, seed=0)
layers = show(experiment, "fig03_enhancer")

# %% [markdown]
# *What to see:* three quarters of all parameters lie between the two hidden layers. A Dense layer from $m$ to $n$ has $n(m+1)$.

# %%
sizes = [500, 500, 3_200, 3_200, 500]
by_hand = [n * (m + 1) for m, n in zip(sizes[:-1], sizes[1:])]
print(by_hand, "sum", f"{sum(by_hand):,}; share of the widest {max(by_hand) / sum(by_hand):.1%}")
assert by_hand == layers["parameters"].tolist() and sum(by_hand) == enhancer.count_params() == 13_697_400
assert 0.74 < max(by_hand) / sum(by_hand) < 0.76

# %% [markdown]
# ## How it is trained
#
# Mean squared error, Adam, batches of 15 windows. The target is the *noisy* telemetry. That works, because the best prediction in the
# least-squares sense is the conditional mean, and noise has mean zero. Here is the loss of every epoch, with that reasoning as a
# dotted line: no network can get below the variance of the noise on windows it has not seen.

# %%
from enhsim_tf.reproduce.notebook import drawing

history, floor = experiment.enhancer_history, experiment.settings.telemetry.noise_sd**2
alt = "Training and held-out loss of the enhancer by epoch, above the variance of the noise"
with drawing(alt, height=2.0) as panel:
    epochs = np.arange(1, len(history["loss"]) + 1)
    panel.plot(epochs, history["loss"], color=COARSE, label="training")
    panel.plot(epochs, history["val_loss"], color=ENHANCED, label="held out")
    panel.axhline(floor, color=REAL, linestyle=":", label="variance of the noise")
    panel.set(xlabel="epoch", ylabel="mean squared error", yscale="log")
    panel.legend(frameon=False)

# %% [markdown]
# *What to see:* the loss sinks close to the variance of the noise, and held-out windows fare about as well as those trained on.

# %%
last = {key: float(history[key][-1]) for key in ("loss", "val_loss")}
print({key: round(value, 4) for key, value in last.items()}, "variance of the noise:", round(floor, 4))
assert floor * 0.9 < last["val_loss"] < floor * {"full": 1.3, "smoke": 30}[experiment.settings.budget]

# %% [markdown]
# ## Exercises
#
# 1. How many parameters has the enhancer for windows of 1,000 samples? For windows of 2,000? Which of them does a longer window not
#    touch?
# 2. A Dense layer does not know that sample 7 comes before sample 8. Show it: train a small enhancer on pairs whose samples were put
#    into one random order, the same for all windows, and compare its error with that of one trained on the pairs as they are.

# %% [markdown] jp-MarkdownHeadingCollapsed=true
# ## Solution

# %%
for window in (500, 1_000, 2_000):
    model = build_enhancer(window)
    between = model.layers[2].count_params()
    print(f"{window:5} samples: {model.count_params():12,} parameters, {between:,} between the hidden layers")

# %%
from enhsim_tf.keras_tools.training import fit_windows
from enhsim_tf.realism.measures import nrmse

train, test = (experiment.data.windows(part, 150, f"exercise, {part}") for part in ("train", "test"))
shuffled = np.random.default_rng(0).permutation(500)
for name, order in {"in order": np.arange(500), "shuffled": shuffled}.items():
    model = build_enhancer(hidden_units=64, seed=1)
    source, target = train["coarse"][:, order], train["target"][:, order]
    fit_windows(model, source, target, epochs=20, batch_size=15, seed=1, verbose=0, jit_compile=False)
    estimate = model.predict(test["coarse"][:, order], verbose=0)
    print(f"{name}: error {nrmse(estimate, test['truth'][:, order]):.3f}")

# %% [markdown]
# <details><summary>What to say about it</summary>
#
# 1. Only the layer between the two hidden ones stays as it is. The first layer grows with the square of the window, the two that join
#    it to the hidden layers in proportion.
# 2. Both errors agree up to the luck of initial weights. The network learns which of its 500 inputs go with which of its 500 outputs,
#    and would learn it in any order. It follows that it gets nothing for free from smoothness in time: neighbouring outputs agree only
#    as far as the data taught it. Notebook 04 shows what that leaves behind.
#
# </details>
