"""Worker processes of this machine, and the threads that hand tasks to them.

Each thread owns a `ProcessPoolExecutor` of one process. So a process that dies costs its own task only, which a new
one does once more, and no other task. Processes are spawned, never forked: threads of MKL and numba do not survive a
fork. They have sessions of their own, so that Ctrl-C reaches the process that hands out the tasks alone, and they end
at once, also during a task, when that one ends, however it ends. They return answers and write no files.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import queue
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from concurrent.futures import CancelledError, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.context import SpawnContext, SpawnProcess
from types import ModuleType
from typing import Any

from geometry.compiled import cores
from studies import deferred_modules

Answer = tuple[Any, BaseException | None, float]
"""What a function returned, or what it raised, and the time of the call, s."""
THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Environment variables with the number of threads of linear algebra and compiled loops."""
STARTS = 10
"""Attempts to start a process for one task if the system kills each while it loads."""
TRIES = 2
"""Number of processes that may die of a task."""
INLINE = 4.0
"""Expected time of tasks, s, up to which this process does them; to start workers takes about a second."""


class WorkerDied(Exception):
    """The process that did a task ended at each attempt; `codes` are the exit codes, negative for signals."""

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
    """No process could be started, or the worker has been ended. The text is one sentence."""


class SchedulerLost(RuntimeError):
    """The scheduler of a cluster, or all of its workers, are gone. The text is one sentence."""


class WorkersLost(RuntimeError):
    """A task was handed to several workers of a cluster, which were all lost. The text is one sentence."""


class _Process(SpawnProcess):
    """A process that does not import the main module, which may be a script without `if __name__ == "__main__"`."""

    _starting = threading.Lock()

    def start(self) -> None:
        with self._starting:
            main, sys.modules["__main__"] = sys.modules["__main__"], ModuleType("__main__")
            # the mask is inherited: Ctrl-C must not end a process before it has a session of its own
            mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
            try:
                super().start()
            finally:
                signal.pthread_sigmask(signal.SIG_SETMASK, mask)
                sys.modules["__main__"] = main

    def end(self) -> None:
        """End the process and what it has started."""
        if self.pid is not None:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self.pid, signal.SIGKILL)
            self.kill()  # before it has a session of its own

    @property
    def code(self) -> int:
        """Exit code of a process that its pool has waited for."""
        with self._starting:  # each start asks for the codes of all processes, which the system tells once
            return self.exitcode or 0


class _Context(SpawnContext):
    """Makes the process of one pool, and keeps it for the exit code, which pools do not tell."""

    process: _Process | None = None

    def Process(self, *args: Any, **kwargs: Any) -> _Process:  # type: ignore[override]
        self.process = _Process(*args, **kwargs)
        return self.process


def begin(threads: int, talk: Callable[..., None] | None = None, *arguments: Any) -> None:
    """Prepare this new process for tasks; nothing that reads the numbers of threads is imported yet."""
    deferred_modules.defer()
    for name in THREADS:
        user = os.environ.get(name, "")
        os.environ[name] = str(min(int(user), threads) if user.isdecimal() and int(user) > 0 else threads)
    os.setsid()
    os.dup2(2, 1)  # what tasks print, and programs that they start, is no answer
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if talk is not None:
        talk(*arguments)


