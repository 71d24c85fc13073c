"""The figure of a channel's report: its title, its curves, and no overlapping text for any numbers."""

import dataclasses
import warnings

import matplotlib
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.text import Text

from enhsim_tf.detection.anomalies import INJECTIONS
from enhsim_tf.enhanced_simulator.report import ChannelReport
from enhsim_tf.enhanced_simulator.report_figure import channel_figure, drawable

DETECTORS = ("limit check", "PCA residual", "nearest neighbours", "isolation forest")


def made_up(scale=1.0, offset=0.0, seed=0, **changed):
    rng = np.random.default_rng(seed)
    examples = {key: offset + scale * rng.standard_normal(200).astype(np.float32) for key in ("coarse", "enhanced", "generated", "real")}
    fields = {
        "channel": "volts",
        "window": 200,
        "period_s": 400.0,
        "is_held_out": True,
        "num_windows": 200,
        "num_disjoint": 5,
        "nrmse": {"coarse": 0.5, "ridge": 0.3, "nearest": 0.45, "enhanced": 0.2},
        "noise": [],
        "noise_window": 16,
        "false_alarms": {"generated": dict(zip(DETECTORS, (0.0, 0.01, 0.08, 1.0), strict=True)), "real": dict.fromkeys(DETECTORS, 0.02)},
        "recall": {name: dict(zip(INJECTIONS, np.linspace(0, 1, len(INJECTIONS)), strict=True)) for name in DETECTORS},
        "noise_sd": 0.2,
        "examples": examples,
        "unit": "V",
    }
    return ChannelReport(**fields | changed)


NAN = dict.fromkeys(("coarse", "ridge", "nearest", "enhanced"), float("nan"))
CASES = {
    "usual": made_up(),
    "no better": made_up(nrmse={"coarse": 0.5, "ridge": 0.3, "nearest": 0.45, "enhanced": 0.6}),
    "ridge": made_up(nrmse={"coarse": 0.5, "ridge": 0.1, "nearest": 0.45, "enhanced": 0.2}),
    "perfect": made_up(nrmse={"coarse": 0.0, "ridge": 0.0, "nearest": 0.0, "enhanced": 0.0}),
    "still": made_up(nrmse=NAN, examples=dict.fromkeys(("coarse", "enhanced", "generated", "real"), np.full(200, 7.0))),
    "large": made_up(scale=1e9),
    "small": made_up(scale=1e-9),
    "far from zero": made_up(offset=1.2345e6),
    "negative": made_up(scale=5e4, offset=-1e5),
    "long name": made_up(channel="a name that is much longer than any column name should be " * 3, unit="millidegrees Celsius per hour"),
    "long label": made_up(offset=1.2345e6, unit="millidegrees Celsius per hour"),
    "dollars": made_up(channel="$x_{\\undefined}$ $", unit="$"),
    "hostile": made_up(channel="../<b>\n\x1b[31m漢字", unit="°C"),
    "no unit": made_up(unit="1"),
    "none usable": made_up(false_alarms={arm: dict.fromkeys(DETECTORS, 1.0) for arm in ("generated", "real")}),
    "all alike": made_up(num_windows=1, num_disjoint=1, is_held_out=False),
}


