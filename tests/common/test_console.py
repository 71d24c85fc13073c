"""Lines of the commands: printed at once, in characters that the terminal can encode; progress only
where it was asked for.
"""

import os
import signal

import numpy as np
import pytest

from enhsim_tf.common.console import SILENT, Progress, run_command
from enhsim_tf.fitting.fit import fit
from enhsim_tf.fitting.options import FitOptions
from tests.clone import python
from tests.fitted_simulators import recorded


@pytest.mark.parametrize(
    ("encoding", "printed"),
    [("ascii", "Gr??e ?\n"), ("latin-1", "Größe ?\n"), ("utf-8", "Größe 漢\n")],
)
def test_a_line_is_printed_at_once_in_the_characters_of_the_encoding(encoding, printed):
    # os._exit discards unwritten output
    script = "import os\nfrom enhsim_tf.common.console import tell\ntell('Größe 漢')\nos._exit(0)"
    ended = python(script, env=os.environ | {"PYTHONIOENCODING": encoding}, encoding=encoding)
    assert (ended.stdout, ended.stderr) == (printed, "")


def test_a_loop_tells_how_far_it_is_at_most_every_fifteen_seconds():
    now, told = [1_000.0], []
    progress = Progress(told.append, "second ", clock=lambda: now[0])
    # the interval spans the loops
    for unit, total, steps, seconds in (
        ("epoch", 2, [1, 1.5], 8),
        ("iteration", 10, range(1, 11), 2),
    ):
        loop = progress.loop(unit, total)
        for done in steps:
            now[0] += seconds
            loop(done)
    assert told == [
        "second epoch 2 of 2, 75 %, about 5 s left",
        "second iteration 8 of 10, 80 %, about 4 s left",
    ]


def test_a_fit_names_its_steps_where_it_is_asked_to(capsys):
    rng, told = np.random.default_rng(0), []
    values = np.sin(np.arange(1_500) / 5) + 0.1 * rng.standard_normal(1_500)
    telemetry = recorded(values)
    options = FitOptions(window=60, num_windows=60, enhancer="ridge", noise="residual windows")
    for progress in (SILENT, Progress(told.append, "volts: ")):
        fit(telemetry, options=options, progress=progress)
        assert capsys.readouterr() == ("", ""), "its lines go where they were asked for"
    assert told == [
        f"volts: {step} ..." for step in ("enhancer coarse", "enhancer ridge", "noise", "report")
    ]


@pytest.mark.parametrize("sent", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_to_end_is_an_interrupt(sent, capsys):
    before = signal.getsignal(signal.SIGTERM)
    try:
        code = run_command(lambda: os.kill(os.getpid(), sent) or 0, "ended")
    finally:
        signal.signal(signal.SIGTERM, before)
    assert code == 130 and capsys.readouterr().err == "ended\n"
