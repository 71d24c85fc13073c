# %% [markdown]
# # The whole idea in a quarter of an hour
#
# **Question:** can data from a crude simulator, made realistic by two neural networks, train a detector?
#
# - **After this lesson** you can explain each step of the paper, and say where the method fails.
# - **You should know** what a Dense layer and principal components are.
# - **Terms:** *telemetry*: the measurements that a vehicle sends. *Window*: here 500 samples in a row, one a second. *Nominal*: without a
#   fault. A *detector* learns from nominal data, scores new windows, and raises an alarm above a threshold. All terms:
#   [glossary](../docs/glossary.md).
#
# Detectors could learn from *simulations*, but these are too clean: noise then passes for an anomaly. Feldman ([arXiv
# 2008.12082](https://arxiv.org/abs/2008.12082)) keeps the simulator crude, and lets two networks make its output realistic.

# %%
import numpy as np
import pandas as pd
from lesson_tools import (
    check_answer,
    claim,
    degraded,
    open_pipeline,
    say,
    show,
    show_detectors,
    verdict,
)

from enhsim_tf.paper.claims import detection

pipeline, budget = open_pipeline()

# %% [markdown]
# ## The map
#
# The paper numbers nine steps. Dashed arrows run in training only.

# %%
show(pipeline, "fig01_pipeline")

# %% [markdown]
# *What to see:* waveform and noise meet only in their sum. A healthy and a stuck satellite therefore get the same noise from the same
# random numbers:

# %%
added = {}
for name, severity in {"nominal": 0.0, "stuck": 1.0}.items():
    coarse, _ = degraded(pipeline, name, severity)
    added[name] = pipeline.combine(coarse, np.random.default_rng(7)) - pipeline.enhance(coarse)
difference = np.abs(added["nominal"] - added["stuck"]).max()
say(f"Largest difference between the noise of the healthy and of the stuck satellite: **{difference:.0e}**.")
assert difference < 1e-5

# %% [markdown]
# ## Steps 1, 2 and 4: a crude simulator
#
# A synthetic satellite turns once in two minutes on an orbit of eight minutes. Its telemetry, here called *real*, is two sines with white
# noise, so that the truth is known. The simulator knows the periods and draws square waves ([02](02_source_target.ipynb)).

# %%
show(pipeline, "fig02_source_target")

# %% [markdown]
# *What to see:* the right rhythm and the wrong shape, of four values. (*Source* is here the simulator's output, and *target* the
# telemetry.)

# %%
source = pipeline.windows("train", 3, "figure 2")["coarse"]
levels = np.unique(source)
say(
    f"Values of the source: {', '.join(f'{level:g}' for level in levels)}; samples in a window: {source.shape[1]}."
)
assert len(levels) == 4

# %% [markdown]
# ## Steps 3 and 5: the enhancer
#
# Network one maps 500 coarse samples to 500 samples of a waveform: four Dense layers, trained by mean squared error. The target is noisy,
# but noise cannot be predicted from a square wave, so least squares averages most of it away ([03](03_enhancer.ipynb)).

# %%
show(pipeline, "fig04_enhanced_simulation")

# %% [markdown]
# *What to see:* the error is a fraction of the simulator's own. The enhanced signal is rougher than the truth
# ([04](04_enhanced_simulation.ipynb)).

# %%
test = pipeline.windows("test")
truth, enhanced = test["truth"], pipeline.enhance(test["coarse"])


def nrmse(estimate):
    return np.sqrt(np.mean((estimate - truth) ** 2)) / truth.std()


before, after = nrmse(test["coarse"]), nrmse(enhanced)
rough, smooth = np.diff(enhanced).std(), np.diff(truth).std()
say(
    f"Error in standard deviations of the true signal (NRMSE): coarse **{before:.3f}**, enhanced **{after:.3f}**. Standard deviation of "
    f"the steps from sample to sample: enhanced **{rough:.3f}**, true signal **{smooth:.3f}**."
)
bound = {"full": before / 4, "smoke": 1.0}  # two epochs barely beat the mean
assert after < bound[budget]
assert rough > 2 * smooth

