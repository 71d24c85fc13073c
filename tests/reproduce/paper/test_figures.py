"""The figures hold the arrays they are given, stay legible, and are written the same way twice; most need no TensorFlow."""

import functools
import re
import struct
import subprocess
import sys
from types import SimpleNamespace

import matplotlib
import matplotlib.image
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from enhsim_tf.common import plot_style
from enhsim_tf.common.figure import WATERMARK, save
from enhsim_tf.common.stages import Stages
from enhsim_tf.reproduce.paper.data import Source
from enhsim_tf.reproduce.paper.figures import FIGURES
from enhsim_tf.reproduce.paper.figures.layer_table import layer_names, layer_rows
from enhsim_tf.reproduce.paper.pipeline import Experiment
from enhsim_tf.reproduce.settings import make_settings

WINDOW = 500
CAPTIONS = {  # of the paper's figures that have one
    1: "Enhanced simulation pipeline",
    2: "Training source and target time series",
    3: "Enhancing MLP neural network",
    4: "Enhanced simulation",
    8: "Extracted source noise",
    9: "Generator construction",
    10: "Discriminator construction",
    11: "GAN training",
    12: "Accuracy and loss for real and fake classifications",
    13: "Simulator output, enhanced, with noise added",
}


def rows(*shape, seed=0):
    return np.random.default_rng(seed).standard_normal(shape).astype(np.float32)


def window(*names, axis=None):
    axis = axis or {"time": np.arange(WINDOW) / 60, "time_unit": np.array("min"), "unit": np.array("dimensionless")}
    return {name: rows(WINDOW, seed=number) for number, name in enumerate(names)} | axis


def table(**changed):
    found = {
        "layer": ["dense_7", "Hidden_1", "conv1d"],
        "type": ["Dense", "Dense", "Conv1D"],
        "detail": ["relu", "linear", "500 filters, window 20, stride 4, relu"],
        "output_shape": ["(None, 64)", "(None, 3200)", "(None, 121, 500)"],
        "parameters": [1_088, 10_243_200, 12_525],
        "input_shape": "(None, 16)",
        "total": 10_256_813,
        "trainable": 10_256_685,
    }
    return {key: np.array(value) for key, value in (found | changed).items()}


def test_names_of_layers_do_not_tell_what_else_the_process_has_made():
    from enhsim_tf.noise.discriminator import build_discriminator

    found = [layer_names(build_discriminator(60, 8, seed=0).layers) for _ in range(2)]
    assert found == [["conv1d", "global_max_pooling1d", "dense", "dense_1"]] * 2
    layers = [type("Dense", (), {"name": name})() for name in ("Input", "Hidden_1", "dense_7", "Hidden_2", "dense_8")]
    assert layer_names(layers) == ["Input", "Hidden_1", "dense", "Hidden_2", "dense_1"]


