# %% [markdown]
# # The whole idea in ten minutes
#
# **Question:** can data from a crude simulator, made realistic by two neural networks, train a detector that guards the real thing?
#
# - **After this lesson** you can explain the method of the paper with one figure for each step, and say at which step it fails.
# - **You should know** what a Dense layer is, and no more. Each step has a lesson of its own, which writes the mechanism out.
# - **Terms:** *telemetry*: the measurements that a vehicle sends. *Nominal*: without a fault. A *detector* learns from nominal data, gives
#   each new window a score, and raises an alarm above a threshold. All terms: [glossary](../docs/glossary.md).
#
# A detector needs nominal data to learn from, and faults to be tested on. Nobody breaks satellites to record faults, so both are
# *simulated*. But simulations are too clean: a detector trained on them takes the ordinary noise of real telemetry for an anomaly.
# Feldman ([arXiv 2008.12082](https://arxiv.org/abs/2008.12082)) proposes a repair: keep the simulator crude and fast, and let two
# neural networks make its output realistic.

# %%
import numpy as np
from lesson_tools import check_answer, claim, degraded, drawing, open_pipeline, say, show, verdict

from enhsim_tf.common.plot_style import COARSE, ENHANCED, GENERATED, QUIET, REAL
from enhsim_tf.paper.claims import measured

pipeline, budget = open_pipeline()

# %% [markdown]
# Networks are trained in the first cell that needs them, and kept; at full budget this takes minutes, once. To try things out in
# seconds, start Jupyter with `ENHSIM_TF_BUDGET=smoke`: every step then runs with small counts, and the figures are marked. The text
# below describes results at full budget. If the import above fails, run `python -m pip install --editable .` in the clone.
#
# ## The map
#
# The paper's section 2 numbers nine steps. Solid arrows run whenever telemetry is made, dashed ones only in training.

# %%
show(pipeline, "fig01_pipeline")

# %% [markdown]
# *What to see:* the upper row makes a waveform, the lower row makes noise, and the two are independent until they are added. A
# healthy satellite and one that got stuck therefore get the same noise from the same seed ([01](01_pipeline.ipynb)):

# %%
added = {}
for name, severity in {"nominal": 0.0, "stuck": 1.0}.items():
    coarse, _ = degraded(pipeline, name, severity)
    added[name] = pipeline.combine(coarse, np.random.default_rng(7)) - pipeline.enhance(coarse)
difference = np.abs(added["nominal"] - added["stuck"]).max()
say(f"Largest difference between the noise of the healthy and of the stuck satellite: **{difference:.0e}**.")
assert difference < 1e-5

# %% [markdown]
# ## Steps 1, 2 and 4: a crude simulator beside the real thing
#
# The example is a satellite that turns once in two minutes on an orbit of eight, with one sample a second. This satellite is synthetic:
# its telemetry is the sum of two sines with white Gaussian noise, so that the truth is known. *Real* means this telemetry here, and
# *generated* means made by a network ([24](24_real_telemetry.ipynb) has a real spacecraft). The simulator knows the two periods and draws
# square waves ([02](02_source_target.ipynb)).

# %%
show(pipeline, "fig02_source_target")

# %% [markdown]
# *What to see:* the source has the right rhythm and the wrong shape; it knows four values and nothing between them.

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
# Network one maps a window of 500 coarse samples to a window of 500 smooth ones: four Dense layers, trained by mean squared error on
# pairs like those above. The target is noisy. With enough data, least squares averages the noise away, because noise cannot be predicted
# from a square wave ([03](03_enhancer.ipynb)).

# %%
show(pipeline, "fig04_enhanced_simulation")

# %% [markdown]
# *What to see:* the error against the true signal falls to a fraction of the simulator's own, on telemetry never trained on. The enhanced
# signal is rougher than the smooth truth: part of the noise of the training data was memorised.

# %%
errors = measured("enhancement", pipeline)
before, after, ridge = (errors[f"{name}nrmse"] for name in ("coarse_", "", "ridge_"))
test = pipeline.windows("test")
rough, smooth = (np.diff(windows).std() for windows in (pipeline.enhance(test["coarse"]), test["truth"]))
say(
    f"Error in standard deviations of the true signal (NRMSE): coarse **{before:.3f}**, enhanced **{after:.3f}**. One matrix, fitted by "
    f"ridge regression, reaches **{ridge:.3f}** (notebook 04)."
)
bound = {"full": before / 4, "smoke": 1.0}  # two epochs barely beat the mean
assert after < bound[budget]
assert rough > 2 * smooth

