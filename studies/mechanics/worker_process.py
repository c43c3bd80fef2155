"""Processes that call functions, one at a time, for a process that sends them jobs over a pipe.

A process is started by `COMMAND`, never forked: threads of MKL and numba do not survive a fork. It has a session of
its own, so that Ctrl-C reaches the sender alone. It ends at once, even during a job, when its standard input closes,
which happens however the sender ends. A job is a pickled pair of function and task; pickles pass only through the
pipes between a process and its sender. While it runs, a job may say things to its sender, and may ask whether the
sender has given it up (`sender`). An `Executor` hands tasks to such processes; `cluster` has one of its own.
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
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import IO, Any

from geometry.compiled import cores
from studies import deferred_modules
from studies.output.provenance import ROOT

COMMAND = (sys.executable, "-P", "-m", "studies.mechanics.worker_process")
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

    `threads`: number of threads of linear algebra in each process.
    """

    def __init__(self, threads: int) -> None:
        self._threads = threads
        self._lock = threading.Lock()
        self._idle: list[subprocess.Popen[bytes]] = []
        self._busy: dict[subprocess.Popen[bytes], str] = {}
        self._ended: set[str] = set()

    def call(
        self, job: bytes, owner: str = "", *, tries: int = 2, hear: Callable[[Any], None] = lambda _: None
    ) -> bytes:
        """Have a process do a job and return its pickled `Answer`.

        Parameters
        ----------
        job : pickled pair of function and task.
        owner : on whose behalf; `end` ends the jobs of one owner.
        tries : number of processes that may die of the job.
        hear : takes what the job says before it returns; default: nothing does.

        `WorkerDied` says that all of these processes died, `NotStarted` that a process does not start, or that the
        owner's jobs have been ended.
        """
        codes: list[int] = []
        while len(codes) < tries:
            process = self._take(owner)
            answer = _exchange(process, job, hear)
            code = self._give_back(process, usable=answer is not None)
            if answer is not None:
                return answer
            codes.append(code)
        raise WorkerDied(*codes)

    def give_up(self, number: int) -> None:
        """Tell all processes that jobs with this number and lower ones are useless, see `Sender.has_given_up`."""
        with self._lock:
            for process in (*self._idle, *self._busy):
                with contextlib.suppress(OSError, ValueError):  # it has died
                    _write(process, number)

    @property
    def pids(self) -> list[int]:
        """Numbers of the processes."""
        with self._lock:
            return [process.pid for process in (*self._idle, *self._busy)]

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
        death = WorkerDied(code)
        raise NotStarted(f"worker processes end with {death} before they do anything") from death

    def _give_back(self, process: subprocess.Popen[bytes], *, usable: bool) -> int:
        """Keep a process for later jobs, or end it and return its exit code."""
        with self._lock:
            owner = self._busy.pop(process)
            if usable and owner not in self._ended:
                self._idle.append(process)
                return 0
        return _finish(process)


def _start(threads: int) -> subprocess.Popen[bytes]:
    pipe = subprocess.PIPE
    return subprocess.Popen(COMMAND, env=environment(threads), stdin=pipe, stdout=pipe, start_new_session=True)


def _exchange(process: subprocess.Popen[bytes], job: bytes, hear: Callable[[Any], None] | None) -> bytes | None:
    try:
        _write(process, job)
    except BrokenPipeError:
        return None
    while isinstance(message := _receive(process), tuple):
        if hear is not None:
            hear(*message)
    answer: bytes | None = message
    return answer


def _write(process: subprocess.Popen[bytes], message: bytes | int) -> None:
    """Send a job, or the number up to which jobs are given up, as one piece: two threads may write."""
    assert process.stdin is not None
    process.stdin.write(pickle.dumps(message))
    process.stdin.flush()


def _receive(process: subprocess.Popen[bytes]) -> Any:
    assert process.stdout is not None
    try:
        return pickle.load(process.stdout)
    except (EOFError, pickle.UnpicklingError):
        return None


def _kill(process: subprocess.Popen[bytes]) -> None:
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)


def _finish(process: subprocess.Popen[bytes]) -> int:
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


