"""Processes that call functions, one at a time, for a process that sends them jobs over a pipe.

A process is started by `COMMAND`, never forked: threads of MKL and numba do not survive a fork. It has a session of
its own, so that Ctrl-C reaches the sender alone. It ends at once, even during a job, when its standard input closes,
which happens however the sender ends. A job is a pickled pair of function and task; pickles pass only through the
pipes between a process and its sender.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Callable
from typing import IO, Any

from studies import deferred_modules
from studies.output.provenance import ROOT

COMMAND = (sys.executable, "-P", "-m", "studies.exploration.worker_process")
"""Command line of a worker process. -P keeps it from importing modules of the user's current folder."""
STARTS = 10
"""Attempts to start a process for one job if the system kills each while it loads."""
THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Environment variables with the number of threads of linear algebra and compiled loops."""

Answer = tuple[Any, BaseException | None, float]
"""What a function returned, or what it raised, and the time of the call, s."""


class WorkerDied(Exception):
    """The process that did a job ended at each attempt; `codes` are the exit codes, negative for signals."""

    def __init__(self, *codes: int) -> None:
        super().__init__(*codes)
        self.codes = codes

    def __str__(self) -> str:
        """Say how it ended.

        >>> str(WorkerDied(-9, -9)), str(WorkerDied(-11, 1)), str(WorkerDied(7))
        ('signal 9 twice', 'signal 11, then exit code 1', 'exit code 7')
        """
        texts = [f"signal {-code}" if code < 0 else f"exit code {code}" for code in self.codes]
        return f"{texts[0]} twice" if len(texts) == 2 and texts[0] == texts[1] else ", then ".join(texts)


class NotStarted(RuntimeError):
    """No process could be started, or jobs of this owner have been ended."""


def environment(threads: int) -> dict[str, str]:
    """Return the environment of a process that may use a number of threads, or fewer if the user has set so."""
    limits = {}
    for name in THREADS:
        user = os.environ.get(name, "")
        limits[name] = str(min(int(user), threads) if user.isdecimal() and int(user) > 0 else threads)
    paths = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))
    return {**os.environ, **limits, "PYTHONPATH": paths}


class WorkerProcesses:
    """Worker processes for jobs from several threads: a process for each job at a time, kept for the next one.

    Parameters
    ----------
    threads : number of threads of linear algebra in each process.
    """

    def __init__(self, threads: int) -> None:
        self._threads = threads
        self._lock = threading.Lock()
        self._idle: list[subprocess.Popen[bytes]] = []
        self._busy: dict[subprocess.Popen[bytes], str] = {}
        self._ended: set[str] = set()

    def call(self, job: bytes, owner: str = "", *, tries: int = 2) -> bytes:
        """Have a process do a job and return its pickled `Answer`.

        Parameters
        ----------
        job : pickled pair of function and task.
        owner : on whose behalf; `end` ends the jobs of one owner.
        tries : number of processes that may die of the job.

        Raises
        ------
        WorkerDied
            All of these processes died.
        NotStarted
            A process does not start, or the owner's jobs have been ended.
        """
        codes: list[int] = []
        while len(codes) < tries:
            process = self._take(owner)
            answer = _exchange(process, job)
            code = self._give_back(process, usable=answer is not None)
            if answer is not None:
                return answer
            codes.append(code)
        raise WorkerDied(*codes)

    def end(self, owner: str = "") -> None:
        """End the processes that are idle or do jobs of an owner, for whom no others are started."""
        with self._lock:
            self._ended.add(owner)
            idle, self._idle = self._idle, []
            for process, its_owner in self._busy.items():
                if its_owner == owner:
                    _kill(process)  # the thread that waits for its answer closes the pipes
        for process in idle:
            _finish(process)

    def _take(self, owner: str) -> subprocess.Popen[bytes]:
        """Return a process that is ready for a job: an idle one, or a new one."""
        for _ in range(STARTS):
            with self._lock:
                if owner in self._ended:
                    raise NotStarted("the jobs have been ended")
                while self._idle:
                    process = self._idle.pop()
                    if process.poll() is None:
                        self._busy[process] = owner
                        return process
                    _finish(process)
                process = _start(self._threads)
                self._busy[process] = owner
            # a new process sends an empty text when it has loaded: if it dies before, no job is the cause
            if _receive(process) is not None:
                return process
            code = self._give_back(process, usable=False)
            if code > 0:
                break  # an installation that does not work
        raise NotStarted(f"worker processes end with {WorkerDied(code)} before they do anything")

    def _give_back(self, process: subprocess.Popen[bytes], *, usable: bool) -> int:
        """Keep a process for later jobs, or end it and return its exit code."""
        with self._lock:
            owner = self._busy.pop(process)
            if usable and owner not in self._ended:
                self._idle.append(process)
                return 0
        return _finish(process)


def _start(threads: int) -> subprocess.Popen[bytes]:
    """Start a worker process in a session of its own."""
    pipe = subprocess.PIPE
    return subprocess.Popen(COMMAND, env=environment(threads), stdin=pipe, stdout=pipe, start_new_session=True)


def _exchange(process: subprocess.Popen[bytes], job: bytes) -> bytes | None:
    """Send a job and return the answer; None if the process dies."""
    assert process.stdin is not None
    try:
        pickle.dump(job, process.stdin)
        process.stdin.flush()
    except BrokenPipeError:
        return None
    return _receive(process)


def _receive(process: subprocess.Popen[bytes]) -> bytes | None:
    """Return what a process sends; None if it dies."""
    assert process.stdout is not None
    try:
        answer: bytes = pickle.load(process.stdout)
    except (EOFError, pickle.UnpicklingError):
        return None
    return answer


def _kill(process: subprocess.Popen[bytes]) -> None:
    """Kill a process and those that it has started."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)