# %% [markdown]
# The result is nearly right, much smoother than telemetry, and useless for training a detector: real telemetry is never that clean.
#
# ## Step 6: the noise, taken from real telemetry
#
# Telemetry minus its moving average is called noise, and becomes the training data of the second network ([08](08_source_noise.ipynb)).

# %%
show(pipeline, "fig08_source_noise")

# %% [markdown]
# *What to see:* the noise looks the same everywhere, and its standard deviation is close to the true one, which is known here
# because the telemetry is synthetic.

# %%
extracted, true = pipeline.noise_windows("train").std(), pipeline.settings.noise_sd
say(f"Standard deviation of the noise: **{extracted:.4f}** extracted, **{true}** put in.")
assert abs(extracted / true - 1) < 0.03

# %% [markdown]
# ## Steps 7 to 9: two networks play against each other
#
# A *generator* turns 16 random numbers into 500 samples ([09](09_generator.ipynb)). A *discriminator* sees real and generated noise and
# says which is which ([10](10_discriminator.ipynb)). Each learns from the other's mistakes, for about a thousand rounds
# ([11](11_gan_training.ipynb)).

# %%
show(pipeline, "fig12_accuracy_loss")
num_records = pipeline.settings.iterations // pipeline.settings.record_every
history = {key: values[:num_records] for key, values in pipeline.history.items() if values.ndim}

# %% [markdown]
# *What to see:* the accuracies for real and for generated windows swing in opposite directions: at one time the discriminator takes nearly
# everything for real, at another nearly everything for generated. Their mean stays near one half, and both losses near ln 2, which is what
# guessing gives.
# The networks are in balance, and the paper stops here: the noise is "sufficiently similar" ([12](12_accuracy_loss.ipynb)).

# %%
late = np.mean([history[f"accuracy_{kind}"][-3:] for kind in ("real", "generated")])
say(f"Classified correctly over the last three records: **{late:.0%}** of both kinds together.")
assert 0.35 < late < 0.65
if budget == "full":
    losses = np.array([history["loss_real"], history["loss_generated"]])
    assert np.corrcoef(history["accuracy_real"], history["accuracy_generated"])[0, 1] < -0.5
    assert np.all(np.abs(losses - np.log(2)) < 0.15)

# %% [markdown]
# At a glance the noise is similar indeed:

# %%
show(pipeline, "fig06_real_or_generated_noise")

# %% [markdown]
# *What to see:* little, until one compares windows: the answer is printed upside down, and the generated ones share a pattern, which no two
# real ones do. A thousand of them vary in few dimensions. The *effective rank* counts these dimensions and is at most 500 here
# ([05](05_real_or_generated.ipynb)):

# %%
shared, ranks = {}, measured("noise resemblance", pipeline)
four_generated = pipeline.generate_noise(4, pipeline.draw("figure 6"))
four_real = pipeline.noise_windows("test", 4, "figure 6, real")
for name, four in {"generated": four_generated, "real": four_real}.items():
    shared[name] = (np.corrcoef(four).sum() - 4) / 12  # the twelve pairs of two different windows
generated, real = ranks["rank"], ranks["real_rank"]
say(
    f"Mean correlation of two windows: **{shared['generated']:.2f}** generated, **{shared['real']:.2f}** real. "
    f"Effective rank: **{generated:.0f}** generated, **{real:.0f}** real."
)
assert shared["generated"] > {"full": 0.3, "smoke": 0.1}[budget] > abs(shared["real"])
assert generated < {"full": 0.2, "smoke": 0.6}[budget] * real

# %% [markdown]
# ## Combined: waveform plus noise

# %%
show(pipeline, "fig13_combined")

# %% [markdown]
# *What to see:* at a glance the second and the third panel look alike: with its noise, the signal is as rough as telemetry.

# %%
signals = {
    "enhanced": pipeline.enhance(test["coarse"]),
    "combined": pipeline.combine(test["coarse"], np.random.default_rng(0)),
    "telemetry": test["target"],
}
roughness = {key: np.diff(windows).std() for key, windows in signals.items()}
say(
    "Standard deviation of the steps: "
    + ", ".join(f"{key} **{value:.3f}**" for key, value in roughness.items())
    + "."
)
assert roughness["enhanced"] < roughness["combined"]
if budget == "full":  # twenty iterations give noise of the wrong size
    assert abs(roughness["combined"] / roughness["telemetry"] - 1) < 0.15

