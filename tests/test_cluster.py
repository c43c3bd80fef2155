"""Tasks on a Dask cluster: a real scheduler and real workers, on loopback."""

import contextlib
import json
import math
import os
import re
import socket
import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import pytest
import worker_tasks
from worker_tasks import gone, until

from fem.physics_version import PHYSICS
from geometry.design import BadInput
from studies.mechanics import cluster, tasks
from studies.mechanics.executor import SchedulerLost
from studies.mechanics.tasks import finished
from studies.output.provenance import installed

# not imported: this takes each process that collects the tests a second
pytestmark = pytest.mark.skipif(find_spec("distributed") is None, reason="the extra cluster is not installed")

TESTS = Path(__file__).parent


class Cluster(NamedTuple):
    address: str
    scheduler: subprocess.Popen
    workers: list[subprocess.Popen]


@contextlib.contextmanager
def started(folder, count):
    """Start a scheduler and workers without nannies, so that a killed worker stays away."""
    file = folder / "scheduler.json"
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(TESTS), str(TESTS.parent)])}
    common = ["--scheduler-file", str(file), "--host", "127.0.0.1", "--no-dashboard"]
    own = ["--no-nanny", "--nthreads", "1", "--memory-limit", "0", "--local-directory", str(folder)]
    commands = [["dask_scheduler", "--port", "0", *common], *[["dask_worker", *own, *common]] * count]
    with contextlib.ExitStack() as stack, (folder / "log").open("w") as log:
        processes = []
        for name, *options in commands:
            command = [sys.executable, "-m", f"distributed.cli.{name}", *options]
            process = stack.enter_context(subprocess.Popen(command, env=env, cwd=folder, stdout=log, stderr=log))
            stack.callback(process.kill)
            processes.append(process)
        address = None
        while address is None:
            assert all(process.poll() is None for process in processes), (folder / "log").read_text()
            time.sleep(0.05)
            with contextlib.suppress(FileNotFoundError, json.JSONDecodeError):
                address = json.loads(file.read_text())["address"]
        yield Cluster(address, processes[0], processes[1:])


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    """A cluster whose two workers live until the last test, which kills a worker and the scheduler."""
    with started(tmp_path_factory.mktemp("cluster"), 2) as both:
        yield both


@pytest.fixture(scope="module")
def address(shared):
    """The scheduler of the shared cluster."""
    return shared.address


def test_an_exception_in_a_task_ends_the_run_with_the_traceback_of_the_worker(address):
    with pytest.raises(ValueError, match="a bug") as caught:
        list(finished(["bug"], worker_tasks.raises, workers=0, scheduler=address))
    assert "worker_tasks.py" in "".join(caught.value.__notes__)


def test_a_task_that_kills_its_worker_costs_no_other_task_a_try(address, tmp_path):
    tasks = [(str(tmp_path / str(k)), "kill" if k in (2, 5) else "ok") for k in range(10)]
    results = {each.task: each for each in finished(tasks, worker_tasks.counted, workers=0, scheduler=address)}
    tries = [(tmp_path / str(k)).read_text() for k in range(10)]
    assert tries == ["x", "x", "xx", "x", "x", "xx", "x", "x", "x", "x"]
    assert [results[task].answer for task in tasks] == [None if kind == "kill" else "ok" for _, kind in tasks]
    assert results[tasks[2]].reason == "its worker process ended with signal 9 twice (out of memory?)"


def test_closing_the_generator_ends_the_tasks_on_the_cluster(address, tmp_path):
    results = finished(["", *[str(tmp_path)] * 8], worker_tasks.with_child, workers=0, scheduler=address)
    assert next(results).task == ""
    assert until(lambda: len(list(tmp_path.iterdir())) == 1)
    results.close()
    assert until(lambda: all(gone(path.name) for path in tmp_path.iterdir()), 2)
    time.sleep(0.2)
    assert len(list(tmp_path.iterdir())) == 1, "no other task is started"


