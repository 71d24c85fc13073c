# %% [markdown]
# # Bring your own simulator
#
# **Question:** how do two CSV files, one of a coarse simulator and one of the real thing, become a detector that finds faults?
#
# - **After this lesson** you can pair a simulator with telemetry, judge enhancers on held-out time, and find a fault in the difference
#   from the enhanced run.
# - **You should know** ridge regression (notebook 04) and the conformal threshold (notebook 13).
# - **Terms:** [window](../docs/glossary.md#window), [NRMSE](../docs/glossary.md#nrmse), [residual](../docs/glossary.md#residual):
#   telemetry minus enhanced run. A *block of time* is a contiguous stretch; because neighbouring windows overlap, only such blocks can be
#   held out.
#
# **What the paper says** (section 1): the enhanced simulator should "perform similarly to much more sophisticated simulators". The
# paper's example has a square wave as its simulator. Here, a simple physical model of a satellite's battery is the simulator, and a
# detailed one with sensor noise stands for the vehicle ([battery study](../studies/battery/README.md)).

# %%
import numpy as np
import pandas as pd
from lesson_tools import ROOT, check_answer, drawing, open_study, say

from enhsim_tf import clean, read_source
from enhsim_tf.coarse.recording_files import read_recording
from enhsim_tf.common.plot_style import COARSE, DASHED, ENHANCED, GENERATED, QUIET, REAL

folder = ROOT / "examples" / "battery"
cleaned = clean(read_source(folder / "telemetry.csv")["volts"])
telemetry, simulator = cleaned.longest, read_recording(folder / "simulator.csv")
say(
    f"Telemetry: **{len(telemetry):,} samples**, one every {telemetry.interval_s:g} s. "
    f"Columns of the simulator: **{', '.join(simulator.columns)}**."
)

# %%
target = telemetry.values[:, 0].astype(float)
(run,) = simulator.parts
inputs = {name: run.values[:, number].astype(float) for number, name in enumerate(simulator.columns)}
hours = np.arange(1_200) * telemetry.interval_s / 3_600
error = np.sqrt(np.mean((inputs["volts"] - target) ** 2)) / np.std(target)
with drawing(
    "Voltage of the battery as measured and as simulated, over three hours",
    height=2.2,
    title=f"The coarse simulator has the timing, but not the amplitude (error {error:.0%})",
) as panel:
    panel.plot(hours, target[:1_200], color=REAL, linewidth=0.8, label="telemetry")
    panel.plot(hours, inputs["volts"][:1_200], color=COARSE, linestyle=DASHED, label="coarse simulator")
    panel.set(xlabel="time (h)", ylabel="voltage (V)")
    panel.legend(frameon=False, ncols=2)

# %% [markdown]
# *What to see:* both curves rise and fall at the same moments, by different amounts. The battery is charged in the sun and drained in
# eclipse and by payload passes.
#
# ## From simple to complex
#
# The cheapest repair is a level and a gain for the voltage. Next comes ridge regression from *all* columns of a window to the telemetry
# of the window. Both are fitted to the first 60 % of the time and judged on the last 30 %. The gap between them is longer than a window,
# so that no window reaches from one part into the other.

# %%
window = 500
first = np.arange(0, int(0.6 * len(target)) - window, 10)
last = np.arange(int(0.7 * len(target)), len(target) - window + 1, window)  # disjoint


def cut(values, starts):
    """Windows of shape (windows, samples)."""
    return np.stack([values[start : start + window] for start in starts])


def nrmse(estimate, truth):
    return np.sqrt(np.mean((estimate - truth) ** 2)) / np.std(truth)


def fit_ridge_by_hand(columns, penalty):
    """The closed form of notebook 04, with each column centred and scaled by one number."""
    windows = np.concatenate(
        [(cut(inputs[name], first) - inputs[name].mean()) / inputs[name].std() for name in columns], axis=1
    )
    centre, goal = windows.mean(axis=0), cut(target, first)
    design = windows - centre
    weights = np.linalg.solve(
        design.T @ design + penalty * np.eye(design.shape[1]), design.T @ (goal - goal.mean(axis=0))
    )

    def predict(starts):
        rows = np.concatenate(
            [(cut(inputs[name], starts) - inputs[name].mean()) / inputs[name].std() for name in columns],
            axis=1,
        )
        return goal.mean(axis=0) + (rows - centre) @ weights

    return predict


def error_with(columns):
    # a penalty of 10 is a guess; `fit` chooses one below
    return nrmse(fit_ridge_by_hand(columns, penalty=10.0)(last), cut(target, last))