def _finish(process: subprocess.Popen[bytes]) -> int:
    """Kill a process, close its pipes and return its exit code, which is its own one if it has ended before."""
    _kill(process)
    code = process.wait()
    for stream in (process.stdin, process.stdout):
        with contextlib.suppress(BrokenPipeError):
            if stream is not None:
                stream.close()
    return code


def answer(function: Callable[[Any], Any], task: Any) -> Answer:
    """Call a function and return its value, or the exception that it raised, and the time."""
    begin = time.perf_counter()
    try:
        return function(task), None, time.perf_counter() - begin
    except Exception as error:
        return None, error, time.perf_counter() - begin


def main() -> None:
    """Do the jobs that arrive on standard input, one after the other, until it closes."""
    deferred_modules.defer()
    # libraries and programs that a job starts get neither pipe: they read nothing, and print to standard error
    jobs, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.dup2(2, 1)
    waiting: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(jobs, waiting), daemon=True).start()
    _send(b"", answers)
    while True:
        _send(_do(waiting.get()), answers)


def _read(jobs: IO[bytes], waiting: queue.SimpleQueue[bytes]) -> None:
    """Queue the jobs that arrive; when no more can arrive, end this process and those that it has started."""
    try:
        while True:
            waiting.put(pickle.load(jobs))
    finally:
        if os.getpgrp() == os.getpid():
            os.killpg(0, signal.SIGKILL)
        os._exit(1)


def _do(job: bytes) -> bytes:
    """Do a job and return its pickled `Answer`."""
    try:
        function, task = pickle.loads(job)
        value, error, seconds = answer(function, task)
        if error is None:
            return pickle.dumps((value, None, seconds))
    except BaseException as other:
        # SystemExit and KeyboardInterrupt are raised where the job comes from
        error, seconds = other, 0.0
    # a pickle keeps the notes of an exception, but not its traceback
    error.add_note("in a worker process:\n" + "".join(traceback.format_exception(error)))
    return pickle.dumps((None, _portable(error), seconds))


def _portable(error: BaseException) -> BaseException:
    """Return an exception, or its text and notes in another one if it cannot be pickled."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        # pickle calls methods of the exception's own class, which may raise anything
        other = RuntimeError(f"{type(error).__name__}: {error}")
        other.__notes__ = error.__notes__
        return other
    return error


def _send(text: bytes, answers: IO[bytes]) -> None:
    """Send an answer."""
    pickle.dump(text, answers)
    answers.flush()


if __name__ == "__main__":
    # by its own name: what is pickled in the module __main__ of this process is not found in that of the sender
    from studies.exploration import worker_process

    worker_process.main()
