"""The walls of the house: floors, quiet imports, documented rooms, owned draws."""

import ast
import contextlib
import importlib
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "enhsim_tf"
TREES = {
    path.relative_to(PACKAGE).with_suffix("").as_posix().replace("/", "."): ast.parse(path.read_text()) for path in PACKAGE.rglob("*.py")
}

FLOORS = {
    "reproduce": 3,
    "__main__": 3,
    "robustness": 2,
    "fleet": 2,
    "fleet_command": 2,
    "fleet_plan": 2,
    "shard_folder": 2,
    "shards": 2,
    "engines": 1,
    "local_engine": 1,
    "ray_engine": 1,
    "scenario_file": 2,
    "checked_yaml": 0,
    "channels": 2,
    "channel_figure": 2,
    "channel_report": 2,
    "channel_verdict": 0,
    "fit_options": 0,
    "fitting": 2,
    "scoring": 2,
    "training_sets": 2,
    "enhanced_simulator": 2,
    "saved_simulator": 1,
    "pairs": 1,
    "sheet": 0,
    "enhancer": 1,
    "noise_gan": 1,
    "convolution_maximum": 1,
    "convolutional_noise": 1,
    "latent": 1,
    "fused_adam": 1,
    "blockwise_training": 1,
    "noise": 1,
    "detectors": 1,
    "autoencoders": 1,
    "injections": 1,
    "out_of_range": 1,
    "trusted_range": 2,
    "simulator": 1,
    "periodicity": 1,
    "store": 1,
    "sources": 1,
    "tables": 1,
    "labelled": 0,
    "cleaning": 0,
    "characteristics": 0,
    "rows": 0,
    "sampling": 0,
    "stamps": 0,
    "parsing": 0,
    "repairs": 0,
    "influx_store": 1,
    "influx_server": 0,
    "telemetry": 0,
    "signals": 0,
    "noise_processes": 0,
    "fidelity": 0,
    "detection": 0,
    "inference": 0,
    "two_sample": 0,
    "realism": 0,
    "files": 0,
    "declared_sizes": 0,
    "saved_network": 0,
    "errors": 0,
    "terminal": 0,
    "backend": 1,
    "tensorflow_settings": 0,
    "commands": 0,
    "__init__": 4,  # the door: it may name every room
}
WITHOUT_TENSORFLOW = [
    "",
    "errors",
    "files",
    "telemetry",
    "signals",
    "noise_processes",
    "fidelity",
    "two_sample",
    "realism",
    "store",
    "cleaning",
    "sources",
    "labelled",
    "influx_store",
    "influx_server",
    "periodicity",
    "simulator",
    "noise",
    "detectors",
    "autoencoders",
    "injections",
    "detection",
    "inference",
    "out_of_range",
    "trusted_range",
    "pairs",
    "channels",
    "channel_report",
    "channel_verdict",
    "scoring",
    "training_sets",
    "terminal",
    "tensorflow_settings",
    "commands",
    "fit_options",
    "__main__",
    "fleet",
    "fleet_command",
    "engines",
    "declared_sizes",
    "saved_network",
    "local_engine",
    "ray_engine",
]


def room_of(module):
    return module.split(".")[0]


def rooms_imported_by(module, tree):
    """Rooms of the package that a module imports anywhere, its functions included."""
    package = ["enhsim_tf", *module.split(".")[:-1]]
    names = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            names += [".".join([*base, *([node.module] if node.module else []), alias.name]) for alias in node.names]
    parts = [name.split(".") for name in names]
    return {part[1] if len(part) > 1 and part[1] in FLOORS else "__init__" for part in parts if part[0] == "enhsim_tf"}


def test_every_room_has_its_floor():
    assert {room_of(module) for module in TREES} <= set(FLOORS)
    assert len(TREES) >= 15


@contextlib.contextmanager
def noted(found, where):
    """The block's failed assertion is noted under its place, so that one test tells of every place at once."""
    try:
        yield
    except AssertionError as error:
        found.append(f"{where}: {error}")


def test_a_failed_assertion_is_noted_with_its_place():
    found = []
    for number in range(4):
        with noted(found, f"number {number}"):
            assert number % 2 == 0, "odd"
    assert [line.splitlines()[0] for line in found] == ["number 1: odd", "number 3: odd"]


def test_imports_go_down_the_floors():
    found = []
    for module, tree in TREES.items():
        rooms = rooms_imported_by(module, tree) - {room_of(module)}
        upwards = {room for room in rooms if FLOORS[room] > FLOORS[room_of(module)]}
        if room_of(module) in ("reproduce", "__main__"):
            upwards.discard("__init__")  # for its version
        with noted(found, module):
            assert not upwards
        if room_of(module) != "reproduce":
            with noted(found, module):
                assert "reproduce" not in rooms  # only the wing knows the paper's numbers, and nobody asks the wing
    assert not found, "\n".join(found)


