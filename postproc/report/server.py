"""A page over a store of any size, served on this machine alone; each case is read when it is looked at."""

from __future__ import annotations

import math
import threading
import time
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import TYPE_CHECKING, Any

from postproc.report.packing import FULL, pack_floats
from postproc.report.page import Page
from rubhpc.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr

HOST = "127.0.0.1"
_BINARY, _HTML = "application/octet-stream", "text/html; charset=utf-8"
# Nothing but the page's own scripts and what this server gives; who drives a browser evaluates his own.
_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_IDLE = 10.0  # s: a connection that says nothing, or takes nothing, is closed
_FRESH = 2.0  # s for which a page is given again, or as long as it took to make it


class Library:
    """A store as it was when its page was last asked for; asking again shows what a run has added."""

    def __init__(self, open_now: Callable[[], xr.Dataset]) -> None:
        self._open = open_now
        self._lock = threading.Lock()
        self._page = Page(open_now())
        self._text, self._fresh_until = b"", -math.inf

    def page(self) -> bytes:
        """Return the page of the store in its current state; one that was made just now is given again."""
        with self._lock:  # of several requests at once, one makes it
            began = time.monotonic()
            if began > self._fresh_until:
                page = Page(self._open())
                self._page, self._text = page, page.html().encode()
                ended = time.monotonic()
                self._fresh_until = ended + max(_FRESH, ended - began)
            return self._text

    def values(self, name: str) -> bytes | None:
        """Return a measure of all cases; None where there is no such one."""
        page = self._page
        return pack_floats(page.measures.values(name)) if name in page.measures.names else None

    def record(self, flat: str) -> bytes | None:
        """Return one case in full; None where there is no such one, or it has no result."""
        page = self._page
        if not (flat.isascii() and flat.isdigit() and len(flat) < 19 and page.cases.has_record(int(flat))):
            return None
        return page.cases.record(int(flat), FULL)

    def answer(self, path: str) -> tuple[bytes, str] | None:
        """Return content and type at a path, which is no file; None where there is nothing."""
        if path == "/":
            return self.page(), _HTML
        kind, _, name = path.removeprefix("/").partition("/")
        found = None
        if kind == "values":
            found = self.values(name)
        elif kind == "record":
            found = self.record(name)
        return None if found is None else (found, _BINARY)


class _Handler(BaseHTTPRequestHandler):
    server: Server
    protocol_version = "HTTP/1.1"
    timeout = _IDLE

    def do_GET(self) -> None:
        """Answer with the page, a measure or a case."""
        if not self._is_own():
            self._send(HTTPStatus.FORBIDDEN, b"only for this machine\n", "text/plain")
            return
        try:
            answer = self.server.library.answer(self.path.partition("?")[0])
        except Exception as error:  # a damaged chunk of one case must not end the server
            self._send(HTTPStatus.INTERNAL_SERVER_ERROR, f"{error}\n".encode(), "text/plain; charset=utf-8")
            return
        if answer is None:
            self._send(HTTPStatus.NOT_FOUND, b"nothing here\n", "text/plain")
        else:
            self._send(HTTPStatus.OK, *answer)

    def _is_own(self) -> bool:
        """Whether a request comes from the page itself, or from who types its address.

        Another site's page may be led to this address by its own name, or ask for it by this one.
        """
        hosts = [f"{name}:{self.server.port}" for name in (HOST, "localhost")]
        origin = self.headers.get("Origin")
        return (
            self.headers.get_all("Host", []) in [[host] for host in hosts]
            and origin in (None, *(f"http://{host}" for host in hosts))
            and self.headers.get("Sec-Fetch-Site", "none") in ("none", "same-origin")
        )

    def do_HEAD(self) -> None:
        """Answer as to GET, without the body."""
        self.do_GET()

    def _send(self, status: HTTPStatus, body: bytes, kind: str) -> None:
        self.send_response(status)
        for name, value in (
            ("Content-Type", kind),
            ("Content-Length", str(len(body))),
            ("Content-Security-Policy", _POLICY),
            ("X-Content-Type-Options", "nosniff"),
            ("X-Frame-Options", "DENY"),
            ("Cross-Origin-Resource-Policy", "same-origin"),
            ("Referrer-Policy", "no-referrer"),
            ("Cache-Control", "no-store"),
        ):
            self.send_header(name, value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002 - the name it has
        """Say nothing of each request."""


class Server(ThreadingHTTPServer):
    """The server; `serve_forever` runs it, `url` is where it is found."""

    daemon_threads = True

    def __init__(self, library: Library, port: int = 0) -> None:
        try:
            super().__init__((HOST, port), _Handler)
        except OSError as error:
            problem = f"{port} is not available: {error.strerror or error}"
            raise InputError(f"--port: {problem}; give another, or leave it out") from error
        self.library = library

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a connection that breaks: a browser that is closed, or this server as it ends."""

    @property
    def port(self) -> int:
        """The port it listens on."""
        return int(self.server_address[1])

    @property
    def url(self) -> str:
        """Where a browser finds it."""
        return f"http://{HOST}:{self.port}/"
