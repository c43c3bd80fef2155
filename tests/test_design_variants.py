"""A batch of `magtip cad`: interrupts, processes that die, and axes that change nothing."""

import dataclasses
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from geometry.design import BadInput, paper
from studies.fabrication import design_variants
from studies.fabrication.sensor_parts import fabricated
from studies.mechanics import worker_process


def test_sentences_of_a_batch_name_the_variants():
    rows = [fabricated("ok", "", Path("out", name)) | {"warnings": ["a small vent"]} for name in ("D7", "D8")]
    rows.append(fabricated("bad_input", "no wall", Path("out", "D3")))
    assert design_variants.sentences_of(rows) == [
        "warning: variant D7, D8: a small vent",
        "variant D3: no wall",
        "1 of 3 variants failed",
    ]


WRITES_AND_WAITS = """
import time
from studies.fabrication import design_variants as variants
from studies.mechanics import worker_process
from studies.output import atomic_files

def fabricate(job):
    with atomic_files.filled(job[2]) as folder, atomic_files.staged(folder) as stage:
        atomic_files.write_text(stage / "README.md", "recipe")
        time.sleep(0 if job[1]["L"] == 9 else 60)
    return variants.fabricated("ok", "", job[2])

variants.fabricate = fabricate
worker_process.main()
"""


def test_an_interrupted_batch_leaves_only_whole_folders(tmp_path):
    """Its processes, which here build no solids, have begun to write all variants but the first one."""
    code = "import sys; from studies.cli import main; from studies.mechanics import worker_process\n"
    code += (
        f"worker_process.COMMAND = (sys.executable, '-P', '-c', {WRITES_AND_WAITS!r}); sys.exit(main(sys.argv[1:]))"
    )
    tokens = ["cad", "paper", "--out", "parts", "--axis", "L=9,10,11"]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parent.parent)}
    options = {"cwd": tmp_path, "env": environment, "start_new_session": True, "stderr": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", code, *tokens], **options) as process:
        while process.poll() is None and len(list(tmp_path.rglob("README.md"))) < 2:
            time.sleep(0.05)
        os.killpg(process.pid, signal.SIGINT)
        said = process.stderr.read().decode()
        assert process.wait() == 130
    assert said.splitlines()[-1] == "magtip: interrupted; any complete files are kept"
    assert "Traceback" not in said
    assert [path.name for path in (tmp_path / "parts").glob("[!.]*")] == ["L9"]
    assert (tmp_path / "parts" / "L9" / "README.md").exists()
    assert not list(tmp_path.rglob(".writing-*"))


def cad_with_a_slow_kernel(tmp_path, code, *options):
    """The verb cad in a process of its own, in the folder "work", where the kernel is a module of such code."""
    slow, work = tmp_path / "slow", tmp_path / "work"
    slow.mkdir()
    work.mkdir()
    (slow / "build123d.py").write_text(code)
    paths = os.pathsep.join([str(slow), str(Path(__file__).parent.parent)])
    command = [sys.executable, "-m", "studies.cli", "cad", "paper", "--out", "parts", *options]
    settings = {"cwd": work, "env": {**os.environ, "PYTHONPATH": paths}, "start_new_session": True}
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True, **settings)


def test_an_interrupt_while_the_kernel_is_loaded_ends_at_once_and_leaves_nothing(tmp_path):
    """The kernel takes seconds to load; here something of its name takes a minute."""
    work = tmp_path / "work"
    with cad_with_a_slow_kernel(tmp_path, "import time\ntime.sleep(60)\n") as process:
        assert "solids and mould" in process.stderr.readline()
        time.sleep(0.3)
        begin = time.perf_counter()
        process.send_signal(signal.SIGINT)
        assert process.stderr.read() == "magtip: interrupted; any complete files are kept\n"
        assert process.wait() == 130
        assert time.perf_counter() - begin < 20
    assert list(work.iterdir()) == []
    with pytest.raises(ProcessLookupError):
        os.killpg(process.pid, 0)


def test_an_interrupt_while_the_processes_of_a_batch_load_the_kernel_ends_them_at_once(tmp_path):
    """Here something of the kernel's name takes a minute to load. Workers write to the same standard error."""
    work = tmp_path / "work"
    code = "import sys, time\nprint('loading', file=sys.stderr)\ntime.sleep(60)\n"
    with cad_with_a_slow_kernel(tmp_path, code, "--axis", "L=9,10,11") as process:
        assert process.stderr.readline() == "loading\n"
        begin = time.perf_counter()
        os.killpg(process.pid, signal.SIGINT)
        # the pipe ends when the last process that may write into it is gone
        said = [line for line in process.stderr.read().splitlines() if line != "loading"]
        assert time.perf_counter() - begin < 10
        assert said == ["magtip: interrupted; any complete files are kept"]
    assert list(work.iterdir()) == []


def test_a_process_of_a_batch_that_dies_fails_its_variant_only(tmp_path, monkeypatch):
    code = (
        "import os; from studies.mechanics import worker_process\n"
        "from studies.fabrication import design_variants as variants\n"
        "def fabricate(job):\n"
        "    if job[1]['L'] == 9: os._exit(7)\n"
        "    return variants.fabricated('ok', '', job[2])\n"
        "variants.fabricate = fabricate; worker_process.main()\n"
    )
    monkeypatch.setattr(worker_process, "COMMAND", (sys.executable, "-P", "-c", code))
    axes = {"L": [9.0, 10.0, 11.0, 12.0]}
    records = list(design_variants.batch(paper(), axes, tmp_path / "parts", design_variants.silent, workers=2))
    assert [row["status"] for row in records] == ["failed", "ok", "ok", "ok"]
    assert "exit code 7" in records[0]["message"]


def test_an_error_of_a_process_of_a_batch_is_raised(tmp_path, monkeypatch):
    code = (
        "from studies.mechanics import worker_process\n"
        "from studies.fabrication import design_variants as variants\n"
        "def fabricate(job): raise OSError(28, 'No space left on device', 'x.stl')\n"
        "variants.fabricate = fabricate; worker_process.main()\n"
    )
    monkeypatch.setattr(worker_process, "COMMAND", (sys.executable, "-P", "-c", code))
    with pytest.raises(OSError, match="No space left on device") as caught:
        list(
            design_variants.batch(paper(), {"L": [9.0, 10.0]}, tmp_path / "parts", design_variants.silent, workers=2)
        )
    assert caught.value.filename == "x.stl"


def test_axes_that_change_no_solid_are_named():
    axes = {"D": [8.0, 9.0], "E": [1.0, 2.0], "f": [5.0, 6.0]}
    assert [name for name, _ in design_variants.idle(paper(), axes)] == ["E"]
    chip = dataclasses.replace(paper(), hall_layout="tmag5273a1")
    assert design_variants.idle(chip, axes)[1] == ("f", "hall_layout is tmag5273a1")
    assert design_variants.idle(chip, {"E": [1.0]}) == []


def test_variants_that_would_share_a_folder_are_refused(tmp_path):
    with pytest.raises(BadInput, match=r"^two variants would have the folder 'D8': give values that differ in six"):
        next(design_variants.batch(paper(), {"D": [8.0, 8.0000001]}, tmp_path / "out", design_variants.silent))
    assert not list(tmp_path.iterdir())