gain, level = np.polyfit(inputs["volts"][: int(0.6 * len(target))], target[: int(0.6 * len(target))], 1)
errors = {
    "coarse": nrmse(cut(inputs["volts"], last), cut(target, last)),
    "level and gain": nrmse(level + gain * cut(inputs["volts"], last), cut(target, last)),
    "ridge, voltage alone": error_with(["volts"]),
    "ridge, all columns": error_with(["volts", "amperes", "celsius"]),
}
say("NRMSE on held-out time: " + ", ".join(f"{name} **{value:.3f}**" for name, value in errors.items()) + ".")
assert (
    errors["ridge, all columns"]
    < errors["ridge, voltage alone"]
    < errors["level and gain"]
    < errors["coarse"]
)

# %% [markdown]
# The other columns nearly halve the error of the best model of the voltage. Exercise 2 asks which of the two does.
#
# ## The same with the package
#
# `fit` pairs the two files on one clock, estimates a delay, chooses the penalty by blocks of time, learns noise from residuals that the
# enhancer has not seen, and reports on the last fifth. (Its errors are of other stretches of time than those above.) Ridge regression and
# noise that is drawn from residual windows need no network.

# %%
from enhsim_tf import FitOptions, fit

options = FitOptions(window=window, num_windows=600, enhancer="ridge", noise="residual windows")
model, report = fit(cleaned.parts, simulator, options)
for line in report.lines():
    print(line)

# %% [markdown]
# *Views* are the simple scores of a window that `score` adds up ([how](../docs/forms.md#how-telemetry-is-scored)): the line gives the share
# of held-out nominal time above the threshold of the sum, and of each view. *Range* is the share of time at which the coarse run leaves the
# values that it had in training. Here it is about a quarter: there, the enhanced run extrapolates. The package's ridge regression is the
# one above, with a penalty that it chooses:

# %%
from enhsim_tf.enhancer.ridge import fit_ridge

stacked = np.stack([cut(inputs[name], first) for name in simulator.columns], axis=2)
again = fit_ridge(stacked, cut(target, first), first)
ours = again.predict(np.stack([cut(inputs[name], last) for name in simulator.columns], axis=2))
mine = fit_ridge_by_hand(list(simulator.columns), again.penalty)(last)
# float32 and float64, and the scale of a column over all samples or over the training windows: a fiftieth of the signal's deviation
np.testing.assert_allclose(mine, ours, atol=0.02 * target.std())
say(
    f"Penalty chosen by cross-validation: **{again.penalty:g}**. NRMSE of the package's ridge on the same windows: "
    f"**{nrmse(ours, cut(target, last)):.3f}**."
)

# %% [markdown]
# ## A detector that knows what should happen
#
# Without a fault, telemetry minus enhanced run should be noise. So the detector looks at this residual only: its root mean square in
# short windows, with a conformal threshold. Which residuals should set the threshold? Those of time on which ridge regression was fitted
# are a little too small. *Cross-fitting* repairs this: cut the time into five blocks, fit the enhancer to four of them, without the
# windows that reach into the fifth, and take the residual of the fifth; and so on.

# %%
from enhsim_tf.enhancer.ridge import time_blocks


def scores_of(residual, length=60, stride=10):
    """Root mean square of the residual in short windows of ten minutes."""
    starts = np.arange(0, len(residual) - length + 1, stride)
    return starts, np.sqrt([np.mean(residual[start : start + length] ** 2) for start in starts])


def conformal(scores, rate=0.01):
    return np.sort(scores)[int(np.ceil((len(scores) + 1) * (1 - rate))) - 1]