def test_rooms_of_one_floor_do_not_import_in_a_circle():
    left = {module: {room for room in rooms_imported_by(module, tree) if room in TREES} for module, tree in TREES.items()}
    while left:
        free = [module for module, rooms in left.items() if not rooms & (set(left) - {module})]
        assert free, f"a circle among {sorted(left)}"
        for module in free:
            del left[module]


def test_the_reading_of_imports_sees_every_form():
    text = "import enhsim_tf.noise\nfrom enhsim_tf import store, __version__\ndef f():\n    from enhsim_tf.files import sha256\n    from . import noise_gan\n"
    assert rooms_imported_by("signals", ast.parse(text)) == {"noise", "store", "files", "noise_gan", "__init__"}
    assert rooms_imported_by("reproduce.figures", ast.parse("from .. import fidelity\nimport numpy")) == {"fidelity"}


def test_rooms_without_networks_import_no_tensorflow():
    modules = [f"enhsim_tf.{room}".rstrip(".") for room in WITHOUT_TENSORFLOW] + ["enhsim_tf.reproduce.settings"]
    script = f"import sys\nfor module in {modules}:\n    __import__(module)\nprint([name for name in ('tensorflow', 'keras') if name in sys.modules])"
    ended = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True)
    assert (ended.stdout.strip(), ended.returncode) == ("[]", 0), ended.stderr


def test_public_names_lead_where_they_say():
    import enhsim_tf

    assert {"EnhancedSimulator", "NoiseGAN", "build_enhancer", "InputError"} <= set(enhsim_tf.__all__)
    for name in enhsim_tf.__all__:
        value = getattr(enhsim_tf, name)
        assert value.__name__ == name and value is getattr(importlib.import_module(value.__module__), name)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = enhsim_tf.nothing


def public_definitions():
    """`(where, node, fields)` of every public class, function and method; the fields of a class are those of its `__init__`."""
    for module, tree in TREES.items():
        if any(part.startswith("_") and part != "__main__" for part in module.split(".")):
            continue
        for node in tree.body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
                yield f"{module}.{node.name}", node
                for inner in node.body if isinstance(node, ast.ClassDef) else ():
                    if isinstance(inner, ast.FunctionDef) and not inner.name.startswith("_"):
                        yield f"{module}.{node.name}.{inner.name}", inner


DEFINITIONS = dict(public_definitions())


def arguments_of(function):
    """The arguments that have a name for the caller: not `self`, `cls` or `**options`."""
    given = function.args
    arguments = [*given.posonlyargs, *given.args, *given.kwonlyargs]
    return [argument for argument in arguments if argument.arg not in ("self", "cls")]


def parameters_of(node):
    """Names of what a function or class takes: of its `__init__`, or the fields of a data class."""
    if isinstance(node, ast.FunctionDef):
        return [argument.arg for argument in arguments_of(node)]
    for inner in node.body:
        if isinstance(inner, ast.FunctionDef) and inner.name == "__init__":
            return parameters_of(inner)
    if any("dataclass" in ast.unparse(decorator) for decorator in node.decorator_list):
        return [inner.target.id for inner in node.body if isinstance(inner, ast.AnnAssign)]
    return []


def test_there_is_something_to_check():
    assert len(DEFINITIONS) > 60 and {"simulator.SquareWave", "noise_gan.NoiseGAN.fit", "fidelity.nrmse"} <= set(DEFINITIONS)
    assert parameters_of(DEFINITIONS["simulator.SquareWave"])[:2] == ["period_s", "phase"]


def check_documentation(node):
    text = ast.get_docstring(node)
    assert text, "no docstring"
    assert text.splitlines()[0].rstrip().endswith((".", ":")), "the summary is not a sentence on one line"
    parameters = parameters_of(node)
    if len(parameters) > 2 and not (isinstance(node, ast.ClassDef) and "Settings" in node.name):
        described = re.findall(r"^    ([\w, `]+): ", text.partition("Args:")[2], re.MULTILINE)
        described = {name.strip(" `") for names in described for name in names.split(",")}
        assert not [name for name in parameters if name not in described], "arguments without a description"


def test_public_names_are_documented():
    found = []
    for where, node in DEFINITIONS.items():
        with noted(found, where):
            check_documentation(node)
    assert not found, "\n".join(found)


def check_type_hints(node):
    functions = [node] if isinstance(node, ast.FunctionDef) else []
    if isinstance(node, ast.ClassDef):
        functions = [inner for inner in node.body if isinstance(inner, ast.FunctionDef) and inner.name in ("__init__", "__call__")]
    for function in functions:
        assert not [argument.arg for argument in arguments_of(function) if argument.annotation is None]
        assert function.returns is not None or function.name == "__init__"