class Sender:
    """The process that sends the jobs, for a job that says what it has so far, or asks whether it still matters.

    `answers`: stream to it.
    """

    def __init__(self, answers: IO[bytes]) -> None:
        self._answers, self._given_up, self._heard = answers, -1, threading.Event()

    def say(self, content: Any) -> None:
        """Send what the job has so far."""
        _send((content,), self._answers)

    def has_given_up(self, number: int, patience: float = 0.0) -> bool:
        """Return whether it has given up the job with this number, or does so within `patience`, s."""
        end = time.monotonic() + patience
        while self._given_up < number and (left := end - time.monotonic()) > 0:
            self._heard.wait(left)
            self._heard.clear()
        return self._given_up >= number

    def give_up(self, number: int) -> None:
        """Note that jobs up to a number are given up."""
        self._given_up = number
        self._heard.set()


_senders: list[Sender] = []
"""The sender of this process, if it is a worker process."""


def sender() -> Sender:
    """Return the process that sends jobs to this one."""
    return _senders[-1]


class SchedulerLost(RuntimeError):
    """The scheduler of a cluster, or all of its workers, are gone. The text is one sentence."""


class WorkersLost(RuntimeError):
    """A task was handed to several workers of a cluster, which were all lost. The text is one sentence."""


@dataclass(frozen=True, slots=True)
class Executor:
    """How tasks are handed to workers.

    submit : hands over a function and a task, to be done in the order of the calls.
    size : returns the number of tasks that are done at the same time.
    check : raises `SchedulerLost` if no answer can come any more; processes of this machine are not lost unnoticed.
    """

    submit: Callable[[Callable[[Any], Any], Any], Future[Answer]]
    size: Callable[[], int]
    check: Callable[[], None] = lambda: None


def inline() -> Executor:
    """Return an executor that does each task in this process, when it is submitted."""

    def submit(function: Callable[[Any], Any], task: Any) -> Future[Answer]:
        future: Future[Answer] = Future()
        future.set_result(answer(function, task))
        return future

    return Executor(submit, lambda: 0)


@contextlib.contextmanager
def processes(count: int, tries: int = 2) -> Iterator[Executor]:
    """Yield an executor with worker processes on this machine, which are ended with the context, also during tasks.

    Parameters
    ----------
    count : number of processes; linear algebra in them shares the cores that this process may use.
    tries : number of processes that may die of a task, before its future raises `WorkerDied`.
    """
    threads = ThreadPoolExecutor(count)
    pool = WorkerProcesses(max(cores() // count, 1))

    def do(job: bytes) -> Answer:
        result: Answer = pickle.loads(pool.call(job, tries=tries))
        return result

    def submit(function: Callable[[Any], Any], task: Any) -> Future[Answer]:
        return threads.submit(do, pickle.dumps((function, task)))

    try:
        yield Executor(submit, lambda: count)
    finally:
        # end the processes before joining the threads: these wait for answers of the processes
        threads.shutdown(wait=False, cancel_futures=True)
        pool.end()
        threads.shutdown()


def main() -> None:
    """Do the jobs that arrive on standard input, one after the other, until it closes."""
    deferred_modules.defer()
    # libraries and programs that a job starts get neither pipe: they read nothing, and print to standard error
    jobs, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.dup2(2, 1)
    waiting: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    _senders.append(Sender(answers))
    threading.Thread(target=_read, args=(jobs, waiting), daemon=True).start()
    _send(b"", answers)
    while True:
        _send(_do(waiting.get()), answers)


def _read(jobs: IO[bytes], waiting: queue.SimpleQueue[bytes]) -> None:
    """Queue the jobs that arrive; when no more can arrive, end this process and those that it has started."""
    try:
        while True:
            message = pickle.load(jobs)
            if isinstance(message, int):
                sender().give_up(message)
            else:
                waiting.put(message)
    finally:
        if os.getpgrp() == os.getpid():
            os.killpg(0, signal.SIGKILL)
        os._exit(1)


def _do(job: bytes) -> bytes:
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
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        # pickle calls methods of the exception's own class, which may raise anything: its text stands for it
        notes, error = error.__notes__, RuntimeError(f"{type(error).__name__}: {error}")
        error.__notes__ = notes
    return pickle.dumps((None, error, seconds))


def _send(message: bytes | tuple[Any], answers: IO[bytes]) -> None:
    pickle.dump(message, answers)
    answers.flush()


if __name__ == "__main__":
    # by its own name: what is pickled in the module __main__ of this process is not found in that of the sender
    from studies.mechanics import worker_process

    worker_process.main()
