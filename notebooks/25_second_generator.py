# %% [markdown]
# # A second generator: why does the judge matter more than the generator?
#
# **Question:** the paper's GAN matches the size of the noise and still fills few of its dimensions. Who should have noticed?
#
# - **After this lesson** you can say what a discriminator can and cannot see, fit noise without any adversary (by least squares, and by a
#   network that maximises a likelihood), and compare generators by measures with a floor.
# - **You should know** the generator and discriminator (notebooks 09 and 10), the effective rank and the real-vs-real baseline
#   (notebook 21).
# - **Terms:** [effective rank](../docs/glossary.md#effective-rank), [AUC](../docs/glossary.md#auc),
#   [real-vs-real baseline](../docs/glossary.md#real-vs-real-baseline), also *floor*; *autoregression*: each sample is predicted from the
#   samples before it; *likelihood*: the probability density that a model gives to data that it did not generate.
#
# **What the paper says** (section 2.3): one convolutional layer, which "pools each convolution based on the maximum value of the sample",
# and narrow layers after it decide whether a window is real.
# The generator learns from this decision alone. What the discriminator does not see, the generator need not get right.

# %%
import numpy as np
from lesson_tools import check_answer, drawing, open_experiment, open_study, say

from enhsim_tf.common.plot_style import AVERAGE, DASHED, ENHANCED, GENERATED, QUIET, REAL
from enhsim_tf.realism import measures, two_sample

experiment = open_experiment()
is_full = experiment.settings.budget == "full"
number = 1_000 if is_full else 60
window = 500
learnt = experiment.data.noise_windows("train", number, "second generator")
real = experiment.data.noise_windows("test", None)[:number]
gan = experiment.simulator.noise.generate(number, seed=25)

# %% [markdown]
# ## What each judge can see
#
# The paper's discriminator looks at pieces of 20 samples, and keeps of each filter its *largest* response in the window (notebook 10). So
# it forgets where a piece was and what else was in the window. Three other judges get the same windows. One sees each sample at its place,
# another the power spectrum of each window, both through a linear classifier that is cross-validated. The third knows the 20 largest
# directions of further windows of the GAN and measures the share of a window's power outside them. A judge's AUC is the probability that it
# ranks a generated window above a real one; the floor is the AUC between two sets of real windows.


# %%
def discriminator(windows):
    """Probability that a window is generated, from the discriminator that the generator was trained against."""
    noise = experiment.simulator.noise
    return -noise.discriminator.predict(windows[:, :, None] / noise.scale, verbose=0)[:, 0]


further = experiment.simulator.noise.generate(number, seed=26)
directions = np.linalg.svd(further - further.mean(axis=0), full_matrices=False)[2][:20]


def share_outside(windows):
    centred = windows - further.mean(axis=0)
    return np.sum((centred - centred @ directions.T @ directions) ** 2, axis=1) / np.sum(centred**2, axis=1)


def auc(generated_scores, real_scores):
    """The probability that a generated window scores higher than a real one."""
    return np.mean(generated_scores[:, None] > real_scores[None, :])


def spectrum(windows):
    return np.log(np.abs(np.fft.rfft(windows * np.hanning(window), axis=1)[:, 1:]) ** 2 + 1e-12)


judges = {
    "the paper's discriminator": lambda a, b: auc(discriminator(a), discriminator(b)),
    "values at their places": lambda a, b: two_sample.linear_classifier(a, b).auc,
    "power spectrum": lambda a, b: two_sample.linear_classifier(spectrum(a), spectrum(b)).auc,
    "outside 20 directions": lambda a, b: auc(-share_outside(a), -share_outside(b)),
}
found = {name: (judge(gan, real), judge(learnt, real)) for name, judge in judges.items()}

