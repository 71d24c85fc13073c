"""The figure of a channel's report: what the simulator makes of the coarse signal, and what detectors trained on it say."""

import matplotlib.figure
import matplotlib.style
import numpy as np

from enhsim_tf.channel_report import SEVERITY, ChannelReport
from enhsim_tf.sheet import COARSE, DOUBLE, EDGE, ENHANCED, GENERATED, QUIET, REAL, STYLE, new_sheet, panels


def channel_figure(report: ChannelReport) -> matplotlib.figure.Figure:
    """Draws the report of one channel.

    Args:
        report: The report.
    """
    name = "".join(letter if letter.isprintable() else "?" for letter in report.channel).replace("$", r"\$")[:60]
    ours, coarse = report.nrmse["enhanced"], report.nrmse["coarse"]
    title = f"{name}: the enhanced signal is {1 - ours / coarse:.0%} nearer to the telemetry than the coarse one"
    if ours >= coarse:
        title = f"{name}: the enhanced signal is no nearer to the telemetry than the coarse one"
    where = "on telemetry that was held out" if report.is_held_out else "on the telemetry that it learnt from"
    subtitle = f"NRMSE {coarse:.2f} coarse, {report.nrmse['ridge']:.2f} ridge regression, {ours:.2f} enhanced, {where}."
    with matplotlib.style.context(STYLE):
        figure, down = new_sheet(DOUBLE, 4.0, title, subtitle)
        (signal, alarms), (made, found) = panels(figure, down, 2, 2, gap=(0.45, 0.28))
        for key, color, words in (("real", REAL, "telemetry"), ("coarse", COARSE, "coarse"), ("enhanced", ENHANCED, "enhanced")):
            signal.plot(report.examples[key], color=color, label=words, linewidth=1)
        signal.legend(frameon=False, fontsize=6, ncols=3, loc="upper center", bbox_to_anchor=(0.5, 1.16))
        made.plot(report.examples["generated"], color=GENERATED, linewidth=1)
        made.set_title("a generated window, with noise", fontsize=7, color=QUIET)
        made.set_xlabel("sample")
        for panel in (signal, made):
            panel.set_ylabel("value")
        _bars(alarms, report.false_alarms["generated"], report.false_alarms["real"], "false alarms on real windows")
        kinds = list(next(iter(report.recall.values())))
        best = {kind.replace("_", " "): max(rates[kind] for rates in report.recall.values()) for kind in kinds}
        _bars(found, best, None, f"anomalies of {SEVERITY:g} sd found, best detector")
        figure.text(EDGE / DOUBLE, 0.012, f"python -m enhsim_tf fit · windows of {report.window} samples", size=6.5, color=QUIET)
    return figure


def _bars(panel: matplotlib.axes.Axes, shares: dict[str, float], others: dict[str, float] | None, words: str) -> None:
    places = np.arange(len(shares))[::-1]
    panel.barh(places, [100 * share for share in shares.values()], 0.6 if others is None else 0.35, color=ENHANCED)
    if others is not None:
        panel.barh(places - 0.36, [100 * others[name] for name in shares], 0.35, color=REAL)
        words += " (%), trained on generated (blue), real (black)"
    else:
        words += " (%)"
    panel.set_yticks(places, list(shares), fontsize=6)
    panel.set_xlim(0, 100)
    panel.set_title(words, fontsize=7, color=QUIET, loc="right")