# %% [markdown]
# ## Does it serve its purpose?
#
# The paper's title promises robust detectors, and its text never trains one. This project did. A detector gives a window a score, which is
# high for an unusual window:
#
# - *PCA residual*: the part of the window that lies outside the main directions (principal components) of the training windows.
# - *Dense autoencoder*: the error with which a network reproduces the window from a few numbers.
# - *Isolation forest*: how few random cuts separate the window's features (mean, deviation and others) from those of the training windows.
#
# Each is trained on five kinds of data, with its threshold set to raise a false alarm on 1 % of *its own* kind. Then all of them watch real
# telemetry: nominal windows, on which an alarm is false, and the same waves and noise with one of six faults, on which it is right.
# ([13](13_combined.ipynb) builds one of these detectors in ten lines.)

# %%
from enhsim_tf.paper.detectors import DETECTORS

found = measured("detection", pipeline)
arms = ["coarse", "enhanced", "enhanced + GAN noise", "enhanced + Gaussian noise", "real"]
detectors = list(DETECTORS)
rates, recall = (
    {arm: np.array([found[f"{key}, {arm}, {name}"] for name in detectors]) for arm in arms}
    for key in ("false alarms", "recall")
)
colors = {"coarse": COARSE, "enhanced": ENHANCED, "enhanced + GAN noise": GENERATED, "real": REAL}
alt = "False-alarm rate and recall of three detectors by the data they were trained on"
too_many = int((rates["enhanced + GAN noise"] > 0.1).sum())
title = f"Trained on the paper's noise, {too_many} of {len(detectors)} detectors take nominal telemetry for anomalies"
with drawing(alt, 2, 2.6, title, sharey=True) as panels:
    shown = {"false alarms: share of nominal windows": rates, "recall: share of faulty windows": recall}
    for panel, (name, shares) in zip(panels, shown.items()):
        for number, (detector, marker) in enumerate(zip(detectors, "os^")):
            for row, arm in enumerate(arms):
                place = row + 0.22 * (number - 1)
                style = {"color": colors.get(arm, QUIET), "markersize": 4.5, "clip_on": False}
                panel.plot(shares[arm][number], place, marker, **style, label=detector if row == 4 else None)
        panel.set(xlabel=name, xlim=(0, 1), yticks=range(len(arms)), yticklabels=arms)
        panel.set_xticks([0, 0.5, 1], ["0 %", "50 %", "100 %"])
        panel.grid(axis="y", linewidth=0.3)
    panels[0].axvline(0.01, color=REAL, linestyle=":", linewidth=0.8)
    panels[0].invert_yaxis()
    panels[0].legend(frameon=False, loc="upper center", fontsize=6.5)

# %% [markdown]
# *What to see:* trained on the clean signal, every detector raises a false alarm on nearly every window. With the GAN's noise the result
# depends on the detector. Plain Gaussian noise of the right size gives few false alarms with all three, because the real noise of this
# example is white; its price is that the autoencoder finds fewer faults. Trained on raw square waves, the PCA residual and the forest
# raise few alarms for a bad reason: they cannot follow the edges, so their thresholds are high, and they find fewer faults than after
# training on real telemetry. The dotted line marks the 1 % that was asked for. Recall counts only beside few false alarms: who always
# alarms finds everything.

# %%
print("false alarms / recall")
for arm in arms:
    print(
        f"{arm:26} "
        + "   ".join(f"{d}: {r:6.1%} / {c:4.0%}" for d, r, c in zip(detectors, rates[arm], recall[arm]))
    )
if budget == "full":  # noise of the wrong size would teach a detector nothing
    assert rates["enhanced"].min() > 0.5
    assert rates["enhanced + GAN noise"][0] > 0.9 and rates["enhanced + Gaussian noise"].max() < 0.15
    assert rates["coarse"][:2].max() < 0.05 and (recall["coarse"][:2] < recall["real"][:2] - 0.1).all()

