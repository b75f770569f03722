"""A live page: served to this machine alone, and drawn again when its file is saved."""

from __future__ import annotations

import contextlib
import http.server
import json
import math
import socket
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, NoReturn
from urllib.parse import parse_qs, urlsplit

from msgspec import Struct, field

from terratool.definition.findings import Finding
from terratool.definition.reader import CheckOptions
from terratool.definition.watch import Watch
from terratool.errors import TerratoolError, WriteError, reason
from terratool.viewing.places import Places, Site, read_site, site_of
from terratool.viewing.scene import PageScene

HOST = "127.0.0.1"
"""Address of the server, that of this machine alone."""
WAIT = 20.0
"""Seconds after which a page that waits for a change gets the unchanged state."""
MOST_CLIENTS = 32
"""Most connections that are answered at a time; a page has up to six."""
PATIENCE = 2.0
"""Seconds that a connection may take to send a request, or to take an answer, when others want its
place."""
_MOST_FINDINGS = 50
"""Most findings that a page shows."""


class _LivePicture(NamedTuple):
    """The last good picture of a file.

    Attributes:
        site: terrain and texts of the file.
        places: places of elements in the texts.
        scene: the scene, from `PageScene.to_bytes`.
    """

    site: Site
    places: Places
    scene: bytes


class LiveState(Struct, dict=True, eq=False):
    """The state of a live page.

    Attributes:
        version: number that grows with every change.
        picture: number that grows with every picture; 0 before the first one.
        findings: findings on the file as it is now, for JSON.
        shown: last good picture; None before the first one.
        changed: condition that is notified of every change.
    """

    version: int = 0
    picture: int = 0
    findings: list[dict[str, Any]] = field(default_factory=list)
    shown: _LivePicture | None = None
    changed: threading.Condition = field(default_factory=threading.Condition)

    def publish(self, site: Site, scene: PageScene) -> None:
        """Show the picture of a file without errors."""
        shown = _LivePicture(site, Places(site.checked), scene.to_bytes())
        with self.changed:
            self.shown, self.findings = shown, []
            self.picture += 1
            self._notify()

    def publish_error(self, error: TerratoolError) -> None:
        """Keep the picture, and show the findings of an error beside it."""
        findings: Sequence[Finding] = getattr(error, "findings", ())
        listed = [
            {
                "file": one.file, "line": one.line, "column": one.column, "code": one.code,
                "message": one.message, "hint": one.hint,
            }
            for one in findings[:_MOST_FINDINGS]
        ]  # fmt: skip
        if not listed:
            listed = [
                {
                    "file": "", "line": 0, "column": 0, "code": "", "message": error.message,
                    "hint": error.hint,
                }
            ]  # fmt: skip
        with self.changed:
            self.findings = listed
            self._notify()

    def _notify(self) -> None:
        """Count a change, and wake all who wait for one; `changed` is held."""
        self.version += 1
        self.changed.notify_all()

    def after(self, version: int, wait: float = WAIT) -> dict[str, Any]:
        """The state, for JSON, as soon as it is newer than a version, or after `wait` seconds."""
        with self.changed:
            self.changed.wait_for(lambda: self.version > version, wait)
            return {
                "version": self.version, "picture": self.picture, "findings": self.findings,
            }  # fmt: skip

    def values(self, x: float, y: float, below: float | None = None) -> dict[str, Any] | None:
        """Values of the field at a place, for JSON; None where there is no picture.

        They are those of the highest top, or of the highest one not above `below`. z and slope are
        None outside the terrain and in the void.
        """
        shown, picture = self.shown, self.picture
        if shown is None:
            return None
        terrain = shown.site.terrain
        found = terrain.sample(x, y, below=below)
        height, element = float(found.height), int(found.element)
        name = terrain.pointer(element)
        places = () if name is None else shown.places.of(name)
        line = ""
        if places:
            own = places[-1]
            line = f"{shown.places.files[own.file]}:{shown.places.lines([own])[own]}"
        known = math.isfinite(height)
        surface = int(found.surface)
        return {
            "picture": picture,
            "z": height if known else None,
            "slope": math.degrees(math.acos(min(1.0, float(found.normal[2])))) if known else None,
            "surface": terrain.surfaces[surface] if surface >= 0 else "",
            "element": name or "",
            "descr": terrain.descr_of(element),
            "line": line,
        }