# %%
best = max(found, key=lambda name: found[name][0])
own = found["the paper's discriminator"][0]
title = f"The paper's discriminator has an AUC of {own:.2f} on its own generator, the best judge {found[best][0]:.2f}"
alt = "AUC of four judges that tell the GAN's noise from real noise, each with its floor"
with drawing(alt, height=1.9, title=title) as panel:
    places = np.arange(len(found))
    values, floors = zip(*found.values())
    bars = panel.barh(places, values, 0.55, color=GENERATED, label="GAN against real")
    panel.plot(floors, places, "|", color=REAL, markersize=16, label="floor: real against real")
    panel.bar_label(bars, [f"{value:.2f}" for value in values], padding=3)
    panel.set_yticks(places, list(found))
    panel.invert_yaxis()
    panel.set(xlabel="AUC (0.5: cannot tell; 1: always right)", xlim=(0, 1.15))
    panel.legend(frameon=False, loc="upper left", bbox_to_anchor=(1, 1))

# %% [markdown]
# *What to see:* all judges look at the same windows, and do not see the same. The judge that knows the GAN's directions separates the two
# kinds at a glance, and no training of a network is needed for it. A second fact shows what the paper's judge ignores: move a window by 100
# samples, and its decision hardly changes.

# %%
moved, plain = discriminator(np.roll(real, 100, axis=1)), discriminator(real)
alike = np.corrcoef(moved, plain)[0, 1]
say(
    f"Correlation of the discriminator's output for real windows with that for the same windows, moved by 100 samples: **{alike:.2f}**."
)
say("AUC and floor: " + "; ".join(f"{name} **{a:.2f}** ({b:.2f})" for name, (a, b) in found.items()) + ".")
assert not is_full or (found["outside 20 directions"][0] > 0.95 and alike > 0.5)

# %% [markdown]
# There are two ways out. One is a better judge; the package's convolutional GAN has a discriminator that also sees the spectrum and
# summary statistics of the whole window (`noise/convolutional_gan.py`). The other is no judge at all, and that is what the rest of this
# lesson does.
#
# ## The strong simple baseline: an autoregression by least squares
#
# Predict each sample from the $p$ samples before it, $\hat x_t=\sum_i a_i x_{t-i}$. Least squares needs only the covariances $r_i$ of
# samples that are $i$ apart: $\sum_j r_{|i-j|}a_j=r_i$. The order $p$ is *tuned*: Akaike's criterion adds 2 for each coefficient to
# $n\ln\sigma_p^2$, where $\sigma_p^2$ is the variance of the prediction error and $n$ the number of samples. Noise is generated by running
# the prediction, with a Gaussian error of this variance at each step.

# %%
from scipy.linalg import toeplitz
from scipy.signal import lfilter


def fit_autoregression(windows, max_order):
    r = measures.lagged_products(windows, max_order).mean(axis=0)
    fits = [(windows.size * np.log(r[0]), np.zeros(0), r[0])]
    for p in range(1, max_order + 1):
        coefficients = np.linalg.solve(toeplitz(r[:p]), r[1 : p + 1])
        variance = r[0] - coefficients @ r[1 : p + 1]
        fits.append((windows.size * np.log(variance) + 2 * p, coefficients, variance))
    return min(fits, key=lambda fit: fit[0])[1:]


def run_autoregression(coefficients, variance, num_windows, rng):
    steps = np.sqrt(variance) * rng.standard_normal((num_windows, window + 1_000))
    return lfilter([1.0], np.concatenate([[1.0], -coefficients]), steps, axis=1)[:, 1_000:]


from enhsim_tf.noise.surrogates import GaussianAutoregression

rng = np.random.default_rng(0)
example = run_autoregression(np.array([0.9, -0.5]), 1.0, 300, rng)
mine, theirs = fit_autoregression(example, 20)[0], GaussianAutoregression.fit(example, 20).coefficients
padded = [np.pad(each, (0, 20 - len(each))) for each in (mine, theirs)]
np.testing.assert_allclose(*padded, atol=0.02)  # the package uses Burg's method: other weights at the edges

