"""The worker processes of the explorer's server: one for quick answers, one that refines them when the hand rests.

Of the requests of one page and side only the newest waits; older ones are dropped, and a running one is abandoned.
The processes stay: their imports, compiled functions, meshes and factorisations serve the next request.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Hashable
from typing import Any, NamedTuple

from geometry.design import BadInput
from studies.exploration.worker_process import environment
from studies.explorer.explorer_process import BACKGROUND, Job, Kind, encoded
from studies.explorer.explorer_state import request_of

COMMAND = (sys.executable, "-P", "-m", "studies.explorer.explorer_process")
"""Command line of a worker process. -P keeps it from importing modules of the user's current folder."""
REST = 0.25
"""Time without a newer request after which an answer is refined, s."""
MOST_STARTS = 3
"""Starts of a process that dies before it has done anything."""
ENDING = 1.0
"""Longest time that a process may take to end after it has closed its pipe, s."""

Key = Hashable
"""A page and a side: a newer request replaces an older one with the same key."""
Send = Callable[[str | bytes], None]
"""Takes an answer: a text for a page, or the bytes of an export."""


class Asked(NamedTuple):
    """A request that waits or runs: the page's message, level, name of an export or "", receiver, time of receipt."""

    message: dict[str, Any]
    level: str
    export: str
    send: Send
    time: float

    def refuse(self, sentence: str) -> None:
        """Answer that there is no answer, and why."""
        number, side = self.message.get("number", 0), self.message.get("side", "a")
        self.send(encoded(number, side, error=sentence, field=None))


