# %% [markdown]
# # Degraded modes: does the simulator know what it does not know?
#
# **What the paper says** (sections 1 and 3): an enhanced simulator may be asked for configurations that telemetry never showed: a
# mechanism that sticks, a gain that falls. The enhancer has learnt from nominal windows alone. In the example the true degraded signal
# is known, so this notebook can look.

# %%
import sys

sys.path.insert(0, "..")  # the clone that this notebook lies in

import numpy as np

from enhsim_tf.common.plot_style import COARSE, ENHANCED, GENERATED, REAL
from enhsim_tf.reproduce.notebook import claim, drawing, open_experiment, open_findings, show_finding

experiment = open_experiment()
claim("C9")

# %% [markdown]
# ## One window in three modes
#
# `Degraded` says what is wrong and how much. The coarse simulator and the true vehicle take the same mode with the same draws.

# %%
from enhsim_tf import Degraded

scenarios = {"nominal": None, "stuck": Degraded("stuck", 0.5), "drift": Degraded("drift", 0.5)}
coarse = {name: experiment.data.degraded_coarse(scenario) for name, scenario in scenarios.items()}
truth = {name: experiment.data.degraded_truth(scenario, noisy=False) for name, scenario in scenarios.items()}
enhanced = {name: experiment.simulator.enhance(windows) for name, windows in coarse.items()}

# %%
alt = "Coarse, enhanced and true signal of one window: nominal, stuck and drifting"
with drawing(alt, 3, 2.2, sharey=True) as panels:
    for panel, name in zip(panels, scenarios):
        panel.plot(coarse[name][0], color=COARSE, linewidth=0.8, label="coarse")
        panel.plot(truth[name][0], color=REAL, linewidth=1.6, label="true")
        panel.plot(enhanced[name][0], color=GENERATED, linewidth=1.0, label="enhanced")
        panel.set(title=name, xlabel="time (s)")
    panels[0].set_ylabel("signal (units of the telemetry)")
    panels[-1].legend(frameon=False, loc="center left", bbox_to_anchor=(1, 0.5))

# %% [markdown]
# *What to see:* nominal, the orange curve covers the black one. Stuck or drifting, it does what the enhancer knows: it waves. It turns a
# square wave that has stopped into something between the two, and says nothing of it.

# %%
error = {name: np.sqrt(np.mean((enhanced[name] - truth[name]) ** 2, axis=1)) for name in scenarios}
print({name: f"{np.median(each):.3f}" for name, each in error.items()})
if experiment.settings.budget == "full":
    assert np.median(error["drift"]) > 2 * np.median(error["nominal"])

# %% [markdown]
# ## A score that needs no truth
#
# How far is a coarse window from those that the enhancer learnt from? `OutOfRange` asks for two things: what the principal components of
# the training windows leave of it, and how far it is from the nearest of them.

# %%
from enhsim_tf.detection import metrics
from enhsim_tf.enhancer.out_of_range import OutOfRange

learnt = experiment.data.windows("train", experiment.settings.telemetry.num_windows, "training windows")[
    "coarse"
]
score = OutOfRange().fit(learnt)
limit = metrics.threshold(score.score(experiment.data.windows("calibration", None)["coarse"]), 0.01)
scores = {name: score.score(windows) for name, windows in coarse.items()}
print({name: f"{np.mean(each > limit):.0%} out of range" for name, each in scores.items()})

# %%
alt = "Error of each window against its out-of-range score, nominal, stuck and drifting"
with drawing(alt, height=2.3) as panel:
    for name, color in zip(scenarios, (REAL, ENHANCED, GENERATED)):
        panel.plot(scores[name], error[name], ".", color=color, markersize=2, label=name)
    panel.axvline(limit, color=COARSE, linestyle=":", label="limit")
    panel.set(
        xlabel="out-of-range score of the coarse window",
        ylabel="error of the enhanced one\n(units of the telemetry)",
        yscale="log",
    )
    panel.legend(frameon=False, loc="center left", bbox_to_anchor=(1, 0.5))

# %% [markdown]
# *What to see:* what is far right is also high up. The score never looks at the truth, nor at the network.

# %%
assert np.median(scores["drift"]) > np.median(scores["nominal"])

# %% [markdown]
# ## All modes, all severities, and an enhancer that has seen more
#
# What changes if the enhancer learns from *randomised* configurations, a seventh of them nominal, the rest degraded up to severity 0.5?
# It is told the true response to them, with noise; who has never seen a failure has none.

# %%
found, tables = open_findings()
show_finding(found, "degraded_modes")

# %% [markdown]
# *What to see:* inside the shaded range the solid blue curve lies below the orange one, far below for most modes; outside it rises. On
# nominal windows it is a little worse than with as many windows that are all nominal (blue, dotted): compare the column below. Beyond the
# range the paper's enhancer is, on average, worse than the coarse signal it was given; friction is the exception. And it is the
# configurations that help, more than the network: ridge regression over the same ones comes near it on average beyond the range, and in
# some modes, dropout among them, it is nearer to the truth.

# %%
errors = found["modes"]["nrmse"]
for method, each in errors.items():
    print(
        f"{method:18}"
        + "".join(f"{where:>9} {each[where]:.3f}" for where in ("nominal", "inside", "outside"))
    )
assert errors["randomised"]["inside"] < errors["paper"]["inside"]
assert errors["paper"]["outside"] > errors["identity"]["outside"]
assert errors["ridge, randomised"]["outside"] < 1.5 * errors["randomised"]["outside"]

# %%
show_finding(found, "out_of_range")

# %% [markdown]
# *What to see:* over all modes and severities, the higher the score, the larger the error, nearly everywhere, for each of the three
# enhancers; the randomised one is less orderly, since what is far from its training windows is not always hard.

# %%
rho = {method: about["rank_correlation"] for method, about in found["modes"]["trust"].items()}
print({method: f"{value:.2f}" for method, value in rho.items()})
assert min(rho.values()) > 0.3

# %% [markdown]
# ## Exercises
#
# 1. Which mode is hardest for the randomised enhancer outside its range, and which hardly gets worse? Use `found["modes"]["by_mode"]`.
# 2. Keep only the windows below the limit. How much smaller is their median error? Use `found["modes"]["trust"]`.

# %% [markdown] jp-MarkdownHeadingCollapsed=true
# ## Solution

# %%
import pandas as pd

rows = pd.DataFrame(found["modes"]["by_mode"]).query("method == 'randomised'")
worst = rows[rows["severity"].isin([0.5, 1.0])].pivot_table("nrmse", "mode", "severity")
print(worst.sort_values(1.0).round(3).to_string())

# %%
for method, about in found["modes"]["trust"].items():
    print(f"{method:14} below the limit {about['error_trusted']:.3f}, above {about['error_flagged']:.3f}")

# %% [markdown]
# <details><summary>What to say about it</summary>
#
# 1. The table is sorted by the severity outside. A mode gets worse where the coarse signal leaves what training showed: compare both
#    columns, and their ratio. Dropout is hard already inside, since what was lost is not in the coarse window any more, and so has
#    little left to lose.
# 2. The score cannot know whether the coarse simulator itself is right. Below the limit, the enhancer is asked what it was taught.
#
# </details>
