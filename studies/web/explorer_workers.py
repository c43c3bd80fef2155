"""The explorer's worker processes: one answers quickly, the other refines its answers when the hand rests.

Of the requests of one page and side only the newest waits; older ones are dropped, and a running one is given up at
the next load increment or part. Its first picture is still finished if that takes less than `GRACE`; otherwise a hand
that never rests would see no picture. The processes (`studies.mechanics.executor`) stay: their imports,
compiled functions, meshes and factorisations serve the next request. Each has a connection to the server (`Talk`),
over which a job says its answers while it runs, and hears that a newer request has made it useless.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import gc
import multiprocessing
import os
import time
import traceback
from collections.abc import Callable, Hashable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from geometry.design import BadInput
from studies.mechanics.executor import Answer, WorkerDied, WorkerProcess
from studies.web.explorer_state import Request, request_of
from studies.web.page_content import as_json

if TYPE_CHECKING:
    from studies.web.explorer_answers import Answer as PartAnswer
    from studies.web.explorer_answers import Answers

GRACE = 1.0
"""Time that the first picture of a job may take after a newer request has arrived, s."""
PAUSE = 0.1
"""Time that a job waits for a newer request between its picture and what takes longer, s: more than the time between
two moves of a hand."""
PROGRESS = 0.3
"""Time between two messages of progress, and before the first, s."""
REST = 0.25
"""Time without a newer request after which an answer is refined, s."""
MOST_STARTS = 3
"""Starts of a process that dies before it has done anything."""

Key = Hashable
"""A page and a side: a newer request replaces an older one with the same key."""
Send = Callable[[str], None]
"""Takes an answer for a page."""


class Job(NamedTuple):
    """A request, the level of its answers, the name of an export or "", and the time of its receipt by the server.

    The process gives it a number.
    """

    request: Request
    level: str
    export: str = ""
    asked: float = 0.0
    number: int = 0


class GivenUp(Exception):
    """A newer request has made this job useless."""


class Talk:
    """The connection of this process to the server, whose jobs it does one after the other.

    store : file of solved states; default: the user's.
    background : whether the jobs leave the processor to others.
    """

    def __init__(self, server: Connection, store: Path | None = None, *, background: bool = False) -> None:
        self._server, self._given_up = server, -1
        self.store, self.background = store, background

    def say(self, content: str) -> None:
        """Send an answer of the job that runs."""
        self._server.send(content)

    def has_given_up(self, number: int, patience: float = 0.0) -> bool:
        """Return whether the server has given up the job with this number, or does so within `patience`, s."""
        end = time.monotonic() + patience
        while self._given_up < number and self._server.poll(max(end - time.monotonic(), 0.0)):
            self._given_up = self._server.recv()
        return self._given_up >= number


_talks: list[Talk] = []
"""The connection of this process, if it does jobs of a server."""


_open = contextlib.ExitStack()
"""Holds the store of this process open."""


def begin_talk(server: Connection, store: Path | None, background: bool) -> None:
    """Note the connection of this new process to the server."""
    _talks.append(Talk(server, store, background=background))


@functools.cache
def _answers() -> Answers:
    """Return what this process keeps, after it has imported and compiled what requests need by small solves."""
    from studies.mechanics import path_solver
    from studies.mechanics import store as stores
    from studies.web.explorer_answers import Answers

    talk = _talks[-1]
    if talk.background and hasattr(os, "nice"):
        os.nice(10)
    answers = Answers(_open.enter_context(stores.opened(talk.store, later=True, said=True)))
    # found once for a process, in the time of some pictures
    path_solver.origin()
    for load in ({"depth": 0.5}, {"depth": 0.5, "shear": 0.2}):
        # the first answer is the picture
        next(answers.all_of(request_of({"parts": ["state", "sensor3d"], "state": {"load": load}}), "quick"))
    # modules stay: searching them for garbage would take longer than a picture
    gc.freeze()
    return answers


def warm(_: None) -> None:
    """Make a worker process ready for its first job."""
    _answers()


def do(job: Job) -> bytes | None:
    """Do a job in a worker process, which says each answer as soon as it is ready; return the file of an export."""
    from fem.solve.load_increments import watched

    answers, run = _answers(), _Run(job)
    try:
        with watched(run.watch):
            if job.export:
                return answers.export(job.export, job.request)
            for answer in answers.all_of(job.request, job.level):
                run.take(answer)
    except GivenUp:
        pass
    except BadInput:
        raise
    except Exception:
        # the next job starts afresh
        answers.forget()
        raise
    return None


class _Run:
    """A job that runs: it says answers and progress to the server, and ends when it is useless."""

    def __init__(self, job: Job) -> None:
        self.job, self.talk, self.pictured = job, _talks[-1], False
        self.begin = self.last_progress = time.monotonic()

    def take(self, answer: PartAnswer | None) -> None:
        """Say an answer with the times that the job has waited and has taken, ms; None ends the picture."""
        if answer is not None:
            part, level, data = answer
            waits = self.begin - self.job.asked, time.monotonic() - self.begin
            self._say(part=part, level=level, times=[round(1000 * wait, 1) for wait in waits], data=data)
        else:
            self.pictured = True
            self.talk.has_given_up(self.job.number, PAUSE)
        if self.pictured:
            self.watch(0.0)

    def watch(self, share: float) -> None:
        """End a job that is useless, and report progress of a long one."""
        now = time.monotonic()
        if self.talk.has_given_up(self.job.number) and (self.pictured or now - self.begin > GRACE):
            raise GivenUp
        if now - self.last_progress > PROGRESS:
            self.last_progress = now
            seconds = round(now - self.begin, 1)
            self._say(progress={"share": round(share, 3), "seconds": seconds, "level": self.job.level})

    def _say(self, **content: Any) -> None:
        self.talk.say(encoded(self.job.request.number, self.job.request.side, **content))


def fault(error: BaseException) -> str:
    """Return a sentence on an error that is no refusal of the input, and print its traceback on the terminal."""
    traceback.print_exception(error)
    text = str(error).strip().partition("\n")[0]
    return f"magtip failed at this state ({type(error).__name__}{text and ': '}{text:.200}): change the state"


def encoded(number: int, side: str, **content: Any) -> str:
    """Return an answer as JSON; numbers that are not finite become null, and arrays are packed."""
    return as_json({"number": number, "side": side, **content})


class Asked(NamedTuple):
    """A job that waits or runs, what takes its answers for the page, and what takes the content of its export."""

    job: Job
    send: Send
    file: asyncio.Future[bytes] | None = None

    def finish(self, content: bytes | None, error: BaseException | None) -> None:
        """Take what the job returned or raised."""
        if isinstance(error, BadInput):
            self.refuse(str(error))
        elif error is not None:
            self.refuse(fault(error))
        elif self.file is not None and content is not None and not self.file.done():
            self.file.set_result(content)

    def refuse(self, sentence: str) -> None:
        """Answer that there is no answer, and why."""
        if self.file is None:
            request = self.job.request
            self.send(encoded(request.number, request.side, error=sentence, field=None))
        elif not self.file.done():
            self.file.set_exception(BadInput(sentence))


class PageWorker:
    """One worker process, started again if it dies, and the jobs that wait for it, in the order of their keys."""

    def __init__(
        self, loop: asyncio.AbstractEventLoop, store: Path | None = None, *, background: bool = False
    ) -> None:
        self._loop, self._store, self._background = loop, store, background
        self._waiting: dict[Key, Asked] = {}
        self._arrived = asyncio.Event()
        self._running: Key = None
        self._send: Send = _unheard
        self._number, self._lost = 0, ""
        self._begin()
        self._task = loop.create_task(self._serve())

    @property
    def pid(self) -> int | None:
        """Number of the process; None before it is started."""
        return self._process.pid

    def ask(self, key: Key, asked: Asked) -> None:
        """Queue a request, or an export, in place of an older one of this key."""
        self.drop(key)
        if self._lost:
            asked.refuse(self._lost)
            return
        self._waiting[key] = asked
        self._arrived.set()

    def drop(self, key: Key) -> None:
        """Forget the request of a key that waits, and give up the one that runs."""
        self._waiting.pop(key, None)
        if self._running == key:
            with contextlib.suppress(OSError):  # it has died
                self._ours.send(self._number)

    def close(self) -> None:
        """End the process."""
        self._task.cancel()
        self._end()

    def _begin(self) -> None:
        self._ours, self._theirs = multiprocessing.Pipe()
        self._process = WorkerProcess(1, begin_talk, self._theirs, self._store, self._background)

    def _end(self) -> None:
        if not self._ours.closed:
            self._loop.remove_reader(self._ours)
            self._ours.close()
        self._theirs.close()
        self._process.end()

    async def _serve(self) -> None:
        """Warm a process, and have it do one job after the other; begin again if it dies, but not too often."""
        failures, ending = 0, ""
        while failures <= MOST_STARTS:
            try:
                _, error, _ = await self._call(warm, None)
                if error is None:
                    failures = 0
                    # it has its end of the connection: without another one, its death closes the connection
                    self._theirs.close()
                    self._loop.add_reader(self._ours, self._hear)
                    while True:
                        await self._do_next()
                traceback.print_exception(error)
                ending = f"{type(error).__name__}: {error}"
            except WorkerDied as death:
                ending = str(death)
            self._end()
            self._begin()
            failures += 1
        self._lost = (
            f"the process that solves ends whenever it is started ({ending}), and the terminal says why: "
            "mend the installation, then start magtip explore again"
        )
        for asked in self._waiting.values():
            asked.refuse(self._lost)
        self._waiting.clear()

    async def _do_next(self) -> None:
        """Have the process do the job that has waited longest."""
        while not self._waiting:
            self._arrived.clear()
            await self._arrived.wait()
        if self._ours.closed:
            # it died while it had nothing to do
            raise WorkerDied(self._process.end())
        self._running = next(iter(self._waiting))
        asked = self._waiting.pop(self._running)
        self._number += 1
        self._send = asked.send
        try:
            job = asked.job._replace(number=self._number)
            content, error, _ = await self._call(do, job)
        except WorkerDied as death:
            asked.refuse(f"the process that solved this state ended ({death}): change the state and try again")
            raise
        finally:
            self._running = None
        asked.finish(content, error)

    async def _call(self, function: Callable[[Any], Any], task: Any) -> Answer:
        """Have the process call a function, and hear all that it said before it returned."""
        try:
            return await asyncio.to_thread(self._process.call, function, task)
        finally:
            self._hear()

    def _hear(self) -> None:
        """Hand on what the process has said."""
        try:
            while self._ours.poll():
                self._send(self._ours.recv())
        except (EOFError, OSError):
            if not self._ours.closed:
                # it has died
                self._loop.remove_reader(self._ours)
                self._ours.close()


def _unheard(content: str) -> None:
    """Takes nothing: a process that warms up says nothing."""


class Workers:
    """The quick and the refining process, and the timers that begin a refinement."""

    def __init__(self, loop: asyncio.AbstractEventLoop, store: Path | None = None) -> None:
        self._loop = loop
        self.quick, self.refining = PageWorker(loop, store), PageWorker(loop, store, background=True)
        self._timers: dict[Key, asyncio.TimerHandle] = {}

    def ask(self, key: Key, request: Request, send: Send) -> None:
        """Answer a request: quick first, refined when no newer one has come for a while."""
        self.forget(key)
        self.quick.ask(key, Asked(Job(request, "quick", asked=time.monotonic()), send))
        if request.state.level == "standard":
            self._timers[key] = self._loop.call_later(REST, self._refine, key, request, send)

    async def export(self, name: str, request: Request) -> bytes:
        """Return the file of a request, or refuse a state that cannot be solved."""
        file: asyncio.Future[bytes] = self._loop.create_future()
        key = ("export", id(file))
        job = Job(request, request.state.level, name, time.monotonic())
        self.refining.ask(key, Asked(job, lambda _: None, file))
        try:
            return await file
        finally:
            self.refining.drop(key)

    def forget(self, key: Key) -> None:
        """Drop the requests of a page and side, which has closed or asks anew."""
        if (timer := self._timers.pop(key, None)) is not None:
            timer.cancel()
        self.quick.drop(key)
        self.refining.drop(key)

    def close(self) -> None:
        """End both processes."""
        for timer in self._timers.values():
            timer.cancel()
        self._timers.clear()
        self.quick.close()
        self.refining.close()

    def _refine(self, key: Key, request: Request, send: Send) -> None:
        self._timers.pop(key, None)
        self.refining.ask(key, Asked(Job(request, "standard", asked=time.monotonic()), send))
