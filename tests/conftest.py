"""Fixtures that several test files share: running a command line, reading the JSON that it prints, a browser."""

import collections
import contextlib
import functools
import gc
import importlib
import io
import itertools
import json
import math
import os
import signal
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from browser import executable, launched

from fem.accuracy import QUICK
from geometry.design import BadInput, paper
from studies.cli import entry_point
from studies.mechanics import executor, tasks
from studies.output import figures
from studies.simulation import mechanics_sources

# a shell starts programs in the background with Ctrl-C ignored, and these hand that on to the commands that tests
# interrupt; a handler of their own is not handed on
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# tests make many objects and few cycles: looking for these a hundred times less often takes a twelfth less time
gc.set_threshold(50_000, 20, 20)

ROUGH = replace(
    QUICK, name="rough", section_size=0.25, section_patch=0.03, solid_size=0.5, solid_patch=0.1, harmonics=1
)
"""Meshes for what holds on any mesh."""
BY_PLAIN = "make plain runs it"
"""Why a test is skipped that `make test` runs in an environment of its own."""
NO_BROWSER = "no Chromium is installed (Debian: apt-get install chromium)"
"""Why a test of a page is skipped, or fails where a browser is needed."""


def pytest_collection(session):
    """Let the second of two processes import the test files backwards, before both collect all of them in order.

    Python's files with rewritten assertions, which a clean clone does not have yet, are then written once, half of
    them by each process.
    """
    whole = session.config.args == session.config.getini("testpaths")
    if whole and os.environ.get("PYTEST_XDIST_WORKER") == "gw1" and not sys.dont_write_bytecode:
        for path in sorted(Path(__file__).parent.glob("test_*.py"), reverse=True):
            # what fails here fails again, and is said, when the file is collected
            with contextlib.suppress(Exception):
                importlib.import_module(path.stem)


def pytest_terminal_summary(terminalreporter):
    """Say which checks did not run, and why, but for the run without extras, a part of `make test`."""
    if not os.environ.get("MAGTIP_PLAIN"):
        for line in left_out(terminalreporter.stats.get("skipped", [])):
            terminalreporter.write_line(line, red=True, bold=True)


def left_out(skipped):
    """Return a line for each reason for which tests were skipped, but for those that `make plain` runs."""
    reasons = collections.Counter(report.longrepr[2].removeprefix("Skipped: ") for report in skipped)
    return [
        f"left out: {count} test{'s' if count > 1 else ''}, {reason}"
        for reason, count in reasons.items()
        if reason != BY_PLAIN
    ]


def pytest_collection_finish():
    """Exempt what the collection leaves, millions of objects, from each later collection of garbage."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory):
    """The user's solved states are neither read nor filled by tests; children inherit this.

    The processes of one run share a cache.
    """
    base = tmp_path_factory.getbasetemp()
    run = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MAGTIP_STORE", str(run / "solved.sqlite"))
        yield


def take_surrogate(patch):
    """Let benches have the mechanics of the surrogate, where a test is not about them: 40 states take ten seconds."""
    of_surrogate = mechanics_sources.of_surrogate
    patch.setattr(mechanics_sources, "of_finite_elements", lambda design, solves: of_surrogate(design))


@pytest.fixture(scope="session", autouse=True)
def blank_pictures():
    """Figures are compiled for their pictures, but not drawn; `drawn_pictures` draws them, with few pixels.

    Drawing takes half a second, and fails in no way in which compiling does not.
    """
    import vl_convert
    from PIL import Image

    blank, draw = io.BytesIO(), vl_convert.vegalite_to_png
    Image.effect_noise((256, 256), 64).save(blank, "PNG")

    def compiled(spec, scale):
        assert vl_convert.vegalite_to_vega(spec)
        return blank.getvalue()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures, "SCALE", 0.75)
        patch.setattr(vl_convert, "vegalite_to_png", compiled)
        yield draw


@pytest.fixture
def drawn_pictures(blank_pictures, monkeypatch):
    """Pictures of figures are drawn."""
    import vl_convert

    monkeypatch.setattr(vl_convert, "vegalite_to_png", blank_pictures)


@pytest.fixture(scope="session", autouse=True)
def made_once():
    """Equal sections are meshed once for all tests, and the scripts of report pages are bundled once."""
    import vl_convert

    from fem.model import symmetry_models

    with pytest.MonkeyPatch.context() as patch:
        mesh = symmetry_models._section_mesh.__wrapped__
        patch.setattr(symmetry_models, "_section_mesh", functools.lru_cache(maxsize=400)(mesh))
        patch.setattr(vl_convert, "javascript_bundle", functools.cache(vl_convert.javascript_bundle))
        yield


@pytest.fixture(scope="session", autouse=True)
def few_processes():
    """Many states are no reason to start processes of their own, which import all again: tests run side by side."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (executor, tasks):
            patch.setattr(module, "INLINE", math.inf)
        yield