def made_up(name):
    """Arrays of the shapes that `FIGURES[name].arrays` makes, of random values; None for a figure that is not listed here."""
    guess = {"rows": rows(8, WINDOW), "is_generated": np.array([0, 1, 1, 0, 0, 1, 0, 1], bool)}
    units = {"enhancer_units": np.array([500, 3_200, 3_200, 500]), "latent": rows(16)}
    errors = {"nrmse": np.array(0.094), "identity_nrmse": np.array(0.67), "ridge_nrmse": np.array(0.11), "truth_is_known": np.array(True)}
    ranks = {"rank_generated": np.array(28.06), "rank_real": np.array(371.6), "rank_windows": np.array(1_000.0)}
    history = {"iteration": np.arange(0, 1_001, 100)}
    history |= {f"accuracy_{kind}": np.linspace(0.9, last, 11) for kind, last in (("real", 0.62), ("generated", 0.41))}
    history |= {f"loss_{kind}": np.r_[first, np.full(10, 0.7)] for kind, first in (("real", 0.5), ("generated", 4.4))}
    numbers = {"batch_size": 200, "num_iterations": 1_000, "latent": 16, "mixed_batch": False}
    stored = {"time": np.datetime64("2020-01-01", "ms") + np.arange(3_600) * np.timedelta64(1, "s"), "values": rows(3_600)}
    stored |= {"name": np.array("attitude"), "num_samples": np.array(2_073_600), "interval_s": np.array(1.0), "unit": np.array("V")}
    return {
        "fig01_pipeline": lambda: window("telemetry", "coarse", "enhanced", "combined", "noise", "generated_noise") | units,
        "fig02_source_target": lambda: (
            window()
            | {
                "source": rows(3, WINDOW),
                "target": rows(3, WINDOW, seed=1),
                "begin": np.array([7.0, 90_061, 1e6]),
                "begin_unit": np.array("s"),
            }
        ),
        "fig03_enhancer": table,
        "fig04_enhanced_simulation": lambda: window("coarse", "enhanced", "truth") | errors,
        "fig05_real_or_generated": lambda: window() | guess,
        "fig06_real_or_generated_noise": lambda: window() | guess | ranks,
        "fig07_real_or_generated_series": lambda: window() | {key: value[:4] for key, value in guess.items()},
        "fig08_source_noise": lambda: (
            window("telemetry", "average", "noise") | {"standard_deviation": np.array(0.0979), "width": np.array(25)}
        ),
        "fig09_generator": table,
        "fig10_discriminator": lambda: table(input_shape="(None, 500, 1)"),
        "fig11_gan_training": lambda: {key: np.array(value) for key, value in numbers.items()},
        "fig12_accuracy_loss": lambda: history,
        "fig13_combined": lambda: window("coarse", "enhanced", "combined", "telemetry"),
        "fig14_telemetry_store": lambda: stored,
    }.get(name, lambda: None)()


class Recording(Stages):
    """Stages that are found in the cache of the smoke run; records which."""

    def __init__(self, cache):
        super().__init__(cache, tell=lambda line: None)
        self.names = set()

    def run(self, name, *others, **options):
        self.names.add(name)
        folder = super().run(name, *others, **options)
        assert self.cached[name]
        return folder


class TrainedByDoubler(Experiment):
    """The experiment with `Doubler` in place of the networks, which are asked for but not loaded."""

    @functools.cached_property
    def simulator(self):
        _ = self.enhancer_folder, self.noise_folder
        return Doubler()


@pytest.fixture(scope="module")
def arrays_of(smoke_run):
    """Arrays of any figure: made up, or of the smoke run for a figure that `made_up` does not know."""
    return lambda name: made_up(name) or FIGURES[name].arrays(TrainedByDoubler(make_settings("smoke"), Recording(smoke_run.cache)))


def words(figure):
    """All visible text of a figure, in one string."""
    return " | ".join(text.get_text() for text in figure.findobj(Text) if text.get_visible() and text.get_text())


def draw(name, **changed):
    return FIGURES[name].draw(made_up(name) | changed)


def test_names_numbers_and_captions():
    assert list(FIGURES) == sorted(FIGURES) and set(range(1, 15)) <= {figure.number for figure in FIGURES.values()}
    assert len({figure.number for figure in FIGURES.values()}) == len(FIGURES)
    assert all(name.startswith(f"fig{figure.number:02d}_") for name, figure in FIGURES.items())
    assert {figure.number: figure.title for figure in FIGURES.values() if figure.number in CAPTIONS} == CAPTIONS
    for number in (5, 6, 7):  # borrowed pictures, which cannot be reproduced
        assert "counterpart" in list(FIGURES.values())[number - 1].title
    assert all(len(figure.alt) > 60 and figure.alt.endswith(".") for figure in FIGURES.values())