# %% [markdown]
# ## A network without an adversary
#
# The autoregression predicts one number and assumes Gaussian errors. A network can predict the whole *distribution* of the next sample: a
# mixture of 8 bell curves (Student's t, which allows heavy tails). Its inputs are what has happened in the window so far: the last 64
# samples one by one, and averages of the values and of their magnitudes over the last 2, 4, 8, ... samples.

# %%
import tensorflow as tf
from scipy.special import gammaln

from enhsim_tf.keras_tools.backend import keras
from enhsim_tf.noise.autoregressive_network import AutoregressiveNetwork


def past_of(values, place, window):
    """What the network sees of windows of shape (rows, samples) before the sample at `place`."""
    num_lags = min(64, window)
    lags = np.pad(values[:, :place], ((0, 0), (num_lags, 0)))[:, ::-1][:, :num_lags]
    pieces = [values[:, max(place - 2**j, 0) : place] for j in range(1, int(np.log2(window)) + 1)]
    means, sizes = (
        np.stack([np.sum(f(piece), axis=1) / max(piece.shape[1], 1) for piece in pieces], axis=1)
        for f in (np.asarray, np.abs)
    )
    age = np.tile([place / window, 1 / np.sqrt(1 + place)], (len(values), 1))
    return np.concatenate([lags, means, np.log(sizes + 1e-3), age], axis=1).astype("float32")


def build_density(num_features, num_linear):
    past = keras.Input((num_features,))
    linear = keras.layers.Dense(1, name="linear")(past[:, :num_linear])
    hidden = keras.ops.clip(past, -6, 6)
    hidden = keras.layers.Dense(64, "swish", name="first")(hidden)
    hidden = keras.layers.Dense(64, "swish", name="second")(hidden)
    shares, shifts, log_scales = keras.ops.split(keras.layers.Dense(24, name="last")(hidden), 3, axis=1)
    shares = shares + np.array([-6.0] * 4 + [0.0] * 4, "float32")  # four components start rare
    return keras.Model(past, [shares, linear + shifts, keras.ops.clip(log_scales, -6, 3)])


def negative_log_likelihood(network, degrees, past, sample):
    shares, means, log_scales = network(past)
    z = (sample[:, None] - means) / tf.exp(log_scales)
    # the height of each bell curve, a small difference of large numbers: in double precision
    height = gammaln((degrees + 1) / 2) - gammaln(degrees / 2) - np.log(np.pi * degrees) / 2
    bell = height.astype("float32") - (degrees + 1) / 2 * tf.math.log1p(z**2 / degrees) - log_scales
    return -tf.reduce_mean(tf.reduce_logsumexp(tf.nn.log_softmax(shares) + bell, axis=1))


# %% [markdown]
# Training makes this number small, with Adam and nothing else: no second network, no equilibrium, and a loss that says how good the model
# is. The package's network does six things more. Its density starts from the best linear prediction of the sample, which is that of an
# autoregression as above, and from one of the size of its error. It also sees how loud each octave of the spectrum has recently been, with
# all inputs standardised. After training, what it takes from the past is shrunk until held-out
# windows gain from it: a network with thousands of weights finds a little structure even in white noise. The shape of the density is
# corrected by how often real samples lie below each of its quantiles. Generated noise continues a piece of real noise, from which it takes
# slow states such as its loudness. And of four generated windows, one is drawn in proportion to how much more often such windows are real,
# if there are enough windows to learn this. On a small instance without all this, with the package's weights, the loss at some positions
# must be that of the package:

# %%
tiny = AutoregressiveNetwork.untrained(example[:100, :40], seed=1, sees_predictions=False, sees_changes=False)
tiny.fit(example[:100, :40], 20)
names = ("linear", "first", "second", "last")
first_input = past_of(example[:1, :40], 0, 40)
network = build_density(first_input.shape[1], len(tiny.network.get_layer("linear").get_weights()[0]))
for name in names:
    network.get_layer(name).set_weights(tiny.network.get_layer(name).get_weights())