known = int(0.8 * len(target))  # `fit` held out what comes later
starts = np.arange(0, known - window + 1, 25)
columns = np.stack([cut(inputs[name], starts) for name in simulator.columns], axis=2)
cross_fitted = []
for learnt, held_out in time_blocks(starts, 5, window):
    fitted = fit_ridge(columns[learnt], cut(target, starts[learnt]), starts[learnt])
    apart = held_out[:: window // 25]  # windows that share no sample
    residuals = cut(target, starts[apart]) - fitted.predict(columns[apart])
    cross_fitted.append(scores_of(residuals.ravel())[1])
threshold = conformal(np.concatenate(cross_fitted))

nominal_residual = target - model.enhance_run(run.values)[:, 0]
fitted_threshold = conformal(scores_of(nominal_residual[:known])[1])
later = scores_of(nominal_residual[known:])[1]
for name, limit in {"fitted time": fitted_threshold, "cross-fitting": threshold}.items():
    print(
        f"threshold by {name:14} {1e3 * limit:4.1f} mV, false alarms on later time {np.mean(later > limit):.1%}"
    )
assert np.mean(later > threshold) <= np.mean(later > fitted_threshold)

# %% [markdown]
# Only the threshold by cross-fitting keeps about the rate that it was set for.
#
# ## A run with a fault
#
# `telemetry_fault.csv` is what the vehicle would measure in a run in which the battery's resistance rises; the column `mask` of
# `simulator_fault.csv` says where. `simulator_planned.csv` is the coarse run of the same commands *without* the fault: nobody told the
# simulator of it.

# %%
measured = clean(read_source(folder / "telemetry_fault.csv")["volts"]).longest.values[:, 0].astype(float)
labels = pd.read_csv(folder / "simulator_fault.csv")["mask"].to_numpy() > 0
(planned,) = read_recording(folder / "simulator_planned.csv").parts
reference = {
    "coarse run": planned.values[:, simulator.columns.index("volts")],
    "enhanced run": model.enhance_run(planned.values)[:, 0],
}
own = {
    "coarse run": conformal(scores_of(target[:known] - inputs["volts"][:known])[1]),
    "enhanced run": threshold,
}
places = scores_of(measured)[0]
scores = {name: scores_of(measured - values)[1] for name, values in reference.items()}
in_fault = np.array([labels[start : start + 60].all() for start in places])
before = np.array([not labels[start : start + 60].any() for start in places])
alarms = {
    name: (np.mean(each[before] > own[name]), np.mean(each[in_fault] > own[name]))
    for name, each in scores.items()
}
with drawing(
    "Root mean square of the residual over the run with the fault, beside the enhanced and the coarse planned run",
    height=2.3,
    title=f"The enhanced run finds {alarms['enhanced run'][1]:.0%} of the fault, the coarse one {alarms['coarse run'][1]:.0%}",
) as panel:
    time_h = (places + 30) * model.interval_s / 3_600
    for name, color, style in (("coarse run", COARSE, DASHED), ("enhanced run", ENHANCED, "-")):
        panel.plot(time_h, 1e3 * scores[name], color=color, linestyle=style, label=f"telemetry minus {name}")
        panel.axhline(1e3 * own[name], color=color, linestyle=":", linewidth=0.9)
        panel.text(time_h[-1], 1e3 * own[name], f" threshold,\n {name}", fontsize=6, va="center")
    shade = {"transform": panel.get_xaxis_transform(), "color": QUIET, "alpha": 0.2, "label": "fault"}
    panel.fill_between(time_h, 0, 1, where=in_fault, **shade)
    panel.set(
        xlabel="time (h; grey: windows wholly in the fault)", ylabel="rms of the residual (mV)", yscale="log"
    )
    panel.minorticks_off()
    panel.set_yticks([5, 10, 20, 50, 100], ["5", "10", "20", "50", "100"])
    panel.legend(frameon=False, ncols=3, loc="upper left", bbox_to_anchor=(0, 1.2))
say(
    "Windows that raise an alarm before and during the fault: "
    + "; ".join(
        f"{name} **{first_part:.0%}** and **{second:.0%}**" for name, (first_part, second) in alarms.items()
    )
    + "."
)
found = in_fault & (scores["enhanced run"] > threshold)
amperes = scores_of(planned.values[:, simulator.columns.index("amperes")])[1]
say(
    f"Current (rms) in windows of the fault: **{amperes[found].mean():.1f} A** where the enhanced run finds it, "
    f"**{amperes[in_fault & ~found].mean():.1f} A** where not."
)
assert amperes[found].mean() > 2 * amperes[in_fault & ~found].mean()
assert alarms["enhanced run"][1] > alarms["coarse run"][1]
assert scores["enhanced run"][in_fault].min() < scores["enhanced run"][before].max()

# %% [markdown]
# *What to see:* from the onset on, the enhanced run's curve lies above its threshold, except in some stretches in which both curves fall:
# there, they are as low as before the fault. Hardly any current flows there, and a resistance without current shows nothing. The coarse
# run's threshold must bear its error on nominal time, so only the higher part of its curve is found. (Windows that straddle the onset or
# the end of the fault count in neither share.)
#
# ## What the study found
#
# This is one fault at its full severity, in one run. The [battery study](../studies/battery/README.md) has five faults at five severities,
# with ten seeds, here in its gentle regime (15 °C). It uses the same simulator in two ways: as a *reference*, as here, and as a *source* of
# windows that detectors learn from (third row). In the last row, the detectors learn from telemetry of 120 orbits.

# %%
uses = open_study("battery")[0]["regimes"]["gentle"]["uses"]
for name in (
    "reference: enhanced run",
    "reference: coarse run",
    "enhanced + residual windows",
    "real, 120 orbits",
):
    about = uses[name]
    print(
        f"{name:30} fault windows found {about['recall']['mean']:6.1%}   false alarms {about['false_alarms']['mean']:.2%}"
    )
assert (
    uses["reference: enhanced run"]["recall"]["mean"]
    > 3 * uses["enhanced + residual windows"]["recall"]["mean"]
)

# %% [markdown]
# A second [study](../studies/reference_or_source/README.md) uses one detector for all uses, the distance of the channels' means in a
# window, and varies what is known. Here is the battery again, with a simulator of *wrong physics* (a simpler model), five kinds of faults
# at five severities each, and ten seeds; the shaded ranges are 95 % [intervals](../docs/glossary.md#interval). Its numbers differ from
# those above, because the detector and the windows are others.

# %%
systems = open_study("reference_or_source")[0]["systems"]
points = [
    point
    for point in systems["battery"]["points"]
    if point["axis"] == "main" and point["simulator"] == "wrong physics"
]
looks = {
    "reference": ("reference, enhanced run", ENHANCED, "-", "o"),
    "coarse reference": ("reference, coarse run", COARSE, DASHED, "s"),
    "source": ("source, enhanced windows", GENERATED, ":", "^"),
    "no simulator": ("no simulator", REAL, "-", "x"),
}
recall = {use: [point["uses"][use]["recall"]["mean"] for point in points] for use in looks}
alarms_of = {use: [point["uses"][use]["false_alarms"]["mean"] for point in points] for use in looks}
num_windows = [5 * point["units"] for point in points]  # an orbit has five windows
with drawing(
    "Share of fault windows found over the number of known windows, for four uses of a simulator",
    height=2.4,
    title="The battery's simulator helps most as a reference, little as a source",
) as panel:
    for use, (label, color, style, marker) in looks.items():
        percent = [100 * value for value in recall[use]]
        panel.plot(
            num_windows, percent, color=color, linestyle=style, marker=marker, markersize=4, label=label
        )
    for use in ("reference", "source"):
        low, high = ([100 * point["uses"][use]["recall"][end] for point in points] for end in ("low", "high"))
        panel.fill_between(num_windows, low, high, color=looks[use][1], alpha=0.15, linewidth=0)
    panel.set(xlabel="known windows", ylabel="fault windows found (%)", xscale="log", ylim=(0, 100))
    panel.set_xlim(0.85 * num_windows[0], 1.18 * num_windows[-1])
    panel.set_xticks(num_windows, [f"{number:,}" for number in num_windows])
    panel.minorticks_off()
    panel.legend(frameon=False, loc="upper left", bbox_to_anchor=(1, 1))

# %% [markdown]
# *What to see:* from 100 known windows on, more windows help nobody much. Then the study's other system, an *aircraft* whose simulator is a
# point mass, with 100 known windows:

# %%
flights = next(
    point["uses"]
    for point in systems["aircraft"]["points"]
    if point["axis"] == "main" and point["simulator"] == "wrong physics" and point["units"] == 10
)
print(pd.DataFrame(alarms_of, index=num_windows).T.round(3).to_string(), end="\n\n")
for use, (label, *_) in looks.items():
    about = flights[use]
    print(
        f"aircraft, {label:26} found {about['recall']['mean']:5.1%} ({about['recall']['low']:.0%} to {about['recall']['high']:.0%})"
        f"   false alarms {about['false_alarms']['mean']:.1%}"
    )
assert min(recall["reference"]) > 2 * max(recall["source"])
assert max(alarms_of["reference"][2:]) < 0.01 < min(alarms_of["source"])
gain = flights["reference"]["recall"]["mean"] - flights["coarse reference"]["recall"]["mean"]
assert abs(gain) < 0.02  # enhancing adds next to nothing to this reference

# %% [markdown]
# **Answer.** Pair the files, let the enhancer learn the difference on nominal time, run the simulator beside the telemetry, and watch
# what is left. On the battery, in both studies, this finds several times as many fault windows as detectors that learn from generated
# windows or from telemetry. On the aircraft, the simulator is worth something as a reference (wide intervals, because its kinds of faults
# differ), but *enhancing* it adds next to nothing.
#
# ## Exercises
#
# **1.** The next cell puts the telemetry 7 samples early against the simulator's run. Let `estimate_delay` find it: which sign does the
# delay have, and how large is it in seconds?

# %%
from enhsim_tf.coarse.pairing import estimate_delay  # noqa: F401  for your answer

shifted = telemetry.part(7, len(telemetry))  # telemetry without its first seven samples...
shifted = type(shifted).of(shifted.values, shifted.interval_s, start=telemetry.start)  # ...on the old clock
delay_s = None  # your answer; see help(estimate_delay)

# %%
from notebooks import answers_tool

check_answer(
    delay_s,
    lambda answer: answer == answers_tool.delay_s(shifted, simulator, window),
    "Everything happens earlier in the telemetry now; help(estimate_delay) says what a sign means.",
)

# %% [markdown]
# **2.** The temperature is the third column. Is it worth having? Fit ridge regression to voltage and current alone, and give the ratio
# of its held-out error to that with all columns.

# %%
ratio = None  # your answer

# %%
check_answer(
    ratio,
    lambda answer: np.isclose(answer, answers_tool.ratio_without_temperature(error_with), rtol=0.01),
    "Use the function that gives the errors above.",
)
