"""The explorer's web server: the page, its files, exports, and the WebSocket over which states and answers pass.

It listens on 127.0.0.1 alone. Every request needs the token of this run, in the address or in a cookie that the
first page sets, and a Host header that names this server. Without both checks any page of the browser could drive it:
by its own scripts, or by a name that it points to 127.0.0.1. The WebSocket checks the Origin header too.
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import json
import secrets
import signal
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any
from urllib.parse import urlencode

import tornado.httpserver
import tornado.ioloop
import tornado.netutil
import tornado.web
import tornado.websocket

from geometry.design import BadInput, paper
from studies.mechanics import store as stores
from studies.output.bounded_files import json_in
from studies.web import explorer_workers, state_exports
from studies.web.explorer_state import Request, explorer_fields, request_of, wrong_field
from studies.web.explorer_workers import encoded, fault
from studies.web.page_content import PAGE, explorer_page, page_charts

if TYPE_CHECKING:
    from studies.calibration.sensor_fit import Fit
    from studies.parts.requirements import Requirements
    from studies.sensing.array_readings import Grid

INDEX, CONTROLS = "index.html", "fields.json"
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Content-Security-Policy: nothing is loaded from, or sent to, another address."""
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".json": "application/json",
    ".md": "text/plain; charset=utf-8",
    ".LICENSE": "text/plain; charset=utf-8",
}
"""Types of the page's files by their last suffix; others are not served."""
FILES = {path.relative_to(PAGE).as_posix(): path for path in PAGE.rglob("*") if path.suffix in TYPES}
"""The page's files by their names in an address: there is no way from a name to another file."""
MOST_BYTES = 100_000
"""Largest message or export request, bytes: a state has some 1000."""
MOST_PAGES = 16
"""Most pages that are open at once."""


class Server:
    """A server that listens on 127.0.0.1, and what its handlers share; an event loop must run.

    Parameters
    ----------
    changed : fields of the address of the first state, see `explorer_state`.
    port : port to listen on; 0 for any free one. BadInput is raised for one that cannot be used.
    needed : requirements whose margins the pages show.
    made : calibrated sensor whose forces and readings they show.
    zero : called when a page asks for a zero of the stream that it shows.
    store : file of solved states; default: the user's.
    stated : array whose beams the pages show; its pitch is stated.
    """

    def __init__(
        self,
        changed: Mapping[str, str] = MappingProxyType({}),
        port: int = 0,
        needed: Requirements | None = None,
        made: Fit | None = None,
        zero: Callable[[], None] | None = None,
        store: Path | None = None,
        stated: Grid | None = None,
    ) -> None:
        if not 0 <= port <= 65535:
            raise BadInput(f"--port must lie between 0 (any free one) and 65535; got {port}")
        try:
            sockets = tornado.netutil.bind_sockets(port, "127.0.0.1")
        except OSError as error:
            cause = error.strerror or str(error)
            raise BadInput(
                f"port {port} cannot be used ({cause}): choose another --port, or 0 for a free one"
            ) from None
        self.needed, self.made, self.zero, self.stated = needed, made, zero, stated
        self.workers = explorer_workers.Workers(asyncio.get_running_loop(), store)
        self.pages: set[Live] = set()
        # held by the one export of a mould that runs
        self.molding = asyncio.Lock()
        self._token, number = secrets.token_urlsafe(24), sockets[0].getsockname()[1]
        self._hosts = {f"127.0.0.1:{number}", f"localhost:{number}"}
        # browsers share cookies between the ports of a host, so the name has the port
        self.cookie = f"magtip_token_{number}"
        fragment = f"#{urlencode(changed)}" if changed else ""
        self.address = f"http://127.0.0.1:{number}/?token={self._token}{fragment}"
        self._server = tornado.httpserver.HTTPServer(application(self), max_body_size=MOST_BYTES)
        self._server.add_sockets(sockets)

    def request_of(self, content: object) -> Request:
        """Return the request in a message of a page, with what the explorer was started with."""
        return replace(request_of(content), needed=self.needed, made=self.made, stated=self.stated)

    def is_own(self, origin: str) -> bool:
        """Return whether the Origin header of a request names this server."""
        scheme, _, host = origin.partition("://")
        return scheme == "http" and host.lower() in self._hosts

    def admits(self, handler: tornado.web.RequestHandler) -> bool:
        """Return whether a request comes from a page of this server."""
        headers, origin = handler.request.headers, handler.request.headers.get("Origin")
        if handler.request.host.lower() not in self._hosts or (origin is not None and not self.is_own(origin)):
            return False
        tokens = headers.get("X-Token"), handler.get_query_argument("token", None), handler.get_cookie(self.cookie)
        return hmac.compare_digest(next(filter(None, tokens), "").encode(), self._token.encode())

    def give_cookie(self, handler: tornado.web.RequestHandler) -> None:
        """Give the browser the token, for requests without it in their address."""
        handler.set_cookie(self.cookie, self._token, httponly=True, samesite="Strict", path="/")

    def send(self, text: str) -> None:
        """Send a text to all pages."""
        for page in self.pages:
            page.send(text)

    async def close(self) -> None:
        """Close all pages and end the worker processes."""
        self._server.stop()
        for page in list(self.pages):
            page.close(1001, "the explorer has been ended")
        self.workers.close()
        await asyncio.sleep(0)