degrees = tiny.degrees
values = (example[:100, :40] / tiny.scale).astype("float32")
positions = (0, 1, 7, 30)
mine = [
    negative_log_likelihood(network, degrees, past_of(values, place, 40), values[:, place])
    for place in positions
]
nothing = tf.zeros((100, 0)), tf.zeros((100, 40, 0))  # neither a signal nor predictions
theirs = tiny._loss(tf.constant(values), *nothing, tf.constant(positions, tf.int32))
np.testing.assert_allclose(np.mean(mine), theirs.numpy(), rtol=1e-4)
with tf.GradientTape() as tape:  # one step of training
    loss = negative_log_likelihood(network, degrees, past_of(values, 30, 40), values[:, 30])
gradients = tape.gradient(loss, network.trainable_variables)
assert all(gradient is not None for gradient in gradients)

# %% [markdown]
# Generating is the same in the other direction: draw a component, draw the sample from its bell curve, append it to the past, and repeat.
# With the same random numbers, this must give the windows of the package:


# %%
def generate(network, degrees, num_windows, window, limit, rng):
    values = np.zeros((num_windows, window), "float32")
    rows = np.arange(num_windows)
    for place in range(window):
        shares, means, log_scales = (each.numpy() for each in network(past_of(values, place, window)))
        heights = np.cumsum(np.exp(shares - shares.max(axis=1, keepdims=True)), axis=1)
        chosen = np.sum(rng.random(num_windows)[:, None] * heights[:, -1:] > heights, axis=1)
        bell = rng.standard_normal(num_windows)
        bell = bell / np.sqrt(2 * rng.standard_gamma(degrees[chosen] / 2) / degrees[chosen])
        sample = means[rows, chosen] + np.exp(log_scales[rows, chosen]) * bell
        values[:, place] = np.clip(sample, -limit, limit)
    return values


mine = tiny.scale * generate(network, degrees, 5, 40, tiny.limit, np.random.default_rng(3))
np.testing.assert_allclose(mine, tiny.generate(5, 3), rtol=1e-2, atol=1e-3)

# %% [markdown]
# ## Five generators on two noises
#
# The first noise is that of the paper's example, and white: the difference of telemetry and true signal. The second was not designed for
# anyone here: *interference*, a sine whose phase wanders, on white noise, as from the mains or a reaction wheel. Every generator learns
# from the same windows. *Residual windows* draws whole windows of them again, with replacement. The paper's GAN learned from the noise that
# a moving average extracts (notebook 08), and is compared with that.

# %%
from studies.common.noise_gallery import GALLERY

wheel = GALLERY["interference"].draw(2 * number * window, np.random.default_rng(7)).reshape(2, number, window)
parts = [experiment.data.windows("train", number, "second generator"), experiment.data.windows("test", None)]
white_noise = [(windows["target"] - windows["truth"])[:number] for windows in parts]
noises = {"white": tuple(white_noise), "interference": tuple(wheel.astype("float32"))}
num_iterations = 800 if is_full else 4
networks, made = {}, {}
for kind, (train, _) in noises.items():
    rng = np.random.default_rng(11)
    networks[kind] = AutoregressiveNetwork.untrained(train, seed=0).fit(train, num_iterations)
    made[kind] = {
        "Gaussian": train.std() * rng.standard_normal(train.shape),
        "autoregression": run_autoregression(*fit_autoregression(train, 60), number, rng),
        "residual windows": train[rng.integers(0, number, number)],
        "network, likelihood": networks[kind].generate(number, rng),
    }
made["white"]["paper's GAN"] = gan
compared = {"paper's GAN": real}  # all others with the test windows of their noise

