"""A worker process of the explorer: it does one job at a time and sends each answer as soon as it is ready.

Jobs arrive as pickles on standard input, and answers leave as pickles on standard output: `(job number, kind,
content)` with kind "answer" (a text for the page), "file" (the bytes of an export) or "done". A thread reads the
input, so that the number of a job to abandon reaches it while it runs. A job is abandoned at the next load increment
or part. Its first picture is still finished if that takes less than `GRACE`; otherwise a hand that never rests would
see no picture. The process ends when its input closes, which happens however the server ends.
"""

from __future__ import annotations

import base64
import contextlib
import gc
import json
import os
import pickle
import queue
import signal
import sys
import threading
import time
import traceback
from typing import IO, TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from geometry.design import BadInput
from studies import deferred_modules

if TYPE_CHECKING:
    from studies.explorer.explorer_answers import Answers
    from studies.explorer.explorer_state import Request

BACKGROUND = "--background"
"""Option of a process that leaves the processor to others."""
GRACE = 1.0
"""Time that the first picture of a job may take after a newer request has arrived, s."""
PAUSE = 0.1
"""Time that a job waits for a newer request between its picture and what takes longer, s: more than the time between
two moves of a hand."""
PROGRESS = 0.3
"""Time between two messages of progress, and before the first, s."""
Kind = Literal["answer", "file", "done"]


class Job(NamedTuple):
    """One job: its number, the message of the page, the level of its answers, and the name of an export or "".

    `asked` is the time at which the server received the request, by the clock of the machine.
    """

    number: int
    message: dict[str, Any]
    level: str
    export: str = ""
    asked: float = 0.0


class Abandoned(Exception):
    """A newer request has made this job useless."""


class Worker:
    """Does the jobs of one process.

    Parameters
    ----------
    answers : stream to the server.
    """

    def __init__(self, answers: IO[bytes]) -> None:
        self._stream = answers
        self._lock = threading.Lock()
        self._abandoned = 0
        self._changed = threading.Event()
        self._job = Job(0, {}, "")
        self._begin = self._last_progress = 0.0
        self._pictured = False

    def send(self, kind: Kind, content: str | bytes = "") -> None:
        """Send an answer of the present job."""
        with self._lock:
            pickle.dump((self._job.number, kind, content), self._stream)
            self._stream.flush()

    def abandon(self, number: int) -> None:
        """Abandon a job, from another thread."""
        self._abandoned = number
        self._changed.set()

    def do(self, answers: Answers, job: Job) -> None:
        """Do a job, and announce its end after whatever it raised has been said.

        What ends the process ends it before the announcement, so that the server blames this job and no later one.
        """
        from fem.solve.load_increments import watched
        from studies.explorer.explorer_state import request_of

        self._job, self._begin, self._pictured = job, time.monotonic(), False
        self._last_progress = self._begin
        number, side = job.message.get("number", 0), job.message.get("side", "a")
        try:
            request = request_of(job.message)
            with watched(self._watch):
                if job.export:
                    self.send("file", answers.export(job.export, request.state))
                else:
                    self._answer(answers, request, job.level)
        except Abandoned:
            pass
        except BadInput as error:
            self.send("answer", encoded(number, side, error=str(error), field=None))
        except Exception as error:
            # the next job starts afresh
            answers.forget()
            self.send("answer", encoded(number, side, error=fault(error), field=None))
        self.send("done")

    def _answer(self, answers: Answers, request: Request, level: str) -> None:
        for answer in answers.all_of(request, level):
            if answer is not None:
                part, at_level, data = answer
                number, side, times = request.number, request.side, self._times()
                self.send("answer", encoded(number, side, part=part, level=at_level, times=times, data=data))
            else:
                self._pictured = True
                self._wait()
            if self._pictured:
                self._watch(0.0)

    def _times(self) -> tuple[float, float]:
        """Return the times that the present job has waited and has taken, ms."""
        now = time.monotonic()
        return round(1000 * (self._begin - self._job.asked), 1), round(1000 * (now - self._begin), 1)

    def _wait(self) -> None:
        """Wait until a newer request has come, at most `PAUSE`."""
        end = time.monotonic() + PAUSE
        while self._abandoned < self._job.number and (left := end - time.monotonic()) > 0:
            self._changed.wait(left)
            self._changed.clear()

    def _watch(self, share: float) -> None:
        """Abandon the job if it is useless, and report progress of a long one."""
        now = time.monotonic()
        if self._abandoned >= self._job.number and (self._pictured or now - self._begin > GRACE):
            raise Abandoned
        if now - self._last_progress > PROGRESS:
            self._last_progress = now
            number, side = self._job.message.get("number", 0), self._job.message.get("side", "a")
            progress = {"share": round(share, 3), "seconds": round(now - self._begin, 1), "level": self._job.level}
            self.send("answer", encoded(number, side, progress=progress))


