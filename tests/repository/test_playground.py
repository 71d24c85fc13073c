"""The playground: its page computes in a real Chromium what `enhsim_tf` computes in Python."""

import sys
from pathlib import Path

import numpy as np
import pytest

from book.__main__ import PLAYGROUND
from book.playground_data import LARGEST, SIGNALS, directions_of, read

sys.path.insert(0, str(Path(__file__).parent))
import chromium

VALUES, ARRAYS = read(PLAYGROUND / "data.js")
CODE = ["index.html", "playground.css", "numbers.js", "page.js"]
TOLERANCE = 1e-5
needs_chromium = pytest.mark.skipif(chromium.PROGRAM is None, reason="there is no Chromium")
CHOICES = [
    {"signal": "enhanced", "noise": "none", "scale": 1, "fault": "drift"},
    {"signal": "enhanced", "noise": "gaussian", "scale": 1.1, "fault": "gain_loss"},
    {"signal": "enhanced", "noise": "gan", "scale": 1, "fault": "stuck"},
    {"signal": "enhanced", "noise": "gan", "scale": 1, "fault": "stuck", "noisy": 1},
    {"signal": "enhanced", "noise": "residuals", "scale": 0.9, "fault": "period_change"},
    {"signal": "coarse", "noise": "gaussian", "scale": 1, "fault": "drift"},
    {"signal": "real", "noise": "none", "scale": 1, "fault": "stuck"},
]


# -- small, and in one folder -----------------------------------------------------------------------


def test_code_and_data_are_small_and_name_no_place_in_the_network():
    code = {name: (PLAYGROUND / name).read_text(encoding="utf-8") for name in CODE}
    assert sorted(path.name for path in PLAYGROUND.iterdir()) == sorted([*CODE, "data.js"])
    assert sum(len(text.encode()) for text in code.values()) <= 25_000
    assert max(len(line) for text in code.values() for line in text.splitlines()) <= 100
    assert (PLAYGROUND / "data.js").stat().st_size <= LARGEST
    assert [name for name, text in code.items() if "://" in text] == []


def test_directions_are_those_of_the_largest_variance():
    rng = np.random.default_rng(0)
    windows = 2 + rng.standard_normal((5_000, 4)) * [1, 9, 1, 3]
    mean, directions = directions_of(windows, 2)
    np.testing.assert_allclose(mean, 2, atol=0.5)
    np.testing.assert_allclose(np.abs(directions), np.eye(4)[[1, 3]], atol=0.05)


# -- in the browser ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    with chromium.browser(tmp_path_factory.mktemp("profile")) as opened:
        opened.resize(1200, 900)
        opened.open((PLAYGROUND / "index.html").as_uri())
        yield opened


def javascript(page, code):
    """The value of an expression, in which arrays of windows become lists."""
    return np.array(page.evaluate(f"({code}).map((row) => row.length ? [...row] : row)"))


def argument(choice):
    return str({"severity": 0.4, "rate": 0.05} | choice)


def generator():
    from enhsim_tf.common.backend import keras

    network = keras.Sequential(
        [
            keras.Input((VALUES["latent"],)),
            keras.layers.Dense(ARRAYS["generator_1"].size, "relu"),
            keras.layers.BatchNormalization(),
            keras.layers.Dense(VALUES["window"], VALUES["activation"]),
        ]
    )
    network.set_weights([ARRAYS[f"generator_{number}"] for number in range(8)])
    return network


def faulty_windows(mode, severity):
    from enhsim_tf.paper.degraded import degrade
    from enhsim_tf.paper.settings import make_settings
    from enhsim_tf.paper.telemetry import true_signal

    settings = make_settings()
    begins = ARRAYS["judged_time"].ravel()
    times = begins[:, None] + settings.interval * np.arange(settings.window)
    signal = true_signal(settings)
    rng, levels = np.random.default_rng(0), tuple(VALUES["levels"])
    period = settings.rotation_period
    degraded = degrade(signal, times, mode, severity, levels, period, rng, VALUES["onset"])
    return degraded + ARRAYS["judged"] - signal(times)


def scores_of(training, windows, subspace):
    """The sum of the package's views; the subspace is one of the file."""
    from enhsim_tf.scoring.views import VIEWS

    views = {name: VIEWS[name]() for name in ("subspace", "level", "spread", "step")}
    mean, *directions = ARRAYS[f"{subspace}_directions"]
    views["subspace"]._mean, views["subspace"]._components = mean, np.array(directions)
    scores = []
    for name, view in views.items():
        if name != "subspace":  # it has learnt the clean windows
            view.fit(training[:, :, None])
        learnt, judged = (view.score(rows[:, :, None]) for rows in (training, windows))
        scores.append([row / max(np.quantile(learnt, 0.99), 0.01) for row in (learnt, judged)])
    return [np.sum(rows, axis=0) for rows in zip(*scores, strict=True)]


