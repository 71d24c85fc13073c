"""The figure of injected anomalies."""

from collections.abc import Sequence

import matplotlib.dates
import matplotlib.figure
import matplotlib.style

from enhsim_tf.common.errors import counted, spoken
from enhsim_tf.common.plot_style import (
    REAL,
    STYLE,
)
from enhsim_tf.datasets.inject import Injected
from enhsim_tf.datasets.label_columns import value_columns
from enhsim_tf.scoring.figure import MOST_CHANNELS, Sheet, drawable


@matplotlib.style.context(STYLE)
def inject_figure(injected: Injected, channels: Sequence[str]) -> matplotlib.figure.Figure:
    """Draws telemetry of these channels into which `datasets.inject` has put anomalies: the first
    ones that are changed.
    """
    frame = injected.table
    anomalies = injected.anomalies
    of_channel = {
        name: [anomaly for anomaly in anomalies if anomaly.channel in (None, name)]
        for name in channels
    }
    shown = [name for name in channels if of_channel[name]][:MOST_CHANNELS]
    title = (
        f"{drawable(spoken(channels), 30)}: {counted(len(anomalies), 'anomaly')}, "
        f"{int(frame['mask'].sum()):,} of {len(frame):,} samples changed"
    )
    subtitle = f"Shaded: {', '.join(dict.fromkeys(anomaly.kind for anomaly in anomalies))}."
    if len(shown) < len(channels):
        subtitle += f" Drawn: {len(shown)} of {len(channels)} channels."
    sheet = Sheet(frame.index, injected.clock, shown, title, subtitle, "inject", above=0.4)
    for axes, name in zip(sheet.axes, shown, strict=True):
        sheet.curve(axes, frame[value_columns(channels)[name]], REAL, 0.6)
        spans = [(anomaly.begin, anomaly.end, anomaly.kind) for anomaly in of_channel[name]]
        sheet.shade(axes, spans)
    return sheet.figure
