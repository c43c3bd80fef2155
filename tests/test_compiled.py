"""When functions run compiled by numba."""

import subprocess
import sys

import pytest

from geometry import compiled

pytest.importorskip("numba", reason="the rule needs the extra `fast`")


def in_new_process(code):
    code = f"import sys\nfrom geometry import compiled\n{code}"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()


def test_a_short_call_does_not_import_numba_and_many_do():
    code = (
        "calls = [compiled.worthwhile(0.1) for _ in range(6)]\n"
        "print(calls.index(True), *calls[calls.index(True):], 'numba' in sys.modules)"
    )
    first, *later, imported = in_new_process(code)
    # 0.1 s are saved 4 times before they are worth 0.4 s
    assert (int(first), set(later), imported) == (3, {"True"}, "False")


@pytest.mark.parametrize(("numba", "openmp", "count"), [("", "2", 2), ("3", "4", 3), ("16", "no", 8), ("0", "", 8)])
def test_threads_are_the_cores_or_fewer_if_the_environment_says_so(monkeypatch, numba, openmp, count):
    monkeypatch.setattr(compiled, "cores", lambda: 8)
    monkeypatch.setenv("NUMBA_NUM_THREADS", numba)
    monkeypatch.setenv("OMP_NUM_THREADS", openmp)
    assert compiled.threads() == count


def test_numba_that_is_imported_already_is_used():
    assert in_new_process("print(compiled.worthwhile(0), compiled.prepare(), compiled.worthwhile(0))") == [
        "False",
        "True",
        "True",
    ]


def test_without_numba_nothing_is_compiled():
    code = (
        "sys.modules['numba'] = None\ncompiled._installed = lambda: False\n"
        "print(compiled.available(), compiled.prepare(), compiled.worthwhile(10))"
    )
    assert in_new_process(code) == ["False"] * 3


def test_a_numba_that_cannot_be_imported_is_not_used():
    code = "sys.modules['numba'] = None\nprint(compiled.prepare(), compiled.load('analytic.field.cylinder_compiled'))"
    assert in_new_process(code) == ["False", "None"]


def test_uncompiled_switches_compiled_functions_off():
    compiled.prepare()
    with compiled.uncompiled():
        assert not compiled.worthwhile(10)
        assert not compiled.prepare()
    assert compiled.worthwhile(0)


def test_garbage_is_collected_again_after_compiling():
    code = (
        "import gc, numba\ncompiled._announce_compilation()\nduring = []\n"
        "from numba.core import event\n"
        "class Within(event.Listener):\n"
        "    def on_start(self, event):\n        during.append(gc.isenabled())\n"
        "    def on_end(self, event):\n        pass\n"
        "event.register('numba:compile', Within())\n"
        "inner = numba.njit(lambda x: x + 1)\n"
        "outer = numba.njit(lambda x: inner(x) + 1)\n"
        "print(outer(1), *during, gc.isenabled())"
    )
    assert in_new_process(code) == ["3", "False", "False", "True"]