class Ours(tornado.web.RequestHandler):
    """A handler that knows what all share."""

    def initialize(self, server: Server) -> None:
        self.server = server

    def log_exception(self, *error: Any) -> None:
        """Log bugs only: a refused request and a closed tab are none."""
        closed = (tornado.iostream.StreamClosedError, tornado.websocket.WebSocketClosedError)
        if not isinstance(error[1], (tornado.web.HTTPError, *closed)):
            super().log_exception(*error)


class Guarded(Ours):
    """Refuses requests without the token or with another Host, and sets the headers of all answers."""

    def set_default_headers(self) -> None:
        self.clear_header("Server")
        self.set_header("Content-Security-Policy", POLICY)
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("Cross-Origin-Opener-Policy", "same-origin")
        self.set_header("Cross-Origin-Resource-Policy", "same-origin")
        self.set_header("Cache-Control", "no-store")

    def prepare(self) -> None:
        if not self.server.admits(self):
            raise tornado.web.HTTPError(403)

    def get(self, name: str = "") -> None:
        raise tornado.web.HTTPError(404)

    def write_error(self, status_code: int, **kwargs: Any) -> None:
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{status_code}: {self._reason}\n")


class Files(Guarded):
    """The page, its scripts, styles and pictures, and its controls with the values of the preset."""

    def get(self, name: str = INDEX) -> None:
        if name == INDEX:
            self.server.give_cookie(self)
            content = explorer_page(of_array=self.server.stated is not None)
        elif name == CONTROLS:
            fields = explorer_fields(paper(), self.server.needed, self.server.stated)
            content = json.dumps({"fields": fields, "charts": page_charts()})
        elif name in FILES:
            content = FILES[name].read_text("utf-8")
        else:
            raise tornado.web.HTTPError(404)
        self.set_header("Content-Type", TYPES[Path(name).suffix])
        self.finish(content)


class Live(Ours, tornado.websocket.WebSocketHandler):
    """The connection of one page: requests in, answers out."""

    def prepare(self) -> None:
        if not self.server.admits(self) or len(self.server.pages) >= MOST_PAGES:
            raise tornado.web.HTTPError(403)

    def check_origin(self, origin: str) -> bool:
        return self.server.is_own(origin)

    def get_compression_options(self) -> None:
        return None

    def open(self, *args: str, **kwargs: str) -> None:
        self.set_nodelay(True)
        self.server.pages.add(self)

    def on_message(self, message: str | bytes) -> None:
        content: object = None
        try:
            content = parsed(message)
            if content == {"zero": True} and self.server.zero is not None:
                self.server.zero()
                return
            request = self.server.request_of(content)
            if "commands" in request.parts:
                data = state_exports.commands(request.state)
                self.send(encoded(request.number, request.side, part="commands", level="formula", data=data))
            if set(request.parts) - {"commands"}:
                self.server.workers.ask((id(self), request.side), request, self.send)
        except BadInput as error:
            field = wrong_field(content) if isinstance(content, dict) else None
            self.send(refusal(content, str(error), field))
        except Exception as error:
            self.send(refusal(content, fault(error)))

    def send(self, text: str) -> None:
        """Send a text unless the page has been closed."""
        with contextlib.suppress(tornado.websocket.WebSocketClosedError):
            # a page may also close while the text is on its way; its loss needs no trace on the terminal
            self.write_message(text).add_done_callback(lambda sent: sent.cancelled() or sent.exception())

    def on_close(self) -> None:
        self.server.pages.discard(self)
        for side in ("a", "b"):
            self.server.workers.forget((id(self), side))