# %%
table = {}
for kind, (train, test) in noises.items():
    print(f"{kind:22}{'sd':>8}{'lag-1':>9}{'rank':>7}{'AUC':>7}")
    for name, windows in {"real, test": test, "real, training (floor)": train, **made[kind]}.items():
        lag = measures.autocorrelation(windows, 1)[1]
        row = (
            windows.std(),
            lag,
            measures.effective_rank(windows),
            two_sample.two_sample_auc(windows, compared.get(name, test), 0),
        )
        table[kind, name] = row
        shown = "" if name == "real, test" else f"{row[3]:7.2f}"
        print(f"  {name:22}{row[0]:6.3f}{lag:9.3f}{row[2]:7.0f}{shown}")

# %%
looks = {
    "Gaussian": (QUIET, ".."),
    "autoregression": (AVERAGE, "//"),
    "residual windows": (ENHANCED, ""),
    "network, likelihood": (GENERATED, "xx"),
    "paper's GAN": ("#8c4a00", "--"),
}
best = {kind: min(made[kind], key=lambda name: abs(table[kind, name][3] - 0.5)) for kind in noises}
title = "Hardest to tell from real: " + "; ".join(f"{name} (on {kind})" for kind, name in best.items())
alt = "AUC of a classifier that tells generated from real noise, by generator, for two kinds of noise, with the floor"
with drawing(alt, 2, 2.3, title, sharex=True) as panels:
    for panel, (kind, generators) in zip(panels, made.items()):
        for place, name in enumerate(generators):
            color, hatch = looks[name]
            panel.barh(place, table[kind, name][3], 0.6, color=color, hatch=hatch, edgecolor="white")
        panel.axvline(table[kind, "real, training (floor)"][3], color=REAL, linestyle=DASHED, label="floor")
        panel.set_yticks(range(len(generators)), list(generators))
        panel.invert_yaxis()
        panel.set_title(kind, loc="left")
        panel.set(xlabel="AUC (0.5: cannot tell)", xlim=(0, 1))
        panel.legend(frameon=False, fontsize=7, loc="lower right", bbox_to_anchor=(1, 0.98))

# %% [markdown]
# *What to see:* white noise has nothing to learn but one number, so Gaussian noise passes, and no network can be worth its training. On
# interference it fails. The autoregression has the spectrum by construction, but not the sine: Gaussian noise with such a spectrum is a
# sine whose *amplitude* comes and goes, and the real one keeps its amplitude. The network could learn that from the likelihood alone.
#
# Residual windows are real, and are recognised all the same. A window that is drawn twice can be in the training data of the classifier and
# among the windows that it judges; it need only remember (the trap of notebook 26). If each window is used once, what remains is the floor.
# The package therefore draws no window twice, and none that overlaps with one drawn before, while others are left.

# %%
white, other = noises
for kind in noises:
    floor = table[kind, "real, training (floor)"]
    passed = [name for name in made[kind] if abs(table[kind, name][3] - 0.5) <= abs(floor[3] - 0.5) + 0.05]
    say(
        f"*{kind}*: within 0.05 of the floor's AUC are **{', '.join(passed) or 'none'}**. Effective rank, as a share of the real one: "
        + ", ".join(
            f"{name} **{table[kind, name][2] / table[kind, 'real, test'][2]:.0%}**" for name in made[kind]
        )
        + "."
    )
drawn_twice = 1 - len(np.unique(made[white]["residual windows"], axis=0)) / number
trace = two_sample.two_sample_auc(made[white]["Gaussian"], real, 0)
say(
    f"Of the residual windows drawn, **{drawn_twice:.0%}** repeat another one. The moving average leaves a trace, too: the AUC of the same "
    f"Gaussian noise against *extracted* noise is **{trace:.2f}**, because extraction removes what varies slowly."
)
assert table[other, "Gaussian"][1] < table[other, "real, test"][1] - 0.2
np.testing.assert_allclose(table[other, "autoregression"][1], table[other, "real, test"][1], atol=0.1)
if is_full:
    assert abs(table[white, "Gaussian"][3] - table[white, "real, training (floor)"][3]) < 0.1
    assert (
        table[other, "network, likelihood"][3]
        < table[other, "autoregression"][3]
        < table[other, "Gaussian"][3]
    )
    assert table[white, "paper's GAN"][2] < 0.2 * table[white, "real, test"][2]
    assert table[white, "network, likelihood"][2] > 0.8 * table[white, "real, test"][2]