@pytest.fixture
def fast_cad(monkeypatch):
    """`magtip cad` draws no picture of the assembly and does not check the mould, as `test_mold` does."""
    make_fast(monkeypatch)


def make_fast(patch):
    """Leave pictures and checks out of `magtip cad`."""
    from geometry.fabrication import mold_solids
    from studies.fabrication import assembly_picture

    patch.setattr(mold_solids, "checks", lambda *_: [])
    patch.setattr(assembly_picture, "painter", lambda: contextlib.nullcontext(None))


@pytest.fixture(scope="session")
def store_folders(tmp_path_factory):
    """Numbered paths in one folder; `mktemp` for each test would list the folders of all tests before."""
    root = tmp_path_factory.mktemp("stores")
    return (root / str(k) for k in itertools.count())


@pytest.fixture(autouse=True)
def own_store(request, store_folders, monkeypatch):
    """Each test has a store of solved states of its own, empty at first, but for those of `calibrates`.

    These share the mechanics of their designs, some 40 states each.
    """
    if not request.node.get_closest_marker("calibrates"):
        monkeypatch.setenv("MAGTIP_STORE", str(next(store_folders) / "solved.sqlite"))


@pytest.fixture(scope="module")
def chromium():
    """A headless Chromium; without one, tests are skipped, or fail where the environment says that one is needed."""
    if executable() is None:
        if os.environ.get("MAGTIP_NEEDS_BROWSER"):
            pytest.fail(NO_BROWSER)
        pytest.skip(NO_BROWSER)
    with launched() as browser:
        yield browser


@pytest.fixture(scope="session")
def pressed():
    """A press in the axisymmetric model."""
    return state_of(depth=1.0)


@pytest.fixture(scope="session")
def gripped():
    """A shear under a grip, in the harmonic model, at an angle to the axes."""
    return state_of(grip=2.0, shear_x=1.2, shear_y=1.6)


def state_of(**load):
    """The state of the paper's beam without magnet under a load."""
    from fem.equilibrium import trace
    from geometry.loads import Load

    return trace(paper(), [Load(**load)], QUICK, magnet="ignored", estimate=False)[0]


@pytest.fixture
def traced(monkeypatch):
    """The scene of each solve of a path."""
    from fem import equilibrium

    scenes = []
    real = equilibrium.walk

    def noted(scene, **options):
        scenes.append(scene)
        return real(scene, **options)

    monkeypatch.setattr(equilibrium, "walk", noted)
    return scenes


@pytest.fixture
def kept(tmp_path):
    """An open store of solved states."""
    from studies.mechanics import store

    with store.opened(tmp_path / "store" / "solved.sqlite") as states:
        yield states


@pytest.fixture
def run(capsys, tmp_path, monkeypatch):
    """Run a command line in an empty folder; returns its exit status, standard output and standard error."""
    monkeypatch.chdir(tmp_path)

    def command(*tokens):
        status = entry_point.main([str(token) for token in tokens])
        return (status, *capsys.readouterr())

    return command


@pytest.fixture
def refusal(run):
    """Run a command line that must be refused: exit status 2, nothing printed, one sentence, which it returns."""

    def command(*tokens):
        status, out, err = run(*tokens)
        assert (status, out, err.count("\n")) == (2, "", 1)
        assert err.startswith("magtip: ")
        return err

    return command


@pytest.fixture
def strict():
    """Read JSON objects, one per line, without NaN or Infinity."""

    def refuse(constant):
        raise AssertionError(f"{constant} is not JSON")

    return lambda text: [json.loads(line, parse_constant=refuse) for line in text.splitlines()]


@pytest.fixture
def toml(tmp_path):
    """Write a TOML file; returns its path."""

    def write(text, name="sensor.toml"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return str(path)

    return write


@pytest.fixture
def refused():
    """Expect a BadInput of one line that holds all parts."""

    def expect(*parts):
        pattern = "".join(f"(?=.*{part})" for part in parts)
        return pytest.raises(BadInput, match=rf"(?s)^{pattern}[^\n]*$")

    return expect