def _end_with_parent() -> None:
    """End this process and those that it has started when the process that hands it tasks has ended."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os.killpg(0, signal.SIGKILL)


def called(function: Callable[[Any], Any], task: Any) -> Answer:
    """Call a function and return its value, or the exception that it raised, and the time."""
    start = time.perf_counter()
    try:
        return function(task), None, time.perf_counter() - start
    except BaseException as error:  # SystemExit and KeyboardInterrupt too are raised where the task comes from
        return None, error, time.perf_counter() - start


def _do(function: Callable[[Any], Any], task: Any) -> Answer:
    """Do a task in a worker process; what it raises has its traceback as a note, which pickle keeps."""
    value, error, seconds = called(function, task)
    if error is None:
        return value, None, seconds
    error.add_note("in a worker process:\n" + "".join(traceback.format_exception(error)))
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        # pickle calls methods of the exception's own class, which may raise anything: its text stands for it
        notes, error = error.__notes__, RuntimeError(f"{type(error).__name__}: {error}")
        error.__notes__ = notes
    return None, error, seconds


class WorkerProcess:
    """One process that does one task at a time, until it dies or is ended.

    Parameters
    ----------
    threads : number of threads of linear algebra and compiled loops.
    talk : function that the process calls when it begins, with the further arguments, such as a connection.
    """

    def __init__(self, threads: int = 1, talk: Callable[..., None] | None = None, *arguments: Any) -> None:
        self._lock, self._context = threading.Lock(), _Context()
        self._code: int | None = None
        self._pool = ProcessPoolExecutor(1, self._context, begin, (threads, talk, *arguments))

    @property
    def pid(self) -> int | None:
        """Number of the process; None before its first task."""
        process = self._context.process
        return process.pid if process is not None else None

    def call(self, function: Callable[[Any], Any], task: Any) -> Answer:
        """Have it call a function of a task and return what that returned or raised; `WorkerDied` if it died."""
        try:
            with self._lock:
                if self._code is not None:
                    raise WorkerDied(self._code)
                future = self._pool.submit(_do, function, task)
            answer: Answer = future.result()
        except (BrokenProcessPool, CancelledError):
            raise WorkerDied(self.end()) from None
        return answer

    def end(self) -> int:
        """End it, also during a task, and return its exit code; 0 if it was never started."""
        with self._lock:
            if self._code is None:
                process = self._context.process
                if process is not None:
                    process.end()
                self._pool.shutdown(cancel_futures=True)
                self._code = 0 if process is None else process.code
            return self._code


class Worker:
    """Does one task at a time by a process, which is started by the first task and replaced if it dies."""

    def __init__(self, threads: int = 1) -> None:
        self._threads, self._lock, self._ended = threads, threading.Lock(), False
        self._process: WorkerProcess | None = None

    @property
    def is_started(self) -> bool:
        """Whether there is a process."""
        return self._process is not None

    def call(self, function: Callable[[Any], Any], task: Any, tries: int = TRIES) -> Answer:
        """Have a process call a function of a task, and return what it returned or raised.

        `WorkerDied` says that so many processes died of the task, `NotStarted` that a process does not start, or that
        the worker has been ended.
        """
        codes: list[int] = []
        while len(codes) < tries:
            process = self._loaded()
            try:
                return process.call(function, task)
            except WorkerDied as death:
                codes += death.codes
        raise WorkerDied(*codes)

    def _loaded(self) -> WorkerProcess:
        """Return a process that has loaded: no task is the cause if it dies before, or without one."""
        for _ in range(STARTS):
            with self._lock:
                if self._ended:
                    raise NotStarted("the worker has been ended")
                is_new = self._process is None
                process = self._process = self._process or WorkerProcess(self._threads)
            try:
                process.call(abs, 0)
            except WorkerDied as death:
                self._process, last = None, death
                if is_new and death.codes[0] >= 0:
                    break  # an installation that does not work
            else:
                return process
        raise NotStarted(f"worker processes end with {last} before they do anything") from last

    def end(self) -> None:
        """End the process, also during a task; no other one is started."""
        with self._lock:
            self._ended, process = True, self._process
        if process is not None:
            process.end()


class Workers:
    """An executor of this machine: threads that each own a worker, which stays for later tasks until it is ended.

    Linear algebra in the workers shares the cores that this process may use.

    Parameters
    ----------
    count : number of workers, which are started when they are needed; 0: this process does the tasks when they are
        submitted. Default: as many as cores, and this process does what would take less time than their start.
    tries : number of processes that may die of a task, before its future raises `WorkerDied`.
    """

    def __init__(self, count: int | None = None, tries: int = TRIES) -> None:
        self.size, self._chosen, self._tries = cores() if count is None else count, count is not None, tries
        self._renew()

    def _renew(self) -> None:
        self._workers = [Worker(max(cores() // self.size, 1)) for _ in range(self.size)]
        # the last one first, which is started: others are started if several tasks are done at the same time
        self._idle: queue.LifoQueue[Worker] = queue.LifoQueue()
        for worker in self._workers:
            self._idle.put(worker)
        self._threads = ThreadPoolExecutor(max(self.size, 1))

    def pays(self, seconds: float) -> bool:
        """Return whether tasks that take so long, s, are better done by workers than by this process."""
        return self.size > 0 and (self._chosen or seconds > INLINE or any(one.is_started for one in self._workers))

    def submit(self, function: Callable[[Any], Any], task: Any) -> Future[Answer]:
        """Hand over a function and a task; the future raises `WorkerDied` or `NotStarted`, see `Worker.call`."""
        if self.size:
            return self._threads.submit(self._call, self._idle, function, task)
        future: Future[Answer] = Future()
        future.set_result(called(function, task))
        return future

    def _call(self, idle: queue.LifoQueue[Worker], function: Callable[[Any], Any], task: Any) -> Answer:
        worker = idle.get()
        try:
            return worker.call(function, task, self._tries)
        finally:
            idle.put(worker)

    def end(self) -> None:
        """End the workers, also during tasks; later tasks have new ones."""
        # end the processes before joining the threads: these wait for answers of the processes
        self._threads.shutdown(wait=False, cancel_futures=True)
        for worker in self._workers:
            worker.end()
        self._threads.shutdown()
        self._renew()
