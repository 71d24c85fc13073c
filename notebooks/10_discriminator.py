# %% [markdown]
# # Figure 10: the discriminator
#
# **What the paper says** (section 2.3): one convolutional layer "using a window 20 neurons wide with a stride of 4 neurons per step";
# it "pools each convolution based on the maximum value of the sample". Then the layers narrow to one neuron that says real or not.

# %%
import sys

sys.path.insert(0, "..")  # the clone that this notebook lies in

import numpy as np

from enhsim_tf.common.plot_style import COARSE, ENHANCED
from enhsim_tf.reproduce.notebook import claim, drawing, open_experiment, show

experiment = open_experiment()
claim("C5")

# %% [markdown]
# ## How it is built
#
# The paper gives no number of filters; 500 is the author's, in the public code of his 1-D GAN.

# %%
from enhsim_tf.noise.discriminator import build_discriminator

untrained = build_discriminator(window=500, filters=500, width=20, stride=4, narrow_units=25, seed=0)
layers = show(experiment, "fig10_discriminator")

# %% [markdown]
# *What to see:* the maximum in the second row. 121 positions of each filter go in, one number comes out: the discriminator knows that a
# pattern was *somewhere*, not where, and not how often.

# %%
positions = (500 - 20) // 4 + 1
assert str(layers["output_shape"][0]) == f"(None, {positions}, 500)" and positions == 121
assert layers["parameters"].tolist() == [500 * (20 + 1), 0, 25 * (500 + 1), 25 + 1]
assert layers["total"] == untrained.count_params()

# %% [markdown]
# ## What it cannot see
#
# Cut real windows into five blocks of 100 samples and put the blocks into another order. Only the few filter positions across the cuts
# change. Then, for comparison, put all 500 samples into another order.

# %%
discriminator = experiment.simulator.noise.discriminator
real, rng = experiment.data.noise_windows("train", 400, "notebook"), np.random.default_rng(0)
blocks = real.reshape(-1, 5, 100)[:, [3, 0, 4, 2, 1]].reshape(-1, 500)
samples = real[:, rng.permutation(500)]
judged, judged_blocks, judged_samples = (
    discriminator.predict(rows[:, :, None], verbose=0)[:, 0] for rows in (real, blocks, samples)
)

# %%
alt = "Judgement of real windows before and after reordering: blocks, and single samples"
reordered = {"blocks of 100 reordered": judged_blocks, "samples reordered": judged_samples}
with drawing(alt, 2, 2.6, sharex=True, sharey=True) as panels:
    for panel, (name, other) in zip(panels, reordered.items()):
        panel.plot(judged, other, "o", color=ENHANCED, markersize=2, alpha=0.5)
        panel.axline((judged.mean(), judged.mean()), slope=1, color=COARSE, linewidth=0.8)
        panel.set(title=name, xlabel="judged real, as recorded", ylabel="judged real, reordered")

# %% [markdown]
# *What to see:* on the left the points stay on the diagonal. For this discriminator, a window is an unordered set of pieces of 20
# samples. It cannot detect differences over longer stretches, so the generator does not learn to avoid them.

# %%
moved = {name: float(np.mean(np.abs(other - judged))) for name, other in reordered.items()}
print("mean change of the judgement:", {name: round(change, 4) for name, change in moved.items()})
assert moved["blocks of 100 reordered"] < moved["samples reordered"] / 1.5

# %% [markdown]
# It also sees one window at a time. That a thousand windows are all mixtures of the same few shapes (notebook 09) is visible only in
# the thousand together.

# %% [markdown]
# ## Exercises
#
# 1. The package trains with `convolution_maximum`, a fast path for the first two layers. Show on random windows that it computes what
#    the two Keras layers compute.
# 2. What would you change so that the discriminator could notice an effective rank that is too small?

# %% [markdown] jp-MarkdownHeadingCollapsed=true
# ## Solution

# %%
import tensorflow as tf

from enhsim_tf.keras_tools.convolution_maximum import convolution_maximum

convolution, pooling = untrained.layers[:2]
rows = tf.constant(rng.standard_normal((8, 500)), tf.float32)
slow = pooling(convolution(rows[:, :, None])).numpy()
kernel, bias = (tf.convert_to_tensor(weight) for weight in (convolution.kernel, convolution.bias))
fast = convolution_maximum(rows, tf.squeeze(kernel, 1), bias, stride=4).numpy()
print(f"largest difference {np.abs(fast - slow).max():.1e} in numbers up to {slow.max():.1f}")
assert np.allclose(fast, slow, atol=1e-5)

# %% [markdown]
# <details><summary>What to say about it</summary>
#
# 1. Bias and relu grow with their argument, so they may wait until after the maximum: one number a filter instead of 121.
# 2. Two things. Let it see further: more convolutions, dilation, or a mean beside the maximum. And let it see many windows at once:
#    append to each window's features how much they vary over the batch ("minibatch standard deviation"), or judge pairs of windows. A
#    bag of snippets can look perfect one window at a time and still be drawn from a handful of shapes.
#
# </details>