class _Connections:
    """Open connections up to a number.

    Args:
        most: largest number of connections.
        patience: seconds after which a connection that keeps the server waiting gives way to
            another.
    """

    def __init__(self, most: int, patience: float) -> None:
        self._most, self._patience = most, patience
        self._since: dict[socket.socket, float | None] = {}
        """Time since which a connection keeps the server waiting; None where it waits itself."""
        self._lock = threading.Lock()

    def __contains__(self, connection: object) -> bool:
        return connection in self._since

    def add(self, connection: socket.socket) -> bool:
        """Add a connection, if need be in the place of one that gives way; False for no room."""
        with self._lock:
            if len(self._since) >= self._most:
                waits = [(since, one) for one, since in self._since.items() if since is not None]
                since, slowest = min(waits, key=lambda pair: pair[0], default=(math.inf, None))
                if slowest is None or time.monotonic() - since < self._patience:
                    return False
                del self._since[slowest]
                with contextlib.suppress(OSError):
                    slowest.shutdown(socket.SHUT_RDWR)  # which ends its thread
            self._since[connection] = time.monotonic()
            return True

    def set_waiting(self, connection: socket.socket, waits: bool) -> None:
        """Note whether a connection keeps the server waiting from now on, or waits itself."""
        with self._lock:
            if connection in self._since:
                self._since[connection] = time.monotonic() if waits else None

    def remove(self, connection: socket.socket) -> None:
        """Remove a closed connection."""
        with self._lock:
            self._since.pop(connection, None)