@pytest.mark.parametrize("name", FIGURES)
def test_legible_at_column_width(name, arrays_of):
    figure = FIGURES[name].draw(arrays_of(name))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    width, height = figure.get_size_inches() * figure.dpi
    assert width / figure.dpi in (3.5, 7.2)
    out_of_view = []  # labels of ticks beyond the limits, which exist but are not drawn
    for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
        low, high = axis.get_view_interval()
        out_of_view += [tick.label1 for tick in axis.get_major_ticks() if not low <= tick.get_loc() <= high]
    shown = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text().strip() and text not in out_of_view]
    boxes = [text.get_window_extent(canvas.get_renderer()) for text in shown]
    for text, box in zip(shown, boxes, strict=True):
        assert text.get_fontsize() >= 7
        assert box.x0 >= 0 and box.y0 >= 0 and box.x1 <= width and box.y1 <= height, f"{text.get_text()!r} leaves the sheet"
    for number, box in enumerate(boxes):
        for other in range(number):
            touching = (
                min(box.x1, boxes[other].x1) - max(box.x0, boxes[other].x0),
                min(box.y1, boxes[other].y1) - max(box.y0, boxes[other].y0),
            )
            assert min(touching) < 2, f"{shown[number].get_text()!r} lies on {shown[other].get_text()!r}"


@pytest.mark.parametrize("name", FIGURES)
def test_drawing_changes_neither_arrays_nor_settings(name, arrays_of):
    data, before = arrays_of(name), dict(matplotlib.rcParams)
    for array in data.values():
        array.setflags(write=False)
    FIGURES[name].draw(data)
    assert dict(matplotlib.rcParams) == before


@pytest.mark.parametrize(
    ("name", "keys"),
    [
        ("fig01_pipeline", ("telemetry", "coarse", "enhanced", "combined", "noise", "generated_noise")),
        ("fig02_source_target", ("source", "target")),
        ("fig04_enhanced_simulation", ("coarse", "enhanced", "truth")),
        ("fig05_real_or_generated", ("rows",)),
        ("fig06_real_or_generated_noise", ("rows",)),
        ("fig07_real_or_generated_series", ("rows",)),
        ("fig08_source_noise", ("telemetry", "average", "noise")),
        ("fig12_accuracy_loss", ("accuracy_real", "accuracy_generated", "loss_real", "loss_generated")),
        ("fig13_combined", ("coarse", "enhanced", "combined", "telemetry")),
        ("fig14_telemetry_store", ("values",)),
    ],
)
def test_lines_hold_the_arrays(name, keys):
    data = made_up(name)
    figure = FIGURES[name].draw(data)
    lines = [line for axes in figure.axes for line in axes.lines]
    abscissa = data.get("iteration", data.get("time"))
    for key in keys:
        for values in np.atleast_2d(data[key]):
            found = [line for line in lines if np.array_equal(line.get_ydata(), values)]
            assert found and all(np.array_equal(line.get_xdata(), abscissa) for line in found), key


@pytest.mark.parametrize(
    ("name", "panel", "title", "key"),
    [
        ("fig02_source_target", 0, "Source", "source"),
        ("fig02_source_target", 3, "Target", "target"),
        ("fig13_combined", 0, "Simulator output", "coarse"),
        ("fig13_combined", 1, "Enhanced, with generated noise added", "combined"),
        ("fig13_combined", 2, "Real telemetry of the same time, held out", "telemetry"),
    ],
)
def test_panels_hold_what_their_titles_say(name, panel, title, key):
    data = made_up(name)
    axes = FIGURES[name].draw(data).axes[panel]
    assert title in [axes.get_title(loc="left"), *(text.get_text() for text in axes.texts)]
    assert np.array_equal(axes.lines[0].get_ydata(), np.atleast_2d(data[key])[0])


def test_labels_have_the_colour_of_their_curves():
    axes = draw("fig04_enhanced_simulation").axes[0]
    colors = {text.get_text(): text.get_color() for text in axes.texts}
    for line, label in zip(axes.lines, ("coarse", "enhanced", "true signal"), strict=True):
        assert colors[label] == plot_style.IN_PRINT.get(line.get_color(), line.get_color())


def test_panels_stand_in_the_order_of_the_rows():
    data = made_up("fig05_real_or_generated")
    figure = FIGURES["fig05_real_or_generated"].draw(data)
    for axes, values, letter in zip(figure.axes, data["rows"], "abcdefgh", strict=True):
        assert np.array_equal(axes.lines[0].get_ydata(), values) and axes.get_title(loc="left") == letter


@pytest.mark.parametrize(("name", "letters"), [("fig05_real_or_generated", "b, c, f, h"), ("fig07_real_or_generated_series", "b, c")])
def test_answer_stands_upside_down(name, letters):
    (answer,) = draw(name).findobj(lambda artist: artist.get_gid() == "answer")
    assert answer.get_text() == f"generated: {letters}" and answer.get_rotation() == 180