# %% [markdown]
# The third error above the picture is that of one matrix, fitted by [ridge regression](../docs/glossary.md#ridge-regression). It does
# better.
#
# ## Step 6: the noise
#
# Telemetry minus its moving average trains the second network ([08](08_source_noise.ipynb)).

# %%
show(pipeline, "fig08_source_noise")

# %% [markdown]
# *What to see:* its standard deviation is nearly the true one.

# %%
extracted, true = pipeline.noise_windows("train").std(), pipeline.settings.noise_sd
say(f"Standard deviation of the noise: **{extracted:.4f}** extracted, **{true}** put in.")
assert abs(extracted / true - 1) < 0.03

# %% [markdown]
# ## Steps 7 to 9: two networks play against each other
#
# A *generator* turns 16 random numbers into 500 samples ([09](09_generator.ipynb)). A *discriminator* says which noise is real
# ([10](10_discriminator.ipynb)). Together they are a *GAN*, a generative adversarial network. Each learns from the other, a thousand times
# ([11](11_gan_training.ipynb)).

# %%
show(pipeline, "fig12_accuracy_loss")
num_records = pipeline.settings.iterations // pipeline.settings.record_every
history = {key: values[:num_records] for key, values in pipeline.history.items() if values.ndim}

# %% [markdown]
# *What to see:* the two accuracies swing in opposite directions. The losses ([binary cross-entropy](../docs/glossary.md#adversarial-loss))
# stay near ln 2, which guessing gives, in all records (one every 100 iterations), and on average the discriminator is right about half of
# the time. Here the paper stops: the noise is "sufficiently similar" ([12](12_accuracy_loss.ipynb)).

# %%
late = np.mean([history[f"accuracy_{kind}"][-3:] for kind in ("real", "generated")])
say(f"Classified correctly over the last three records: **{late:.0%}** of both kinds together.")
assert budget == "smoke" or 0.35 < late < 0.65
if budget == "full":
    losses = np.array([history["loss_real"], history["loss_generated"]])
    assert np.corrcoef(history["accuracy_real"], history["accuracy_generated"])[0, 1] < -0.5
    assert np.all(np.abs(losses - np.log(2)) < 0.15)

# %% [markdown]
# But generated windows share a pattern, and vary in few dimensions. The *effective rank* counts these: $k$ principal components with equal
# shares of the variance give $k$ ([05](05_real_or_generated.ipynb)).

# %%
real_noise = pipeline.noise_windows("test")
noises = {
    "generated": pipeline.generate_noise(len(real_noise), pipeline.draw("noise, compared")),
    "real": real_noise,
}


def effective_rank(windows):
    sizes = np.linalg.svd(windows - windows.mean(axis=0), compute_uv=False)
    share = sizes**2 / np.sum(sizes**2)  # of each principal component in the variance
    return np.exp(-np.sum(share * np.log(share)))


shared = {
    name: np.corrcoef(windows)[np.triu_indices(len(windows), 1)].mean() for name, windows in noises.items()
}
ranks = {name: effective_rank(windows) for name, windows in noises.items()}
say(
    f"{len(real_noise):,} windows of each kind. Mean correlation of two: **{shared['generated']:.2f}** generated, "
    f"**{shared['real']:.2f}** real. Effective rank: **{ranks['generated']:.0f}** generated, **{ranks['real']:.0f}** real."
)
assert shared["generated"] > {"full": 0.2, "smoke": 0.1}[budget] > abs(shared["real"])
assert ranks["generated"] < {"full": 0.2, "smoke": 0.6}[budget] * ranks["real"]

# %% [markdown]
# ## The sum
#
# Both networks are plain Keras models, and their outputs are added:

# %%
clean = pipeline.enhancer.predict(test["coarse"], verbose=0)
latent = np.random.default_rng(0).standard_normal((len(clean), 16), "float32")
latent *= pipeline.settings.latent_scale  # their standard deviation
noise = pipeline.generator.predict(latent, verbose=0)[:, :, 0]
combined = clean + noise
show(pipeline, "fig13_combined")

# %% [markdown]
# *What to see:* with its noise, the signal is here about as rough as telemetry. The picture counts its one window, the next line all test
# windows:

# %%
signals = {"enhanced": clean, "combined": combined, "telemetry": test["target"]}
roughness = {name: np.diff(windows).std() for name, windows in signals.items()}
say(
    "Standard deviation of the steps: "
    + ", ".join(f"{name} **{value:.3f}**" for name, value in roughness.items())
    + "."
)
assert roughness["enhanced"] < roughness["combined"]
if budget == "full":  # twenty iterations give noise of the wrong size
    assert abs(roughness["combined"] / roughness["telemetry"] - 1) < 0.15

# %% [markdown]
# ## Does it serve its purpose?
#
# The title promises robust detectors; the text trains none. Here is one, the *PCA residual*: the part of a window outside the first 20
# principal components of training windows. Its threshold is set for 1 % of false alarms on held-out windows of *its own* kind. Then it
# watches real nominal telemetry ([13](13_combined.ipynb)).

# %%
train, held_out = pipeline.windows("train", len(clean), "tour"), pipeline.windows("calibration")


def outside(training, windows):
    mean = training.mean(axis=0)
    directions = np.linalg.svd(training - mean, full_matrices=False)[2][:20]
    centred = windows - mean
    return np.mean((centred - centred @ directions.T @ directions) ** 2, axis=1)


rng, alarms, typical = np.random.default_rng(1), {}, {}
kinds = {
    "combined": [pipeline.combine(each["coarse"], rng) for each in (train, held_out)],
    "telemetry": [each["target"] for each in (train, held_out)],
}
for name, (learnt, its_own) in kinds.items():
    own_scores, scores = outside(learnt, its_own), outside(learnt, test["target"])
    alarms[name] = np.mean(scores > np.quantile(own_scores, 0.99))
    typical[name] = np.median(own_scores), np.median(scores)
say(
    "False alarms after learning from "
    + ", ".join(f"{name}: **{a:.1%}**" for name, a in alarms.items())
    + "."
)
own_score, score = typical["combined"]
say(
    f"Median score of the detector of combined windows: **{own_score:.4f}** for further ones, **{score:.4f}** for telemetry."
)
assert budget == "smoke" or alarms["combined"] > 0.9 > 0.1 > alarms["telemetry"]
assert budget == "smoke" or own_score < score

# %% [markdown]
# Generated noise varies in few dimensions, and the components hold much of it. What is left is small, and so is the threshold; telemetry
# leaves more ([22](22_false_alarms.ipynb)).
#
# The next figure has two more detectors, more data (`detection` in `enhsim_tf/paper/claims.py`), and faults to be found: six
# [degraded modes](../docs/glossary.md#degraded-mode-severity-onset) at severity 0.5. *Recall* is the share of faulty windows that raise an
# alarm, here its mean over the modes.
#
# - *Dense autoencoder*: the error with which a network reproduces a window from a few numbers.
# - *Gaussian noise*: independent normal numbers with the standard deviation of the extracted noise.
# - *Isolation forest*: how few random cuts separate a window's features from those of training windows.

# %%
from enhsim_tf.paper.detectors import DETECTORS

found = detection(pipeline)
arms = ["coarse", "enhanced", "enhanced + GAN noise", "enhanced + Gaussian noise", "real"]
rates, recall = (
    pd.DataFrame({arm: {name: found[f"{key}, {arm}, {name}"] for name in DETECTORS} for arm in arms})
    for key in ("false alarms", "recall")
)
with_gan = rates["enhanced + GAN noise"]
too_many = int((with_gan > 0.1).sum())
title = f"With GAN noise, {too_many} of {len(rates)} detectors above 10 % false alarms"
show_detectors(rates, recall, title)