# %% [markdown]
# ## Where each stage fails
#
# | stage | what it does | where it fails |
# |---|---|---|
# | coarse simulator | square waves of known period: fast, right rhythm | wrong shape; four values |
# | enhancer | maps coarse windows to smooth ones | one matrix does better; five of six faults that it never saw come out wrong (C9) |
# | moving average | splits telemetry into waveform and noise | a little of the waveform stays in the noise, and a little noise is lost |
# | noise GAN | sixteen random numbers to a window of noise | varies in few dimensions; the discriminator does not detect it (C6) |
# | sum | adds the two | the noise does not depend on the signal; the PCA residual separates the sum from telemetry (C8) |

# %% [markdown]
# The verdicts below are those of the one seed that this book shows. (The lessons were not all executed on the same machine. On another
# processor, the same seed trains a GAN whose measures differ a little.) The published verdicts rest on several readings of the paper, seeds
# and processors ([readings](../studies/readings/README.md)). (*AUC*: the area under the curve of a classifier that tries to tell
# generated from real: 0.5 if it cannot, 1 if it always can.)

# %%
claim("C6", "C8", "C9")
records = verdict(pipeline, "C6", "C8", "C9")
assert [record["id"] for record in records] == ["C6", "C8", "C9"]

# %% [markdown]
# This tour follows the paper's recipe. `fit` chooses among several noise models by held-out telemetry, as the page on
# [noise](../docs/noise.md) explains.
#
# ## Exercises
#
# **1.** Which degraded mode (fault of the simulator; [all six](../docs/glossary.md#degraded-mode-severity-onset)) does the enhancer hide
# best? For each mode, compare enhanced windows of a fault of severity 0.8 with enhanced nominal windows of the same times (the coarse
# windows of both are the first result of `degraded`), and name the mode with the smallest root-mean-square difference.

# %%
from enhsim_tf.paper.square_wave import MODES

nominal = pipeline.enhance(degraded(pipeline, "nominal", 0.8)[0])
hidden_best = None  # your answer: one of MODES

# %%
differences = {}
for mode in MODES:
    faulty = pipeline.enhance(degraded(pipeline, mode, 0.8)[0])
    differences[mode] = np.sqrt(np.mean((faulty - nominal) ** 2))
check_answer(
    hidden_best,
    lambda mode: differences[mode] == min(differences.values()),
    "degraded(pipeline, mode, 0.8)[0] has the coarse windows of the same times as `nominal`.",
)

# %% [markdown]
# **2.** You must deliver training data for a detector tomorrow, and nobody can tell you which detector. Which of the five kinds of data has
# the smallest *largest* false-alarm rate over the three detectors, if recorded real telemetry is not available?

# %%
chosen_arm = None  # your answer: one of `arms`

# %%
check_answer(
    chosen_arm,
    lambda arm: (
        arm != "real" and rates[arm].max() == min(rates[other].max() for other in arms if other != "real")
    ),
    "rates[arm] has the false-alarm rates of the three detectors.",
)

# %% [markdown]
# ## Solution
#
# <details><summary>1. What the enhancer hides</summary>
#
# ```python
# changes = {}
# for mode in MODES:
#     fault = pipeline.enhance(degraded(pipeline, mode, 0.8)[0])
#     changes[mode] = np.sqrt(np.mean((fault - nominal) ** 2))
#     print(f"{mode:14} {changes[mode]:.3f}")
# hidden_best = min(changes, key=changes.get)
# ```
#
# Nothing in a generated fault says that it is a guess, and that is the danger. The enhancer was trained on healthy windows alone and
# bends whatever it is given towards those. Against the truth (C9 above) most modes are far off; notebook 04 looks closer.
#
# </details>

# %% [markdown]
# <details><summary>2. What to deliver</summary>
#
# ```python
# chosen_arm = min((arm for arm in arms if arm != "real"), key=lambda arm: rates[arm].max())
# print(chosen_arm, f"finds {recall[chosen_arm].mean():.0%} of the faults, detectors trained on real data {recall['real'].mean():.0%}")
# ```
#
# The fewest false alarms can be the wrong answer: compare the recall that is printed. If the square waves win, they win because their
# threshold is too high: few alarms on nominal windows, and fewer on faulty ones than after training on real telemetry. Among the others,
# *enhanced + Gaussian noise* has few false alarms with every detector. First check whether the real noise is white at all. Here it was
# made so; for noise with structure the Gaussian has no right to win.
#
# </details>