def test_real_and_generated_look_alike():
    figure = draw("fig05_real_or_generated")
    assert len({(axes.lines[0].get_color(), axes.lines[0].get_linewidth()) for axes in figure.axes}) == 1


def test_enhanced_simulation_says_what_the_errors_say():
    truth, error = made_up("fig04_enhanced_simulation")["truth"], np.float32(0.5)
    enhanced = truth + error * np.where(np.arange(WINDOW) % 2, 1, -1).astype(np.float32)
    text = words(draw("fig04_enhanced_simulation", enhanced=enhanced, coarse=truth))
    assert "reduces the error of the coarse simulation from 0.67 to 0.09" in text and "0.11 for ridge" in text.replace(" | ", " ")
    assert f"0.00 coarse, {0.5 / truth.std():.2f} enhanced" in " ".join(text.split(" | "))
    assert "increases the error of the coarse simulation from 0.67 to 0.70" in words(draw("fig04_enhanced_simulation", nrmse=np.array(0.7)))
    assert "true signal" not in words(draw("fig04_enhanced_simulation", truth_is_known=np.array(False)))


def test_numbers_of_other_figures_are_in_their_words():
    assert "effective rank of 1,000 windows: 28 generated, 372 real" in words(draw("fig06_real_or_generated_noise"))
    assert "not a reproduction" in words(draw("fig06_real_or_generated_noise")).replace(" | ", " ")
    assert "average of 25 samples leaves noise with a standard deviation of 0.0979" in words(draw("fig08_source_noise"))
    assert "lowers the standard deviation of white noise by 2.0 %." in words(draw("fig08_source_noise")).replace(
        " | ", " "
    )  # 1 - sqrt(24 / 25)
    assert "62 % of real and 41 % of generated noise is classified correctly" in words(draw("fig12_accuracy_loss"))
    text = words(draw("fig11_gan_training", batch_size=np.array(123), latent=np.array(9), num_iterations=np.array(4_567)))
    assert all(phrase in text for phrase in ("123 rows", "123 × 9 numbers", "4,567 iterations", "two updates"))
    assert "labels: real 1.0, generated 0.0" in text and "label reversed: generated 1.0" in text  # paper, section 2.3
    assert "one update" in words(draw("fig11_gan_training", mixed_batch=np.array(True)))
    assert "begins at 1 d 01:01:01" in words(draw("fig02_source_target"))  # 90,061 s
    assert "begins at sample 90,061" in words(draw("fig02_source_target", begin_unit=np.array("samples")))


@pytest.mark.parametrize(("factor", "said"), [(1.0, "is as rough as"), (0.5, "is less rough than"), (2.0, "is rougher than")])
def test_combined_compares_roughness(factor, said):
    telemetry = rows(WINDOW)
    assert said in words(draw("fig13_combined", telemetry=telemetry, combined=factor * telemetry))


def test_accuracy_and_loss_show_chance_and_what_is_off_scale():
    accuracy, loss = draw("fig12_accuracy_loss").axes
    assert 0.5 in [line.get_ydata()[0] for line in accuracy.lines] and np.log(2) in [line.get_ydata()[0] for line in loss.lines]
    assert accuracy.get_ylim() == (0, 1) and 0.7 < loss.get_ylim()[1] < 4.4
    assert "off scale:\n4.4 generated" in words(loss.figure)
    tame = made_up("fig12_accuracy_loss")["loss_real"]
    assert "off scale" not in words(draw("fig12_accuracy_loss", loss_generated=tame))