class _Server(http.server.ThreadingHTTPServer):
    """An HTTP server that answers a number of clients at a time, and others by a 503."""

    daemon_threads = True
    request_queue_size = 128  # with more at once, clients of Linux wait for seconds

    def __init__(
        self, address: tuple[str, int], handler: type[http.server.BaseHTTPRequestHandler],
        most: int, patience: float,
    ) -> None:  # fmt: skip
        super().__init__(address, handler)
        self.clients, self.refused = _Connections(most, patience), _Connections(most, 0.0)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer a request, or refuse it, in a thread of its own."""
        if not self.clients.add(request):
            self.refused.add(request)  # in place of the one that waits longest, if need be
        super().process_request(request, client_address)

    def shutdown_request(self, request: Any) -> None:
        """Close a connection."""
        self.clients.remove(request)
        self.refused.remove(request)
        super().shutdown_request(request)


class PageServer:
    """A server of one live page, for this machine alone.

    Args:
        page: text of the page.
        state: state of the page.
        port: number of the port; 0 for any that is free.
        most: number of connections that are answered at a time; others get a 503.
        patience: seconds that a connection may keep the server waiting when others want its place.

    Raises:
        WriteError: the port cannot be used.
    """

    def __init__(
        self, page: str, state: LiveState, port: int = 0, *, most: int = MOST_CLIENTS,
        patience: float = PATIENCE,
    ) -> None:  # fmt: skip
        handler = _handler(page.encode(), state)
        try:
            self._server = _Server((HOST, port), handler, most, patience)
        except (OSError, OverflowError) as error:
            why = reason(error) if isinstance(error, OSError) else "there is none of that number"
            raise WriteError(
                f"Port {port} cannot be used ({why}).",
                "Choose another one with --port, or leave that out.",
            ) from error
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"http://{HOST}:{self._server.server_port}/"

    def __enter__(self) -> PageServer:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._server.shutdown()
        self._server.server_close()


def _handler(page: bytes, state: LiveState) -> type[http.server.BaseHTTPRequestHandler]:
    """The class that answers requests for the page, its state, the scene, and values at a place."""

    class Handler(http.server.BaseHTTPRequestHandler):
        """A handler of requests to this page."""

        protocol_version = "HTTP/1.1"
        server_version, sys_version = "terratool", ""
        timeout = 60.0
        server: _Server

        def handle_one_request(self) -> None:
            self.server.clients.set_waiting(self.connection, True)
            super().handle_one_request()

        def do_GET(self) -> None:
            if self.connection in self.server.refused:
                self.close_connection = True
                self._answer(503, b"There are too many pages. Close some of them.", "text/plain")
                return
            self.server.clients.set_waiting(self.connection, False)
            port = self.server.server_port
            # a page of another site may use a name that resolves to this machine (DNS rebinding)
            if self.headers.get("Host") not in (f"{HOST}:{port}", f"localhost:{port}"):
                self._answer(403, b"This page is served to this machine alone.", "text/plain")
                return
            asked = urlsplit(self.path)
            given = parse_qs(asked.query)
            answers: dict[str, Callable[[], None]] = {
                "/": lambda: self._answer(200, page, "text/html; charset=utf-8"),
                "/state": lambda: self._state(given),
                "/scene": self._scene,
                "/values": lambda: self._values(given),
            }
            answers.get(asked.path, self._nothing)()

        def _state(self, given: dict[str, list[str]]) -> None:
            text = given.get("after", ["0"])[0]
            after = int(text) if text.isdecimal() and len(text) < 16 else 0
            self._json(state.after(after))

        def _scene(self) -> None:
            shown = state.shown
            if shown is None:
                self._nothing()
            else:
                self._answer(200, shown.scene, "application/octet-stream")

        def _values(self, given: dict[str, list[str]]) -> None:
            try:
                place = [float(given[key][0]) for key in ("x", "y", "below") if key in given]
            except ValueError:
                place = []
            good = len(place) >= 2 and all(map(math.isfinite, place))
            found = state.values(*place) if good else None
            if found is None:
                self._nothing()
            else:
                self._json(found)

        def _nothing(self) -> None:
            self._answer(404, b"There is nothing here.", "text/plain")

        def _json(self, value: dict[str, Any]) -> None:
            self._answer(200, json.dumps(value).encode(), "application/json")

        def _answer(self, code: int, body: bytes, kind: str) -> None:
            self.server.clients.set_waiting(self.connection, True)
            self.send_response(code)
            if code == 503:
                self.send_header("Retry-After", "1")
                self.send_header("Connection", "close")
            for name, text in (
                ("Content-Type", kind), ("Content-Length", str(len(body))),
                ("Cache-Control", "no-store"), ("X-Content-Type-Options", "nosniff"),
                ("Cross-Origin-Resource-Policy", "same-origin"), ("Referrer-Policy", "no-referrer"),
                ("X-Frame-Options", "DENY"),
            ):  # fmt: skip
                self.send_header(name, text)
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: object) -> None:
            pass

        def handle(self) -> None:
            try:
                super().handle()
            except OSError:  # the page was closed meanwhile
                self.close_connection = True

    return Handler


EVERY = 0.1
"""Seconds between two checks of the files: a save is seen after two checks."""


@dataclass(frozen=True)
class FollowedFile:
    """A file that is read again whenever it, or a library that it uses, changes.

    Attributes:
        file: path of the file.
        library_roots: further folders under which libraries may lie.
        roughness: whether rough surfaces have their relief.
    """

    file: str
    library_roots: tuple[str, ...] = ()
    roughness: bool = True

    @cached_property
    def _watch(self) -> Watch:
        """Watch over the file and its libraries."""
        return Watch(lambda: [self.file], EVERY)

    def read(self) -> Site:
        """Read the terrain as it is now.

        Raises:
            ReadError: the file cannot be read.
            DefinitionError: the file is no valid terrain.
            RequestError: parts and copies come to too many elements to be shown.
        """
        options = CheckOptions(warnings=False, library_roots=self.library_roots)
        checked = self._watch.look(self.file, options)
        if checked.terrain is None:  # which says why
            return read_site(self.file, self.library_roots, roughness=self.roughness)
        return site_of(checked, roughness=self.roughness)

    def wait(self) -> None:
        """Wait until the file has changed since it was read."""
        self._watch.wait()


def follow(
    state: LiveState, followed: FollowedFile, scene: Callable[[Site], PageScene],
    report: Callable[[TerratoolError | None], object],
) -> NoReturn:  # fmt: skip
    """Read a file whenever it changes, and have pages show it, until Ctrl-C.

    Args:
        state: state of the pages.
        followed: the file.
        scene: function that makes a scene of the file's site.
        report: called after each reading with the file's error, None for none.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed.
    """
    while True:
        problem: TerratoolError | None = None
        try:
            site = followed.read()
            state.publish(site, scene(site))
        except TerratoolError as error:
            problem = error
            state.publish_error(error)
        report(problem)
        followed.wait()
