"""Tasks done by the workers of a Dask cluster, each of which hands them to worker processes of its own.

A thread of a Dask worker does a task in a separate process (`executor.Worker`), as a run on one machine does. If that
process dies, the Dask worker lives on, so it is known which task is the cause, and tasks in other threads or assigned
to the same Dask worker are not affected. Dask alone would suspect all of them. It also could not stop a task that
runs. If a Dask worker itself is lost, for which no task is to blame, the scheduler hands its tasks to others.

Everything passes as pickles between client, scheduler and workers: whoever reaches the scheduler can execute code on
all of them.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from typing import Any

from fem.physics_version import ESTIMATES, PHYSICS
from geometry.design import BadInput
from studies.mechanics.executor import TRIES, Answer, NotStarted, SchedulerLost, Worker, WorkersLost
from studies.output import provenance

CONNECT = 10.0
"""Time within which a scheduler answers and has a worker, s."""
REFRESH = 2.0
"""Time after which the number of workers is asked again, s."""
ABSENCE = 60.0
"""Time that a run waits for another Dask worker when none is left, s."""
ATTEMPTS = 2
"""Times that a task is handed to the scheduler, which gives it up when four Dask workers were lost (its default)."""
Models = tuple[str | None, dict[Any, int]]
"""Version of magtip, and those of the physics of each model and of the error estimates."""


_lock = threading.Lock()
_idle: list[Worker] = []
"""Worker processes of this Dask worker without a task, shared by all runs, so that an interrupted run leaves none."""
_busy: dict[Worker, str] = {}
"""Those with a task, with its run."""
_ended: set[str] = set()
"""Runs that have ended."""


@functools.cache
def installed_models() -> Models:
    """Return the version of magtip in this process and those of its models."""
    return provenance.installed(provenance.OWN), {**PHYSICS, "estimates": ESTIMATES}


def do_job(function: Callable[[Any], Any], task: Any, run: str, models: Models) -> Answer:
    """Do a task of a run in a process of this Dask worker."""
    if installed_models() != models:
        # workers that join later are not checked when the run begins
        raise BadInput(_mismatch("a worker of the cluster", installed_models(), models))
    with _lock:
        if run in _ended:
            raise NotStarted("the run has ended")
        worker = _idle.pop() if _idle else Worker()
        _busy[worker] = run
    try:
        return worker.call(function, task, TRIES)
    finally:
        with _lock:
            del _busy[worker]
            if run not in _ended:
                _idle.append(worker)


def end_run(run: str) -> None:
    """End the processes of a run, and the idle ones, on this Dask worker."""
    with _lock:
        _ended.add(run)
        ending = [*_idle, *(worker for worker, its_run in _busy.items() if its_run == run)]
        _idle.clear()
    for worker in ending:
        worker.end()


def connected(address: str) -> Cluster:
    """Return an executor whose workers are those of a cluster."""
    cluster = Cluster(_client(address), address)
    try:
        _check_workers(cluster.client, address)
    except BaseException:
        cluster.end()
        raise
    return cluster


def _client(address: str) -> Any:
    try:
        from distributed import Client
    except ImportError:
        raise BadInput("a Dask scheduler needs Dask: install it with `pip install 'magtip[cluster]'`") from None
    # the run itself says in a sentence what happens to the connection
    for name in ("client", "batched", "core", "comm"):
        logging.getLogger(f"distributed.{name}").setLevel(logging.CRITICAL)
    try:
        # a client would wait without limit for the first words of another server that is silent
        _greet(address)
        return Client(address, timeout=CONNECT, set_as_default=False, name="magtip")
    except (OSError, ValueError, TypeError) as error:
        message = (
            f"no Dask scheduler answers at {address!r}: "
            "check the address, which `dask scheduler` prints, such as tcp://127.0.0.1:8786"
        )
        raise BadInput(message) from error


def _greet(address: str) -> None:
    """Connect to a scheduler and hang up, in a thread of its own: this one may have an event loop."""
    from distributed.comm import connect
    from distributed.security import Security

    async def greet() -> None:
        security = Security().get_connection_args("client")
        comm = await asyncio.wait_for(connect(address, timeout=CONNECT, **security), CONNECT)
        comm.abort()

    def run() -> None:
        try:
            reply.set_result(asyncio.run(greet()))
        except BaseException as error:
            reply.set_exception(error)

    reply: Future[None] = Future()
    threading.Thread(target=run, daemon=True).start()  # Ctrl-C does not wait for a daemon
    reply.result()


def _check_workers(client: Any, address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=CONNECT)
    except TimeoutError:
        message = f"the scheduler at {address} has no workers: start some with `dask worker {address}`"
        raise BadInput(message) from None
    models = installed_models()
    for worker, theirs in client.run(installed_models, on_error="return").items():
        if isinstance(theirs, ImportError):
            raise BadInput(
                f"the worker at {worker} cannot import magtip ({theirs}): install magtip {models[0]} there"
            )
        if isinstance(theirs, Exception):
            raise BadInput(f"the worker at {worker} does not answer: {theirs}")
        if theirs != models:
            raise BadInput(_mismatch(f"the worker at {worker}", theirs, models))


def _mismatch(worker: str, theirs: Models, ours: Models) -> str:
    same = theirs[0] == ours[0]
    other = (
        f"magtip {theirs[0]} with other versions of physics or estimates"
        if same
        else f"magtip {theirs[0]}, not {ours[0]}"
    )
    return f"{worker} has {other}: install the version of this machine on all workers"


class Cluster:
    """What `executor.Workers` is on this machine: the workers of a cluster, for one run."""

    def __init__(self, client: Any, address: str) -> None:
        self.client, self.address = client, address
        self._dask = client.get_executor(pure=False)
        self._run, self._models = f"magtip-{client.id}", installed_models()
        self._threads, self._asked, self._present = 0, -REFRESH, time.monotonic()

    @property
    def size(self) -> int:
        """Number of threads of all workers, as of a moment ago."""
        now = time.monotonic()
        if now - self._asked > REFRESH and self.client.status == "running":
            self._asked = now
            with contextlib.suppress(OSError, TimeoutError):
                self._threads = sum(self.client.nthreads().values())
        if self._threads:
            self._present = time.monotonic()
        return self._threads

    def check(self) -> None:
        """Refuse to wait any longer for a first worker after the last one was lost."""
        if not self.size and time.monotonic() - self._present > ABSENCE:
            raise SchedulerLost(f"the scheduler at {self.address} has had no worker for {ABSENCE:g} s")

    def submit(self, function: Callable[[Any], Any], task: Any) -> Future[Answer]:
        """Hand over a task."""
        reply: Future[Answer] = Future()
        self._send((function, task, self._run, self._models), reply, 1)
        return reply

    def _send(self, job: tuple[Any, ...], reply: Future[Answer], attempt: int) -> None:
        """Hand over a job; its answer, or the reason why there is none, becomes that of the reply."""

        def receive(future: Future[Answer]) -> None:
            from distributed import KilledWorker

            try:
                reply.set_result(future.result())
            except CancelledError:
                # Dask cancels all futures when the connection breaks
                reply.set_exception(SchedulerLost(f"the scheduler at {self.address} is gone"))
            except KilledWorker as lost:
                if attempt < ATTEMPTS:
                    self._send(job, reply, attempt + 1)
                else:
                    count = ATTEMPTS * (lost.allowed_failures + 1)
                    said = f"the cluster lost {count} workers to which it was assigned"
                    reply.set_exception(WorkersLost(said))
            except BaseException as error:
                reply.set_exception(error)

        self._dask.submit(do_job, *job).add_done_callback(receive)

    def end(self) -> None:
        """End the tasks of this run on all workers, and the connection."""
        # what cannot be told to a scheduler that is gone needs no telling: Dask workers end with it
        with contextlib.suppress(OSError, TimeoutError):
            if self.client.status == "running":
                self._dask.shutdown(wait=False)
                self.client.run(end_run, self._run, on_error="ignore")
        with contextlib.suppress(OSError, TimeoutError):
            self.client.close(timeout=1)