def test_public_names_have_type_hints():
    found = []
    for where, node in DEFINITIONS.items():
        with noted(found, where):
            check_type_hints(node)
    assert not found, "\n".join(found)


def test_modules_say_what_they_own():
    assert [module for module, tree in TREES.items() if not ast.get_docstring(tree)] == []


OWNERS = {"default_rng", "Generator", "SeedSequence", "BitGenerator", "PCG64"}
SEEDED = {"HeUniform", "GlorotUniform", "RandomNormal", "RandomUniform", "Dropout", "GaussianNoise", "shuffle"}


def unowned_draws(tree):
    """Calls that draw from a global state, or build what draws without naming its seed."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else [alias.name for alias in node.names]
            found += [f"import {name}" for name in names if name == "random"]
        if not isinstance(node, ast.Call):
            continue
        name, seeded = ast.unparse(node.func), any(keyword.arg == "seed" for keyword in node.keywords)
        *path, last = name.split(".")
        if path[-2:] in (["np", "random"], ["numpy", "random"]) and (last not in OWNERS or (last == "default_rng" and not node.args)):
            found.append(name)
        stateless = seeded or last in ("split", "fold_in") or last.startswith("stateless_")  # the seed is an argument
        if (path[:2] == ["tf", "random"] and not stateless) or last in ("set_random_seed", "set_seed"):
            found.append(name)
        if path[-2:] == ["keras", "random"] and not (seeded or (last == "SeedGenerator" and node.args)):
            found.append(name)
        if path and last in SEEDED and path[0] in ("keras", "tf") and not seeded:
            found.append(name)
        if last in ("Dense", "Conv1D") and path[0] == "keras" and not any(keyword.arg == "kernel_initializer" for keyword in node.keywords):
            found.append(f"{name} without kernel_initializer")
    return found


def test_every_draw_has_an_owner():
    found = {module: unowned_draws(tree) for module, tree in TREES.items()}
    assert {module: draws for module, draws in found.items() if draws} == {}


@pytest.mark.parametrize(
    "text",
    [
        "np.random.normal(3)",
        "np.random.seed(0)",
        "np.random.default_rng()",
        "tf.random.normal((3,))",
        "tf.random.set_seed(0)",
        "keras.utils.set_random_seed(1)",
        "keras.random.normal((3,))",
        "keras.layers.Dropout(0.3)",
        "keras.layers.Dense(3)",
        "import random",
    ],
)
def test_draws_without_an_owner_would_be_seen(text):
    assert unowned_draws(ast.parse(text))


def test_no_exception_is_caught_blindly():
    found = []
    for module, tree in TREES.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ExceptHandler):
                with noted(found, f"{module}, line {node.lineno}"):
                    assert node.type is not None and ast.unparse(node.type) not in ("Exception", "BaseException")
    assert not found, "\n".join(found)


def test_every_room_has_its_tests():
    with_others = {
        "periodicity": "simulator",
        "terminal": "house",
        "tensorflow_settings": "backend",
        "fused_adam": "fast_paths",
        "autoencoders": "detectors",
        "tables": "sources",
        "influx_server": "influx_store",
        "saved_simulator": "enhanced_simulator",
        "saved_network": "hostile_models",
        "sheet": "figures",
        "fleet_command": "fleet",
        "local_engine": "engines",
        "ray_engine": "engines",
        "fleet_plan": "shards",
        "shard_folder": "fleet",
        "checked_yaml": "scenario_file",
        "fit_options": "fitting",
        "channel_report": "fitting",
        "channel_verdict": "fitting",
    }
    with_others |= dict.fromkeys(("characteristics", "rows", "sampling", "stamps", "parsing", "repairs"), "cleaning")
    rooms = {module for module in TREES if "." not in module} - {"__init__", "__main__", "errors"}
    assert {f"test_{with_others.get(room, room)}.py" for room in rooms} <= {path.name for path in (ROOT / "tests").iterdir()}


def test_a_line_is_told_at_once():
    script = "import os\nfrom enhsim_tf.terminal import tell\ntell('a line')\nos._exit(0)"  # which throws away what is not yet written
    ended = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True)
    assert ended.stdout == "a line\n"


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_a_narrow_terminal_shows_what_it_can(encoding):
    script = "from enhsim_tf.terminal import tell\ntell('Größe 漢')"
    ended = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, env=os.environ | {"PYTHONIOENCODING": encoding})
    assert (ended.stdout.decode(encoding), ended.stderr) == (
        {"ascii": "Gr??e ?\n", "latin-1": "Größe ?\n"}.get(encoding, "Größe 漢\n"),
        b"",
    )


def test_a_bar_of_a_process_that_is_ended_leaves_no_word_of_semaphores():
    script = "import os\nfrom enhsim_tf.terminal import progress\nfor _ in progress(range(3), disable=True): pass\nos._exit(0)"
    ended = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True)
    assert (ended.stdout, ended.stderr) == ("", "")