@pytest.mark.parametrize("measure", ["accuracy", "loss"])
def test_accuracy_and_loss_are_labelled_at_the_ends_of_their_curves(measure):
    level = {"accuracy": 0.5, "loss": np.log(2)}[measure]  # balanced: both curves end at chance
    figure = draw("fig12_accuracy_loss", **{f"{measure}_{kind}": np.full(11, level) for kind in ("real", "generated")})
    axes = next(axes for axes in figure.axes if axes.get_title(loc="left") == measure.capitalize())
    assert axes.get_title(loc="right") == f"dotted: chance ({'0.5' if measure == 'accuracy' else 'ln 2'})"
    places = {text.get_text(): text.xy[1] for text in axes.texts}
    gaps = [places[kind] - level / axes.get_ylim()[1] for kind in ("real", "generated")]
    one_line = 7.5 * 1.4 / 72 / (axes.get_position().height * figure.get_size_inches()[1])
    assert np.abs(gaps).max() < 0.6 * one_line and 0.8 * one_line < abs(gaps[0] - gaps[1])


def test_telemetry_store_with_and_without_times():
    axes = draw("fig14_telemetry_store").axes[0]
    assert "UTC, from 2020-01-01" in words(axes.figure) and "value (V)" in words(axes.figure)
    FigureCanvasAgg(axes.figure).draw()
    assert "00:30" in [label.get_text() for label in axes.get_xticklabels()]
    assert "time (samples)" in words(draw("fig14_telemetry_store", time=np.arange(3_600.0)))


@pytest.mark.parametrize("name", ["fig03_enhancer", "fig09_generator"])
def test_layer_table(name):
    texts = {text.get_text(): text.get_position()[1] for text in draw(name).axes[0].texts}
    cells = ["(None, 64)", "1,088", "(None, 3200)", "10,243,200", "(None, 121, 500)", "12,525", "10,256,813"]
    heights = [texts[cell] for cell in cells]
    assert heights == sorted(heights, reverse=True) and heights[0] == heights[1] > heights[2] == heights[3]
    assert {"Dense", "Hidden_1 (Dense)", "Conv1D", "relu", "input (None, 16)", "128 not trainable"} <= set(texts)


def contrast(one, other):
    """Contrast of two colours as WCAG 2 defines it, from 1 to 21."""
    light = []
    for color in (one, other):
        channels = [int(color[place : place + 2], 16) / 255 for place in (1, 3, 5)]
        linear = [value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4 for value in channels]
        light.append(np.dot(linear, (0.2126, 0.7152, 0.0722)) + 0.05)
    return max(light) / min(light)


def test_words_have_contrast_and_curves_of_one_panel_survive_grey():
    for ink in (plot_style.REAL, plot_style.QUIET, plot_style.ENHANCED, *plot_style.IN_PRINT.values()):
        assert contrast(ink, "#ffffff") > 4.5 and contrast(ink, plot_style.GREY_TINT) > 4.5
    pairs = [
        (plot_style.COARSE, plot_style.ENHANCED),
        (plot_style.ENHANCED, plot_style.REAL),
        (plot_style.REAL, plot_style.GENERATED),
        (plot_style.REAL, plot_style.AVERAGE),
    ]
    assert min(contrast(*pair) for pair in pairs) > 1.5


@pytest.mark.parametrize("name", FIGURES)
def test_saved_files(name, tmp_path, arrays_of):
    caption, data = "seed 0 · full budget", arrays_of(name)
    png, svg = save(name, data, tmp_path, caption, is_smoke=False, figures=FIGURES)
    assert (png.name, svg.name) == (f"{name}.png", f"{name}.svg") and sorted(tmp_path.iterdir()) == [png, svg]
    inches = FIGURES[name].draw(data).get_size_inches()
    assert struct.unpack(">II", png.read_bytes()[16:24]) == tuple(np.round(200 * inches).astype(int))
    assert max(png.stat().st_size, svg.stat().st_size) < 1e6
    text, bytes_of_both = svg.read_text(encoding="utf-8"), (png.read_bytes(), svg.read_bytes())
    assert caption in text and f"<title>{FIGURES[name].title}</title>" in text
    assert "dc:date" not in text and WATERMARK not in text
    assert tuple(path.read_bytes() for path in save(name, data, tmp_path, caption, is_smoke=False, figures=FIGURES)) == bytes_of_both