def parsed(text: str | bytes) -> object:
    """Return what a page has sent as JSON, or refuse it."""
    try:
        return json_in(text)
    except BadInput as error:
        raise BadInput(f"the request {error}") from None


def refusal(content: object, sentence: str, field: str | None = None) -> str:
    """Return the answer to a request that cannot be used: one sentence, and the field that it is about."""
    table = content if isinstance(content, dict) else {}
    number, side = table.get("number", 0), table.get("side", "a")
    return encoded(
        number if isinstance(number, int) else 0, side if side == "b" else "a", error=sentence, field=field
    )


def application(server: Server) -> tornado.web.Application:
    """Return the routes of a server."""
    options = {"server": server}
    return tornado.web.Application(
        [
            ("/", Files, options),
            ("/page/(.*)", Files, options),
            ("/live", Live, options),
            ("/export/([a-z.]+)", Export, options),
        ],
        default_handler_class=Guarded,
        default_handler_args=options,
        log_function=lambda handler: None,
        websocket_max_message_size=MOST_BYTES,
        websocket_ping_interval=30,
    )


class Export(Guarded):
    """A file of the state that the page sends."""

    making: asyncio.Task[bytes] | None = None

    async def post(self, name: str) -> None:
        if name not in state_exports.TYPES:
            raise tornado.web.HTTPError(404)
        try:
            self.making = asyncio.ensure_future(
                self._content(name, self.server.request_of(parsed(self.request.body)))
            )
            content = await self.making
        except asyncio.CancelledError:
            return  # the client has left
        except Exception as error:
            is_refused = isinstance(error, BadInput)
            self.set_status(400 if is_refused else 500)
            self.set_header("Content-Type", "text/plain; charset=utf-8")
            self.finish(str(error) if is_refused else fault(error))
            return
        self.set_header("Content-Type", state_exports.TYPES[name])
        self.set_header("Content-Disposition", f'attachment; filename="magtip-{name}"')
        self.finish(content)

    async def _content(self, name: str, request: Request) -> bytes:
        if name == "design.toml":
            return state_exports.design_file(request).encode()
        if name != "mold.zip":
            return await self.server.workers.export(name, request)
        async with self.server.molding:
            return await state_exports.mold(request.state)

    def on_connection_close(self) -> None:
        """End the export of a client that has left."""
        if self.making is not None:
            self.making.cancel()


@dataclass(frozen=True, slots=True)
class Measuring:
    """A stream of readings that runs beside the server.

    Attributes
    ----------
    run : called in a thread of its own, with a function that sends a text to all pages; returns when `ended` is set.
    zero : of `Server`.
    """

    run: Callable[[Callable[[str], None]], None]
    ended: threading.Event
    zero: Callable[[], None]


def serve(
    changed: dict[str, str],
    port: int,
    needed: Requirements | None,
    made: Fit | None,
    ready: Callable[[str], None],
    measuring: Measuring | None = None,
    store: Path | None = None,
    stated: Grid | None = None,
) -> None:
    """Serve the page until Ctrl-C; `ready` takes its address when the server listens, for the rest see `Server`."""
    # a store that cannot be used is refused, or said to keep nothing, before the processes open it
    with stores.opened(store):
        pass

    async def served() -> None:
        running = Server(changed, port, needed, made, measuring.zero if measuring else None, store, stated)
        thread: threading.Thread | None = None
        stop, loop = asyncio.Event(), asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            # event loops of Windows, and of other threads than the main one, take no signal handlers; Ctrl-C raises
            with contextlib.suppress(NotImplementedError, RuntimeError):
                loop.add_signal_handler(number, stop.set)
        try:
            # the worker processes start meanwhile
            await asyncio.sleep(0)
            ready(running.address)
            # the first request of a page then finds what its checks import
            request_of({})
            if measuring is not None:

                def send(text: str) -> None:
                    loop.call_soon_threadsafe(running.send, text)

                thread = threading.Thread(target=measuring.run, args=(send,), daemon=True)
                thread.start()
            await stop.wait()
        finally:
            if measuring is not None and thread is not None:
                measuring.ended.set()
                await asyncio.to_thread(thread.join)
            await running.close()

    asyncio.run(served())
