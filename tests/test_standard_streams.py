"""Standard streams that are full, closed or broken: one sentence, no traceback, and the right exit status."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from studies.output import console

ROOT = Path(__file__).parent.parent
CODE = "import sys; from studies.cli import main; sys.exit(main(sys.argv[1:]))"
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}


def shell(redirection, *tokens, **more):
    """Run a command line with a shell's redirection."""
    command = ["sh", "-c", f'exec "$@" {redirection}', "sh", sys.executable, "-c", CODE, *tokens]
    return subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, check=False, **more)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
@pytest.mark.parametrize("option", [(), ("--json",)])
def test_a_full_standard_output_is_named_and_no_folder_blamed(option):
    run = shell(">/dev/full", "design", "paper", *option)
    assert (run.returncode, run.stderr) == (
        2,
        "magtip: cannot write to standard output (No space left on device): redirect it elsewhere\n",
    )


def test_a_closed_standard_output_leads_nowhere(tmp_path):
    run = shell(">&-", "design", "paper")
    assert (run.returncode, run.stderr) == (0, "")
    # nothing that is printed may end in a file that gets the number of the closed stream
    run = shell(">&-", "table", "paper", "--step", "1", "--plane", "--out", "t.npy", cwd=tmp_path)
    assert (run.returncode, (tmp_path / "t.npy").read_bytes()[:6]) == (0, b"\x93NUMPY")


@pytest.mark.parametrize("redirection", ["2>&-", "2>/dev/full"])
def test_what_cannot_be_said_does_not_change_the_status(redirection):
    if "full" in redirection and not os.path.exists("/dev/full"):
        pytest.skip("needs /dev/full")
    run = shell(redirection, "design", "papre")
    assert (run.returncode, run.stdout, run.stderr) == (2, "", "")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_a_full_standard_error_is_dropped_so_that_the_exit_flushes_it_without_an_error(monkeypatch):
    with open("/dev/full", "w") as full:
        monkeypatch.setattr(sys, "stderr", full)
        console.say("lost")
        full.write("also lost")
        full.flush()