def test_smoke_is_marked_in_both_files(tmp_path):
    data, images = made_up("fig09_generator"), []
    for is_smoke in (True, False):
        png, svg = save("fig09_generator", data, tmp_path, "seed 0", is_smoke, figures=FIGURES)
        assert (WATERMARK in svg.read_text(encoding="utf-8")) == is_smoke
        images.append(matplotlib.image.imread(png)[..., :3])
    marked = np.any(images[0] != images[1], axis=2)
    assert 0.03 < marked.mean() < 0.3  # unmistakable, and the figure still there
    assert [path.name for path in save("fig09_generator", data, tmp_path, "x", False, saved_as=("svg",), figures=FIGURES)] == [
        "fig09_generator.svg"
    ]


def test_drawing_needs_neither_screen_nor_tensorflow_nor_pyplot():
    code = "import sys; from enhsim_tf.reproduce.paper.figures import FIGURES; list(FIGURES.values()); print([name for name in sys.modules if name in "
    code += "('tensorflow', 'keras', 'matplotlib.pyplot', 'tkinter')])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == "[]"


# -- the arrays behind the figures, of a simulator whose answers are known ----------------------------------------------------


class Doubler:
    """Stands for an EnhancedSimulator: enhancing doubles, noise is 7, generated windows are 9."""

    enhancer = SimpleNamespace(layers=[SimpleNamespace(units=width) for width in (500, 3_200, 3_200, 500)])
    noise = SimpleNamespace(
        generator=SimpleNamespace(input_shape=(None, 16), layers=[SimpleNamespace(units=64)]),
        discriminator=SimpleNamespace(layers=[SimpleNamespace(units=1)]),
        generate=lambda number, seed: np.full((number, WINDOW), 7, np.float32),
    )
    enhance = staticmethod(lambda coarse: 2 * coarse)
    generate = staticmethod(lambda number, seed: np.full((number, WINDOW), 9, np.float32))
    generate_series = staticmethod(lambda length, seed, start_s: np.full(length, 9, np.float32))


@pytest.fixture(scope="module", params=["paper", "channel"])
def experiment(request, tmp_path_factory):
    """The paper's example or a recorded channel; what a network would have to be trained for is put in its place."""
    folder, source = tmp_path_factory.mktemp("stages"), None
    if request.param == "channel":
        pulse = np.clip(np.sin(2 * np.pi * np.arange(2_700) / 98.5), -0.4, 0.9)
        np.save(folder / "T-9.npy", np.stack([pulse + 0.02 * rows(2_700), 0 * pulse], axis=1))
        source = Source(folder / "T-9.npy", "0")
    experiment = Experiment(make_settings("smoke"), Stages(folder, tell=lambda line: None), source)
    experiment.simulator, experiment.noise_history = Doubler(), made_up("fig12_accuracy_loss")
    experiment.enhancement = {"nrmse": np.array(0.1), "identity_nrmse": np.array(0.7), "ridge_nrmse": np.array(0.2)}
    experiment.resemblance = {f"noise_{key}": np.array(3.0) for key in ("rank", "real_rank", "num_windows")}
    return experiment


@pytest.mark.parametrize("name", [name for name in FIGURES if name[3:5] not in ("03", "09", "10")])
def test_arrays_are_plain_repeatable_and_draw(experiment, name, tmp_path):
    data, again = (FIGURES[name].arrays(experiment) for _ in range(2))
    np.savez(tmp_path / "arrays.npz", **data)
    with np.load(tmp_path / "arrays.npz", allow_pickle=False) as kept:
        assert set(kept) == set(again)
        assert all(np.array_equal(kept[key], again[key], equal_nan=again[key].dtype.kind == "f") for key in again)
    save(name, data, tmp_path, "seed 0", is_smoke=True, saved_as=("png",), figures=FIGURES)


@pytest.mark.parametrize("name", FIGURES)
def test_a_figure_needs_exactly_the_stages_that_it_names(smoke_run, name):
    stages = Recording(smoke_run.cache)
    FIGURES[name].arrays(TrainedByDoubler(make_settings("smoke"), stages))
    assert stages.names == set(FIGURES[name].stages)
    assert FIGURES[name].needs_training == bool(stages.names & {"enhancer", "noise GAN"})