# %% [markdown]
# *What to see:* the dotted line marks the 1 % of the thresholds. Here, trained on the clean enhanced signal, every detector alarms on
# nearly every nominal window. After the GAN's noise, the PCA residual still does; the other two differ from run to run. After square waves,
# the PCA residual and the forest alarm seldom and find fewer faults than after real data. A detector that always alarms finds everything.

# %%
say("False alarms after GAN noise: " + ", ".join(f"{name} **{a:.0%}**" for name, a in with_gan.items()) + ".")
if budget == "full":  # noise of the wrong size would teach a detector nothing
    few = ["PCA residual", "isolation forest"]
    assert rates["enhanced"].min() > 0.9 and with_gan["PCA residual"] > 0.9
    assert rates["coarse"][few].max() < 0.05 and (recall["coarse"] < recall["real"] - 0.1)[few].all()

# %% [markdown]
# ## Where each stage fails
#
# Three claims of the paper, and their verdicts for one seed. The published ones rest on several
# ([readings](../studies/readings/README.md)), and the [report](../docs/report.md) has the limits. C8 and C9, which the paper does not test,
# *hold* or do not; other claims are *reproduced* or not.

# %%
claim("C6", "C8", "C9")
records = verdict(pipeline, "C6", "C8", "C9", limits=False)
noise, errors = records[0]["measured"], records[2]["measured"]
say(
    f"A classifier that tells generated from real noise has an AUC of **{noise['auc']:.3f}**; between real and real noise, "
    f"{noise['floor_auc']:.3f}. C6 allows a difference of 0.2."
)
nominal = errors["nrmse, nominal"]
of_faults = [
    error for name, error in errors.items() if name.startswith("nrmse, ") and name != "nrmse, nominal"
]
num_good = sum(error <= 2 * nominal for error in of_faults)
say(f"Six faults are tried; the enhanced signal of **{num_good}** has at most twice the nominal error.")
assert budget == "smoke" or records[0]["deciding"]["name"] == "auc_over_floor"

# %% [markdown]
# | stage | where it fails |
# |---|---|
# | enhancer | one matrix does better; most faults have more than twice the nominal error (C9) |
# | moving average | a little of the waveform stays in the noise (notebook 08) |
# | noise GAN | a classifier tells its noise from real noise (C6); few dimensions, although the networks are in balance |
# | sum | two of three detectors differ too much from those of real data (C8) |
#
# **Answer.** Not as it stands: the signal is nearly right, but of three detectors, the PCA residual alarms on all nominal telemetry, and
# which others fail differs from run to run. The tool of this project, `python -m enhsim_tf fit`, draws windows of real noise again instead
# ([noise](../docs/noise.md)).
#
# ## Exercises
#
# **1.** Which degraded mode does the enhancer hide best? Compare enhanced windows at severity 0.8 with enhanced nominal ones of the same
# times (`degraded` returns the coarse ones first). Name the mode with the smallest root-mean-square difference.

# %%
from enhsim_tf.paper.degraded import MODES

say(f"Modes: {', '.join(MODES)}.")
nominal = pipeline.enhance(degraded(pipeline, "nominal", 0.8)[0])
hidden_best = None  # your answer: one of MODES

# %%
from notebooks import answers_paper

check_answer(
    hidden_best,
    lambda mode: mode == answers_paper.mode_hidden_best(pipeline),
    "degraded(pipeline, mode, 0.8)[0] has the coarse windows of the same times as `nominal`.",
)

# %% [markdown]
# **2.** You must deliver training data for an unknown detector. You may use recorded telemetry, but not hand it out. Which kind has the
# smallest *largest* false-alarm rate?

# %%
chosen_arm = None  # your answer: one of `arms`

# %%
check_answer(
    chosen_arm,
    lambda arm: arm == answers_paper.kind_to_deliver(rates),
    "rates[arm] has the false-alarm rates of the three detectors.",
)