@pytest.fixture
def other_version(monkeypatch):
    """This process has another version of magtip than the workers."""
    monkeypatch.setattr(cluster.provenance, "installed", lambda name: "0.0.1")
    cluster.installed_models.cache_clear()
    yield
    cluster.installed_models.cache_clear()


@pytest.mark.usefixtures("other_version")
def test_workers_with_another_version_are_refused(address):
    with pytest.raises(BadInput, match=r"the worker at tcp://.* has magtip .*, not 0\.0\.1: install the version of"):
        next(finished([4.0], math.sqrt, workers=0, scheduler=address))


@pytest.mark.usefixtures("other_version")
def test_a_worker_with_another_version_that_joins_later_is_refused(address, monkeypatch):
    monkeypatch.setattr(cluster, "_check_workers", lambda client, address: None)
    with pytest.raises(BadInput, match="a worker of the cluster has magtip"):
        list(finished([4.0], math.sqrt, workers=0, scheduler=address))


def test_workers_with_other_physics_are_refused(address, monkeypatch):
    monkeypatch.setattr(cluster, "installed_models", lambda: (installed("magtip"), PHYSICS | {"half": 99}))
    with pytest.raises(BadInput, match=r"magtip .* with other versions of physics or estimates"):
        next(finished([4.0], math.sqrt, workers=0, scheduler=address))


def test_a_scheduler_that_does_not_answer_is_bad_input(monkeypatch):
    monkeypatch.setattr(cluster, "CONNECT", 1.0)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        port = silent.getsockname()[1]
        for address in (f"tcp://127.0.0.1:{port}", "foo://bar", ""):
            with pytest.raises(BadInput, match=r"no Dask scheduler answers at '.*': check the address"):
                next(finished([4.0], math.sqrt, workers=0, scheduler=address))


def test_a_cluster_without_workers_is_refused_or_ends_the_run(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "ABSENCE", 0.5)
    monkeypatch.setattr(tasks, "PATIENCE", 0.1)
    with started(tmp_path, 1) as own:
        results = finished([0.1] * 10, time.sleep, workers=0, scheduler=own.address)
        next(results)
        own.workers[0].kill()
        with pytest.raises(SchedulerLost, match=r"has had no worker for 0\.5 s: \d tasks are unfinished"):
            list(results)
        monkeypatch.setattr(cluster, "CONNECT", 1.0)
        with pytest.raises(BadInput, match="has no workers: start some with `dask worker"):
            next(finished([4.0], math.sqrt, workers=0, scheduler=own.address))


def test_a_sweep_outlives_a_worker_and_ends_in_a_sentence_with_its_scheduler(shared, run, tmp_path):
    """The last test: it leaves the shared cluster without its scheduler."""
    axes = ["--axis", "L=lin:10:16:14", "--depth", "0.4", "--magnet", "ignored", "--accuracy", "quick"]
    sweep = ["sweep", *axes, "--store", str(tmp_path / "store.sqlite"), "--json"]
    env = {**os.environ, "PYTHONPATH": str(TESTS.parent)}
    command = [sys.executable, "-m", "studies.cli", *sweep, "--scheduler", shared.address]
    with subprocess.Popen(command, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as far:
        rows = [far.stdout.readline()]
        shared.workers[0].kill()
        rows += [far.stdout.readline() for _ in range(3)]
        shared.scheduler.kill()
        # communicate() would leave out the rows that readline() has read in advance
        rows += far.stdout.readlines()
        errors = far.stderr.read()
        far.wait(timeout=60)
    sentence = (
        rf"magtip: the scheduler at {shared.address} is gone: \d+ tasks are unfinished; the same command continues\n"
    )
    assert far.returncode == 3, errors
    assert re.fullmatch(sentence, errors)
    status, whole, _ = run(*sweep, "--workers", "0")
    assert status == 0
    assert whole.splitlines(keepends=True)[: len(rows)] == rows, "times too, because they are read from the store"
    assert len(whole.splitlines()) == 14