@needs_chromium
@pytest.mark.slow
@pytest.mark.parametrize("choice", CHOICES, ids=lambda choice: "-".join(map(str, choice.values())))
def test_the_page_computes_what_python_computes(page, choice):
    from enhsim_tf.scoring.metrics import threshold

    training = javascript(page, f"trainingWindows({argument(choice)})")
    names = "{limit, alarms, recall, faulty}"
    found = page.evaluate(f"(({names}) => ({names}))(judge({argument(choice)}))")
    subspace = choice["noise"] if choice.get("noisy") else choice["signal"]
    learnt, nominal = scores_of(training, ARRAYS["judged"], subspace)
    _, faulty = scores_of(training, faulty_windows(choice["fault"], 0.4), subspace)
    limit = threshold(learnt, 0.05)
    np.testing.assert_allclose(found["faulty"], faulty, rtol=TOLERANCE)
    np.testing.assert_allclose(found["limit"], limit, rtol=TOLERANCE)
    assert found["alarms"] == pytest.approx(np.mean(nominal > limit), abs=TOLERANCE)
    assert found["recall"] == pytest.approx(np.mean(faulty > limit), abs=TOLERANCE)


@needs_chromium
@pytest.mark.slow
@pytest.mark.parametrize("mode", ["drift", "gain_loss", "stuck", "period_change"])
@pytest.mark.parametrize("severity", [0, 0.35, 1])
def test_faults_are_those_of_the_package(page, mode, severity):
    found = javascript(page, f"faulty('{mode}', {severity})")
    np.testing.assert_allclose(found, faulty_windows(mode, severity), atol=TOLERANCE)


@needs_chromium
@pytest.mark.slow
def test_the_generator_is_the_network_of_keras(page):
    latent = np.random.default_rng(0).standard_normal((5, VALUES["latent"])).astype(np.float32)
    found = javascript(page, f"{latent.tolist()}.map((each) => generate(each))")
    np.testing.assert_allclose(found, generator().predict(latent, verbose=0), atol=TOLERANCE)


@needs_chromium
@pytest.mark.slow
def test_noise_has_the_size_that_it_says(page):
    gaussian = javascript(page, "noiseWindows('gaussian')")
    # 150 windows of 500: the standard error of the deviation is 0.26 %, of the correlation 0.4 %
    assert gaussian.std() == pytest.approx(VALUES["noise_sd"], rel=0.015)
    assert abs(np.corrcoef(gaussian[:, 1:].ravel(), gaussian[:, :-1].ravel())[0, 1]) < 0.02
    residuals = javascript(page, "noiseWindows('residuals')")
    expected = np.roll(ARRAYS["real"] - ARRAYS["enhanced"], -1, axis=0)
    np.testing.assert_allclose(residuals, expected, atol=TOLERANCE)
    assert SIGNALS == ("coarse", "enhanced", "real")


@needs_chromium
@pytest.mark.slow
def test_chances_of_guessing_are_binomial(page):
    from scipy.stats import binom

    pairs = [(0, 0), (1, 1), (3, 4), (59, 100)]
    found = page.evaluate(f"{list(map(list, pairs))}.map((pair) => byGuessing(...pair))")
    np.testing.assert_allclose(found, [binom.sf(k - 1, n, 0.5) for k, n in pairs], rtol=1e-9)


@needs_chromium
@pytest.mark.slow
def test_keys_alone_change_the_result_and_vote(page):
    page.evaluate("element('controls').reset(); update(); document.activeElement.blur()")
    page.evaluate("scrollTo(0, 0)")
    visited = []
    for _ in range(12):
        page.press("Tab")
        focused = page.evaluate("document.activeElement.id || document.activeElement.value")
        visited.append(focused)
        if focused == "severity":
            before = page.evaluate("element('recall').textContent + judge(choice()).faulty[0]")
            page.press("ArrowRight")
            assert page.evaluate("choice().severity") == pytest.approx(0.55)
            after = page.evaluate("element('recall').textContent + judge(choice()).faulty[0]")
            assert before != after
        if focused == "say-generated":
            page.press(" ")
            break
    controls = ["enhanced", "none", "scale", "noisy", "fault", "severity", "rate", "shown"]
    assert visited[1:] == [*controls, "say-real", "say-generated"]  # a link comes first
    assert page.evaluate("votes.number") == 1


@needs_chromium
@pytest.mark.slow
@pytest.mark.parametrize("width", [380, 1200])
def test_nothing_is_wider_than_the_page(page, width):
    page.resize(width, 800)
    assert page.evaluate("document.documentElement.scrollWidth") <= width


@needs_chromium
@pytest.mark.slow
def test_no_request_leaves_the_page_and_nothing_fails(page):
    page.open((PLAYGROUND / "index.html").as_uri())
    page.evaluate("update()")
    for _ in range(3):
        page.evaluate("element('say-real').click()")
    asked = [
        event["params"]["request"]["url"]
        for event in page.events
        if event["method"] == "Network.requestWillBeSent"
    ]
    assert sorted(asked) == sorted((PLAYGROUND / name).as_uri() for name in [*CODE, "data.js"])
    assert not [
        event
        for event in page.events
        if event["method"] in ("Runtime.exceptionThrown", "Log.entryAdded")
    ]