def shown(figure):
    """Returns visible texts with their boxes in pixels, without tick labels outside the axis limits."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    out_of_view = []
    for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
        low, high = sorted(axis.get_view_interval())
        out_of_view += [tick.label1 for tick in axis.get_major_ticks() if not low <= tick.get_loc() <= high]
    texts = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text().strip() and text not in out_of_view]
    return [(text, text.get_window_extent(canvas.get_renderer())) for text in texts]


@pytest.mark.filterwarnings("error")  # a character that is missing in the font would be a warning
@pytest.mark.parametrize("case", CASES)
def test_texts_stay_on_the_page_and_do_not_overlap(case):
    figure = channel_figure(CASES[case])
    boxes = shown(figure)
    width, height = figure.get_size_inches() * figure.dpi
    assert figure.get_size_inches()[0] == 7.2 and len(boxes) > 20
    for number, (text, box) in enumerate(boxes):
        assert text.get_fontsize() >= 7
        assert box.x0 >= 0 and box.y0 >= 0 and box.x1 <= width and box.y1 <= height, f"{text.get_text()!r} leaves the sheet"
        for other, there in boxes[:number]:
            touching = min(box.x1, there.x1) - max(box.x0, there.x0), min(box.y1, there.y1) - max(box.y0, there.y0)
            assert min(touching) < 2, f"{text.get_text()!r} lies on {other.get_text()!r}"


@pytest.mark.parametrize("case", CASES)
def test_texts_do_not_overlap_other_panels(case):
    figure = channel_figure(CASES[case])
    for axes in figure.axes:
        frame = axes.get_window_extent()
        for text, box in shown(figure):
            inside = min(box.x1, frame.x1) - max(box.x0, frame.x0) > 2 and min(box.y1, frame.y1) - max(box.y0, frame.y0) > 2
            assert not inside or text in axes.texts, f"{text.get_text()!r} lies in a panel"


@pytest.mark.parametrize(
    ("nrmse", "message"),
    [
        ({"coarse": 0.5, "ridge": 0.3, "nearest": 0.45, "enhanced": 0.2}, "60% nearer to the telemetry than the coarse one"),
        (
            {"coarse": 0.5, "ridge": 0.1, "nearest": 0.45, "enhanced": 0.2},
            "60% nearer to the telemetry than the coarse one, but no nearer than ridge regression",
        ),
        (
            {"coarse": 0.5, "ridge": 0.3, "nearest": 0.1, "enhanced": 0.2},
            "60% nearer to the telemetry than the coarse one, but no nearer than the nearest training windows",
        ),
        ({"coarse": 0.2, "ridge": 0.3, "nearest": 0.45, "enhanced": 0.2}, "no nearer to the telemetry than the coarse one"),
        ({"coarse": 0.0, "ridge": 0.0, "nearest": 0.0, "enhanced": 0.0}, "no nearer to the telemetry than the coarse one"),
        (NAN, "nothing can be said of the enhanced signal"),
    ],
)
def test_the_title_states_the_result(nrmse, message):
    texts = [text for text in channel_figure(made_up(nrmse=nrmse)).texts if text.get_weight() == "bold"]
    assert " ".join(text.get_text() for text in texts).startswith("volts: ") and message in " ".join(text.get_text() for text in texts)


def test_curves_and_rates_agree_with_the_report():
    report = made_up()
    signal, alarms, made, found = channel_figure(report).axes
    drawn = [line.get_ydata() for line in signal.lines]
    for values, key in zip(drawn, ("real", "coarse", "enhanced"), strict=True):
        np.testing.assert_array_equal(values, report.examples[key])
    np.testing.assert_array_equal(made.lines[0].get_ydata(), report.examples["generated"])
    dots = {line.get_markerfacecolor(): line.get_xdata() for line in alarms.lines if line.get_marker() == "o"}
    np.testing.assert_allclose(dots.pop("none"), [2, 2, 2, 2])
    np.testing.assert_allclose(next(iter(dots.values())), [0, 1, 8, 100])
    assert [label.get_text() for label in alarms.get_yticklabels()] == list(DETECTORS)
    assert [label.get_text() for label in found.get_yticklabels()] == [kind.replace("_", " ") for kind in INJECTIONS]
    np.testing.assert_allclose(found.lines[0].get_xdata(), 100 * np.linspace(0, 1, len(INJECTIONS)))


@pytest.mark.parametrize(
    ("case", "label"),
    [("usual", "value (V)"), ("no unit", "value"), ("large", "value (V, 1e9)"), ("far from zero", "value (V, +1.2345e6)")],
)
def test_axis_labels_contain_units(case, label):
    signal, alarms, made, found = channel_figure(CASES[case]).axes
    assert signal.get_xlabel() == made.get_xlabel() == "sample"
    assert signal.get_ylabel() == label
    assert "(%)" in alarms.get_xlabel() and "(%)" in found.get_xlabel()


def test_curves_of_a_panel_can_be_distinguished_without_colour():
    signal = channel_figure(made_up()).axes[0]
    looks = [(line.get_linestyle(), line.get_linewidth()) for line in signal.lines]
    assert len(set(looks)) == 3
    grey = sorted(0.2126 * red + 0.7152 * green + 0.0722 * blue for red, green, blue in (to_rgb(line.get_color()) for line in signal.lines))
    assert np.diff(grey).min() > 0.1


def test_the_footer_states_the_number_of_disjoint_windows():
    for report, words in ((made_up(), "200 windows, of which 5 share no sample"), (CASES["all alike"], "rates on 1 window")):
        assert any(text.get_text().endswith(words) for text in channel_figure(report).texts)


def test_drawing_changes_neither_the_report_nor_the_style_settings():
    report, before = made_up(), dict(matplotlib.rcParams)
    kept = {key: values.copy() for key, values in report.examples.items()}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        channel_figure(dataclasses.replace(report))
    assert dict(matplotlib.rcParams) == before
    assert all((report.examples[key] == values).all() for key, values in kept.items())


@pytest.mark.parametrize(
    ("text", "expected"), [("a\nb", "a?b"), ("漢 ü°", "? ü°"), ("$x$", r"\$x\$"), ("x" * 61, "x" * 57 + "..."), ("", "")]
)
def test_text_that_can_be_drawn(text, expected):
    assert drawable(text) == expected