def test_a_layer_table_is_that_of_the_network_that_is_trained(tmp_path):
    experiment = Experiment(make_settings("smoke", enhancer__epochs=1, enhancer__hidden_units=8), Stages(tmp_path, tell=lambda line: None))
    enhancer, noise = experiment.simulator.enhancer, experiment.simulator.noise
    trained = {"fig03_enhancer": enhancer, "fig09_generator": noise.generator, "fig10_discriminator": noise.discriminator}
    for name, network in trained.items():
        table, same = FIGURES[name].arrays(experiment), layer_rows(network)
        assert set(table) == set(same) and all(np.array_equal(table[key], same[key]) for key in table), name


def test_source_and_target_are_of_the_same_times(experiment):
    data, series = FIGURES["fig02_source_target"].arrays(experiment), experiment.data.channels[0].telemetry
    for source, target, begin in zip(data["source"], data["target"], data["begin"].astype(int), strict=True):
        assert np.array_equal(target, series.values[begin : begin + WINDOW])
        if experiment.is_paper:  # the paper's square waves, written down a second time
            time = begin + np.arange(WINDOW)
            assert np.array_equal(source, np.where(time % 480 < 240, 0.5, -0.5) + np.where(time % 120 < 60, 0.25, -0.25))
    assert len(set(data["begin"])) == 3 and data["begin"].max() + WINDOW <= len(experiment.data.channels[0].train)


def test_noise_is_what_the_average_leaves(experiment):
    data = FIGURES["fig08_source_noise"].arrays(experiment)
    assert np.allclose(data["telemetry"] - data["average"], data["noise"], atol=1e-6)
    assert np.allclose(np.convolve(data["telemetry"], np.full(25, 1 / 25), "valid"), data["average"][12:-12], atol=1e-5)
    if experiment.is_paper:  # sigma^2 (1 - 1/w), and the bend of the 2-minute wave within the average
        assert data["standard_deviation"] == pytest.approx(0.1 * np.sqrt(24 / 25), rel=0.02)


def test_combined_adds_noise_to_the_enhanced_held_out_window(experiment):
    data, test = FIGURES["fig13_combined"].arrays(experiment), experiment.data.channels[0].test.values
    assert np.array_equal(data["enhanced"], 2 * data["coarse"]) and np.array_equal(data["combined"], data["enhanced"] + 7)
    assert any(np.array_equal(test[begin : begin + WINDOW], data["telemetry"]) for begin in range(len(test) - WINDOW + 1))


@pytest.mark.parametrize(
    ("name", "value"), [("5_real_or_generated", 9), ("6_real_or_generated_noise", 7), ("7_real_or_generated_series", 9)]
)
def test_marked_rows_are_the_generated_ones(experiment, name, value):
    data = FIGURES[f"fig0{name}"].arrays(experiment)
    assert np.array_equal(np.all(data["rows"] == value, axis=1), data["is_generated"])
    assert data["is_generated"].mean() == 0.5 and np.isfinite(data["rows"]).all()
    if value == 9:  # the others are held out
        test = experiment.data.channels[0].test.values
        assert np.isin(data["rows"][~data["is_generated"]], test).all()


def test_layer_tables_of_the_papers_networks(tmp_path):
    experiment = Experiment(make_settings(), Stages(tmp_path, tell=lambda line: None))
    experiment.data = SimpleNamespace(window=WINDOW)
    generator, discriminator = (FIGURES[name].arrays(experiment) for name in ("fig09_generator", "fig10_discriminator"))
    assert generator["parameters"].tolist() == [16 * 64 + 64, 4 * 64, 64 * 500 + 500, 0]
    assert int(generator["total"] - generator["trainable"]) == 2 * 64  # the moving mean and variance
    assert discriminator["parameters"].tolist() == [20 * 500 + 500, 0, 500 * 25 + 25, 25 + 1]
    assert discriminator["output_shape"].tolist() == ["(None, 121, 500)", "(None, 500)", "(None, 25)", "(None, 1)"]
    assert discriminator["detail"][0] == "500 filters, window 20, stride 4, relu"
    text = words(FIGURES["fig10_discriminator"].draw(discriminator))
    assert re.search(r"23,051", text) and "maps 500 samples of noise to the probability" in text.replace(" | ", " ")