# %% [markdown]
# ## What published runs say
#
# The experiment on noise tried the generators on fourteen families, with seven detectors ([docs/noise.md](../docs/noise.md)); its network
# is trained longer than the one above. False alarms, with thresholds set for 1 %, of detectors trained on the true waves with generated
# noise (means over the seeds that each model has):

# %%
published, _ = open_study("noise_models")
rungs = (
    "Gaussian",
    "autoregression",
    "residual windows",
    "matched residual windows",
    "autoregressive network",
)
print(f"{'':16}" + "".join(f"{name:>26}" for name in ("real", *rungs)))
for family, about in published["families"].items():
    if all(name in about["rungs"] for name in rungs):
        print(
            f"{family:16}" + "".join(f"{about['rungs'][name]['alarms']:>26.1%}" for name in ("real", *rungs))
        )
ties = {}
for family, about in published["families"].items():
    gap = {name: about["rungs"][name]["excess"] for name in rungs}  # over real windows of the same seeds
    ties[family] = next((name for name in rungs if gap[name] <= 0.01), "none")
say(
    "The simplest of these generators whose false alarms are within 1 point of those of real noise: "
    + ", ".join(f"**{name}** for {list(ties.values()).count(name)}" for name in dict.fromkeys(ties.values()))
    + f" of {len(ties)} families."
)

# %% [markdown]
# The judge matters more than the generator, because it defines what *realistic* means. A likelihood judges every sample given its past:
# what can be predicted from what the network sees does not escape it. And a generator without parameters, which draws real windows again,
# needs no judge. It follows the signal, too, if it draws windows whose signal was similar (*matched*). Its limit is that it never makes a
# new window.
#
# ## Exercises
#
# **1.** A likelihood has a floor, too. What is the smallest mean negative log-likelihood that any model can reach on white Gaussian noise
# of standard deviation 1? (The density is $\exp(-x^2/2)/\sqrt{2\pi}$; the mean of $x^2$ is 1.)

# %%
smallest_loss = None  # your answer

# %%
check_answer(
    smallest_loss,
    lambda loss: abs(loss - 1.41894) < 1e-3,
    "Take the negative logarithm of the density, and replace x squared by its mean.",
)

# %% [markdown]
# **2.** Somebody has only 50 windows of real noise and draws 1,000 from them. What is the effective rank of the windows drawn? Give the
# number for the first 50 windows of `learnt`.

# %%
drawn_rank = None  # your answer

# %%
check_answer(
    drawn_rank,
    lambda rank: (
        abs(rank - measures.effective_rank(learnt[np.random.default_rng(5).integers(0, 50, 1_000)])) < 2
    ),
    "measures.effective_rank(learnt[rng.integers(0, 50, 1_000)])",
)

# %% [markdown]
# ## Solution
#
# <details><summary>1. The floor of a likelihood</summary>
#
# ```python
# smallest_loss = 0.5 * np.log(2 * np.pi) + 0.5
# _, training_loss, held_out_loss = networks["white"].losses[-1]
# print(f"floor {smallest_loss:.3f}, network on held-out windows {held_out_loss:.3f}")
# ```
#
# The gap between the two numbers is all that a better model could still gain. No GAN offers such a number.
#
# </details>

# %% [markdown]
# <details><summary>2. Few windows, drawn often</summary>
#
# ```python
# drawn_rank = measures.effective_rank(learnt[np.random.default_rng(1).integers(0, 50, 1_000)])
# print(f"{drawn_rank:.0f} of {measures.effective_rank(learnt):.0f}")
# ```
#
# At most 49: drawing again adds no direction. With few windows, a model that fits the noise is worth more than the windows themselves.
#
# </details>