class WorkerProcess:
    """One worker process, restarted if it dies, and the jobs that wait for it.

    Its methods are called in the thread of the event loop.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, *more: str) -> None:
        self._loop, self._command = loop, (*COMMAND, *more)
        self._waiting: dict[Key, Asked] = {}
        self._running: tuple[Key, Asked] | None = None
        self._number = 0
        self._failures = 0
        self._closed = False
        self._given_up = ""
        self._ready = False
        self._start()

    def ask(self, key: Key, message: dict[str, Any], level: str, send: Send, export: str = "") -> None:
        """Queue a request, or an export, in place of an older one of this key."""
        self.drop(key)
        self._waiting[key] = Asked(message, level, export, send, time.monotonic())
        if self._given_up:
            self._refuse_waiting()
        self._next()

    def drop(self, key: Key) -> None:
        """Forget the request of a key that waits, and abandon the one that runs."""
        self._waiting.pop(key, None)
        if self._running is not None and self._running[0] == key:
            self._write(self._number)

    def close(self) -> None:
        """End the process."""
        self._closed = True
        self._waiting.clear()
        _kill(self._process)
        self._process.wait()

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    def _start(self) -> None:
        self._ready, self._running = False, None
        self._process = subprocess.Popen(
            self._command, env=environment(1), stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
        )
        threading.Thread(target=self._listen, args=(self._process,), daemon=True).start()

    def _listen(self, process: subprocess.Popen[bytes]) -> None:
        """Hand everything that a process sends to the event loop, in a thread of its own."""
        assert process.stdout is not None
        with contextlib.suppress(RuntimeError):  # the loop is closed
            try:
                while True:
                    number, kind, content = pickle.load(process.stdout)
                    self._loop.call_soon_threadsafe(self._take, number, kind, content)
            except (EOFError, pickle.UnpicklingError, OSError, ValueError):
                pass  # the process has ended, or `close` has closed the pipe
            finally:
                self._loop.call_soon_threadsafe(self._lost, process)

    def _take(self, number: int, kind: Kind, content: str | bytes) -> None:
        """Pass an answer on, or begin the next job."""
        if kind == "done":
            self._ready, self._running, self._failures = True, None, 0
            self._next()
        elif self._running is not None and self._number == number:
            self._running[1].send(content)

    def _lost(self, process: subprocess.Popen[bytes]) -> None:
        """Start another process after one has died, and say so to the page that waits for it."""
        if self._closed or process is not self._process:
            return
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(ENDING)
        _kill(process)
        ending = _ending(process.wait())
        if self._running is not None:
            self._running[1].refuse(
                f"the process that solved this state ended ({ending}): change the state and try again"
            )
            self._running = None
        self._failures += 1
        if self._failures <= MOST_STARTS:
            self._start()
            return
        self._given_up = (
            f"the process that solves ends whenever it is started ({ending}), and the terminal says why: "
            "mend the installation, then start magtip explore again"
        )
        self._refuse_waiting()

    def _refuse_waiting(self) -> None:
        """Say to all requests that wait that no process can answer them."""
        while self._waiting:
            self._waiting.pop(next(iter(self._waiting))).refuse(self._given_up)

    def _next(self) -> None:
        """Begin the job that has waited longest."""
        if not self._ready or self._running is not None or not self._waiting:
            return
        key = next(iter(self._waiting))
        asked = self._waiting.pop(key)
        self._number += 1
        self._running = key, asked
        self._write(Job(self._number, asked.message, asked.level, asked.export, asked.time))

    def _write(self, content: Job | int) -> None:
        """Send a job, or the number of one to abandon."""
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError, OSError, ValueError):
            pickle.dump(content, self._process.stdin)
            self._process.stdin.flush()


class Workers:
    """The quick and the refining process, and the timers that begin a refinement."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self.quick, self.refining = WorkerProcess(loop), WorkerProcess(loop, BACKGROUND)
        self._timers: dict[Key, asyncio.TimerHandle] = {}

    def ask(self, key: Key, message: dict[str, Any], send: Send) -> None:
        """Answer a checked request: quick first, refined when no newer one has come for a while."""
        self.refining.drop(key)
        self._stop_timer(key)
        self.quick.ask(key, message, "quick", send)
        if message.get("state", {}).get("level", "standard") == "standard":
            self._timers[key] = self._loop.call_later(REST, self._refine, key, message, send)

    async def export(self, name: str, message: dict[str, Any]) -> bytes:
        """Return the file of a checked request.

        Raises
        ------
        BadInput
            The state cannot be solved.
        """
        future: asyncio.Future[bytes] = self._loop.create_future()

        def take(content: str | bytes) -> None:
            if future.done():
                return
            if isinstance(content, bytes):
                future.set_result(content)
            elif "error" in (answer := json.loads(content)):
                future.set_exception(BadInput(answer["error"]))

        key = ("export", id(future))
        level = message.get("state", {}).get("level", "standard")
        self.refining.ask(key, message, level, take, name)
        try:
            return await future
        finally:
            self.refining.drop(key)

    def forget(self, key: Key) -> None:
        """Drop the requests of a page that has been closed."""
        self._stop_timer(key)
        self.quick.drop(key)
        self.refining.drop(key)

    def close(self) -> None:
        """End both processes."""
        for timer in self._timers.values():
            timer.cancel()
        self._timers.clear()
        self.quick.close()
        self.refining.close()

    def _refine(self, key: Key, message: dict[str, Any], send: Send) -> None:
        self._timers.pop(key, None)
        self.refining.ask(key, message, "standard", send)

    def _stop_timer(self, key: Key) -> None:
        timer = self._timers.pop(key, None)
        if timer is not None:
            timer.cancel()


def parsed(text: str | bytes) -> object:
    """Return what a page has sent as JSON.

    Raises
    ------
    BadInput
        It is not JSON.
    """
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        raise BadInput("the request is not valid JSON") from None


def check(message: object) -> dict[str, Any]:
    """Return a message of a page that can be computed.

    Raises
    ------
    BadInput
        The sentence is the command line's.
    """
    if not isinstance(message, dict):
        raise BadInput(f"a request must be a table of values; got {message!r:.60}")
    request_of(message)
    return message


def _ending(code: int) -> str:
    return f"signal {-code}" if code < 0 else f"exit code {code}"


def _kill(process: subprocess.Popen[bytes]) -> None:
    """Kill a process and those that it has started, and close its pipes."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    for stream in (process.stdin, process.stdout):
        with contextlib.suppress(BrokenPipeError, OSError):
            if stream is not None:
                stream.close()