def fault(error: Exception) -> str:
    """Return a sentence on an error that is no refusal of the input, and print its traceback on the terminal."""
    traceback.print_exception(error)
    text = str(error).strip().partition("\n")[0]
    return f"magtip failed at this state ({type(error).__name__}{text and ': '}{text:.200}): change the state"


def encoded(number: int, side: str, **content: Any) -> str:
    """Return an answer as JSON; numbers that are not finite become null, and arrays are packed."""
    return as_json({"number": number, "side": side, **content})


def as_json(message: Any) -> str:
    """Return a message as JSON, in the same way."""
    try:
        return json.dumps(message, allow_nan=False, separators=(",", ":"), default=packed)
    except ValueError:
        return json.dumps(_finite(message), separators=(",", ":"), default=packed)


def packed(array: Any) -> dict[str, str]:
    """Return an array as `OfflineData.decoded` in the page reads it: digits would take 20 times as long.

    >>> packed(np.array([1.0, 0.5])), packed(np.array([1, 2]))
    ({'float32': 'AACAPwAAAD8='}, {'uint16': 'AQACAA=='})
    """
    if not isinstance(array, np.ndarray):
        raise TypeError(f"an answer has no {type(array).__name__}")
    kind, name = "<f4", "float32"
    if array.dtype.kind in "iu":
        kind, name = ("<u2", "uint16") if array.size == 0 or array.max() < 1 << 16 else ("<u4", "uint32")
    return {name: base64.b64encode(np.ascontiguousarray(array, dtype=kind).tobytes()).decode("ascii")}


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if value - value == 0 else None
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    return [_finite(one) for one in value] if isinstance(value, (list, tuple)) else value


def warm(answers: Answers) -> None:
    """Import and compile what requests need, by a small solve of each kind."""
    from studies.explorer.explorer_state import request_of

    for load in ({"depth": 0.5}, {"depth": 0.5, "shear": 0.2}):
        message = {"parts": ["state", "sensor3d"], "state": {"load": load}}
        # the first answer is the picture
        next(answers.all_of(request_of(message), "quick"))
    # modules stay: searching them for garbage would take longer than a picture
    gc.freeze()


def main() -> None:
    """Do the jobs that arrive on standard input until it closes."""
    # Ctrl-C reaches all processes of the terminal; the server ends this one
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if BACKGROUND in sys.argv[1:] and hasattr(os, "nice"):
        os.nice(10)
    deferred_modules.defer()
    jobs, stream = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    # libraries and programs that a job starts get neither pipe: they read nothing, and print to standard error
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.dup2(2, 1)
    waiting: queue.SimpleQueue[Job] = queue.SimpleQueue()
    worker = Worker(stream)
    threading.Thread(target=_read, args=(jobs, waiting, worker), daemon=True).start()
    from studies.explorer.explorer_answers import Answers

    answers = Answers()
    with contextlib.suppress(BrokenPipeError):
        warm(answers)
        worker.send("done")
        while True:
            worker.do(answers, waiting.get())


def _read(jobs: IO[bytes], waiting: queue.SimpleQueue[Job], worker: Worker) -> None:
    """Queue jobs and note abandoned ones; when no more can arrive, end this process and those that it has started."""
    try:
        while True:
            message = pickle.load(jobs)
            if isinstance(message, Job):
                waiting.put(message)
            else:
                worker.abandon(message)
    finally:
        if os.getpgrp() == os.getpid():
            os.killpg(0, signal.SIGKILL)
        os._exit(1)


if __name__ == "__main__":
    # by its own name, so that pickles name the same classes on both sides
    from studies.explorer import explorer_process

    explorer_process.main()
