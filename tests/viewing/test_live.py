"""The server of `terratool view --watch`: for this machine, and nothing but the page."""

from __future__ import annotations

import contextlib
import http.client
import json
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from terratool.definition.reader import check
from terratool.errors import DefinitionError, TerratoolError, WriteError
from terratool.text.source import Source
from terratool.viewing.live import MOST_CLIENTS, FollowedFile, LiveState, PageServer, follow
from terratool.viewing.places import Site, read_site, site_of
from terratool.viewing.scene import PageScene, scene_of
from tests.commands import YARD
from tests.viewing.scenes import SHED, read_scene

Answer = tuple[int, bytes, dict[str, str]]


@pytest.fixture
def yard(tmp_path: Path) -> Path:
    path = tmp_path / "yard.json"
    path.write_text(json.dumps(YARD), "utf-8")
    return path


@pytest.fixture
def served(yard: Path) -> Iterator[tuple[PageServer, LiveState]]:
    state = LiveState()
    site = read_site(str(yard))
    state.publish(site, scene_of(site))
    with PageServer("<p>the page</p>", state) as server:
        yield server, state


@pytest.fixture
def crowded(yard: Path) -> Iterator[tuple[PageServer, LiveState]]:
    """With room for four clients, and patience with none."""
    state = LiveState()
    site = read_site(str(yard))
    state.publish(site, scene_of(site))
    with PageServer("<p>the page</p>", state, most=4, patience=0.0) as server:
        yield server, state


def port_of(server: PageServer) -> int:
    return int(server.url.rstrip("/").rpartition(":")[2])


def connected(server: PageServer, text: str = "") -> socket.socket:
    """A client that has sent so much of a request."""
    client = socket.create_connection(("127.0.0.1", port_of(server)), timeout=10)
    client.sendall(text.replace("HOST", f"Host: 127.0.0.1:{port_of(server)}").encode())
    return client


def ask(server: PageServer, path: str, method: str = "GET", host: str = "") -> Answer:
    port = int(server.url.rstrip("/").rpartition(":")[2])
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    connection.request(method, path, headers={"Host": host} if host else {})
    found = connection.getresponse()
    body = found.read()
    connection.close()
    return found.status, body, dict(found.getheaders())


def test_it_answers_for_the_page_alone(served: tuple[PageServer, LiveState]) -> None:
    server, _ = served
    status, body, headers = ask(server, "/")
    assert (status, body) == (200, b"<p>the page</p>")
    assert headers["Cache-Control"] == "no-store"
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert "Access-Control-Allow-Origin" not in headers
    told, _ = read_scene(ask(server, "/scene")[1])
    assert told["bounds"] == [-5, -5, 5, 5]
    for path in ("/yard.json", "/../yard.json", "/%2e%2e/etc/passwd", "//etc/passwd", "/scene/x"):
        assert ask(server, path)[0] == 404, path
    for method in ("POST", "PUT", "DELETE", "HEAD", "OPTIONS"):
        assert ask(server, "/", method)[0] == 501, method


def test_other_names_of_this_machine_are_refused(served: tuple[PageServer, LiveState]) -> None:
    """A page of somebody else may have its name lead here."""
    server, _ = served
    port = server.url.rstrip("/").rpartition(":")[2]
    for host in ("evil.example", f"evil.example:{port}", "127.0.0.1:1", f"localhost:{port}.evil"):
        assert ask(server, "/state", host=host)[0] == 403, host
    for host in (f"127.0.0.1:{port}", f"localhost:{port}"):
        assert ask(server, "/state", host=host)[0] == 200, host


def test_it_listens_on_the_loopback_alone(served: tuple[PageServer, LiveState]) -> None:
    server, _ = served
    port = int(server.url.rstrip("/").rpartition(":")[2])
    listening = {
        line.split()[1].split(":")[0]
        for line in Path("/proc/net/tcp").read_text("ascii").splitlines()[1:]
        if int(line.split()[1].split(":")[1], 16) == port and line.split()[3] == "0A"
    }
    assert listening == {"0100007F"}


def test_values_are_those_of_a_query(served: tuple[PageServer, LiveState]) -> None:
    """Heights to the last bit; what lies outside or in the void has none."""
    server, state = served
    assert state.shown is not None
    terrain = state.shown.site.terrain
    for x, y in ((2.1, -3.3), (-4.4, -0.2), (3.75, 2.5), (0.0, 0.0)):
        answer = json.loads(ask(server, f"/values?x={x}&y={y}")[1])
        assert answer["z"] == terrain.height(x, y)
        assert answer["element"] == terrain.element(x, y)
        assert answer["surface"] == terrain.surface(x, y)
        assert answer["line"] == "yard.json:1"
        assert answer["picture"] == 1
    assert json.loads(ask(server, "/values?x=2.1&y=-3.3")[1])["slope"] == pytest.approx(45)
    for x, y in ((-2, 2), (99, 0)):
        assert json.loads(ask(server, f"/values?x={x}&y={y}")[1])["z"] is None
    for query in ("", "?x=1", "?x=1&y=nan", "?x=inf&y=1", "?x=a&y=1"):
        assert ask(server, f"/values{query}")[0] == 404, query


def test_values_below_a_height_are_those_of_the_top_there() -> None:
    """On a roof, and on the ground below it."""
    state = LiveState()
    site = site_of(check(Source("shed.json", json.dumps(SHED).encode())))
    state.publish(site, PageScene({}, {}))
    for below, z, element in ((None, 4, "/elemTree/children/0"), (3.9, 1, "/elemTree")):
        found = state.values(8.5, 2.5, below)
        assert found is not None and (found["z"], found["element"]) == (z, element)
    with PageServer("", state) as server:
        answer = json.loads(ask(server, "/values?x=8.5&y=2.5&below=3.9")[1])
        assert (answer["z"], answer["element"]) == (1, "/elemTree")
        assert ask(server, "/values?x=8.5&y=2.5&below=nan")[0] == 404


def test_news_are_told_at_once_and_findings_keep_the_picture(
    served: tuple[PageServer, LiveState], yard: Path
) -> None:
    server, state = served
    told: list[dict[str, object]] = []
    waiting = threading.Thread(
        target=lambda: told.append(json.loads(ask(server, "/state?after=1")[1]))
    )
    waiting.start()
    yard.write_text(json.dumps(YARD).replace('"ramp"', '"rump"', 1), "utf-8")
    with pytest.raises(DefinitionError) as caught:
        read_site(str(yard))
    state.publish_error(caught.value)
    waiting.join(10)
    [news] = told
    assert (news["version"], news["picture"]) == (2, 1)
    assert isinstance(news["findings"], list)
    assert {"code", "file", "line", "column", "message", "hint"} == set(news["findings"][0])
    assert news["findings"][0]["code"] == "TT201"
    assert ask(server, "/scene")[0] == 200
    assert json.loads(ask(server, "/state?after=nonsense")[1])["version"] == 2


def waiting(server: PageServer, state: LiveState, count: int) -> list[socket.socket]:
    """Clients that wait for news, once all of them do."""
    entered = threading.Semaphore(0)
    after = LiveState.after

    def entering(self: LiveState, version: int, wait: float = 20.0) -> dict[str, object]:
        entered.release()
        return after(self, version, wait)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(LiveState, "after", entering)
        text = f"GET /state?after={state.version} HTTP/1.1\r\nHOST\r\n\r\n"
        clients = [connected(server, text) for _ in range(count)]
        for _ in clients:
            assert entered.acquire(timeout=10)
    return clients


def test_more_clients_than_there_is_room_for_come_again(
    crowded: tuple[PageServer, LiveState],
) -> None:
    """Those that wait for news keep their places; all others are told at once, however many."""
    server, state = crowded
    clients = waiting(server, state, 4)
    for path in ("/", "/state?after=0", "/scene", "/values?x=0&y=0", "/nothing") * 10:
        status, body, headers = ask(server, path)
        assert status == 503
        assert (headers["Retry-After"], headers["Connection"]) == ("1", "close")
        assert body.startswith(b"There are too many pages.")
    assert threading.active_count() < 40
    state.publish_error(DefinitionError("It is broken."))
    for client in clients:
        assert client.recv(1 << 16).startswith(b"HTTP/1.1 200 OK")
        client.close()
    while ask(server, "/")[0] == 503:  # until the places are free
        pass
    assert ask(server, "/scene")[0] == 200


@pytest.mark.parametrize(
    "text",
    ["", "GE", "GET / HTTP/1.1\r\nHOST\r\n", "GET / HTTP/1.1\r\nHOST\r\n\r\n",
     "GET /scene HTTP/1.1\r\nHOST\r\n\r\n" * 3, "NONSENSE\r\n"],
)  # fmt: skip
def test_clients_that_keep_us_waiting_give_way(
    text: str, crowded: tuple[PageServer, LiveState]
) -> None:
    """Who sends no request, half of one, or takes no answer, starves nobody."""
    server, state = crowded
    assert state.shown is not None
    state.shown = state.shown._replace(scene=bytes(8 << 20))  # more than any buffer holds
    slow = [connected(server, text) for _ in range(40)]
    for _ in range(20):
        status, body, _ = ask(server, "/")
        assert (status, body) == (200, b"<p>the page</p>")
    for client in slow:
        client.close()


def test_patience(yard: Path) -> None:
    """A client that has just come keeps its place, and those who wait are told to come again."""
    with PageServer("<p>the page</p>", LiveState(), most=2, patience=1e9) as server:
        slow = [connected(server) for _ in range(2)]
        assert ask(server, "/")[0] == 503
        slow[0].sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port_of(server)}\r\n\r\n".encode())
        assert slow[0].recv(1 << 16).startswith(b"HTTP/1.1 200 OK")
        assert ask(server, "/")[0] == 503  # the connection stays for another request
        for client in slow:
            client.close()
        while ask(server, "/")[0] == 503:
            pass


def test_as_many_as_come_at_once_may_wait_at_the_door() -> None:
    """Whom the system turns away knocks again after a second, and then after two."""
    with PageServer("<p>the page</p>", LiveState()) as server:
        port, address = port_of(server), ("127.0.0.1", port_of(server))
    server = PageServer("<p>the page</p>", LiveState(), port)  # nobody opens yet
    clients = [socket.create_connection(address, timeout=2) for _ in range(100)]
    with server:
        answers = []
        for client in clients:
            with contextlib.suppress(OSError):  # of those that were refused some gave way
                client.sendall(f"GET / HTTP/1.0\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
                answers.append(client.recv(1 << 16)[9:12])
            client.close()
    assert answers.count(b"200") >= MOST_CLIENTS
    assert set(answers) <= {b"200", b"503", b""}


def test_a_port_that_is_taken_is_said() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(WriteError, match=f"Port {port} cannot be used"):
            PageServer("", LiveState(), port)


class _DoneError(Exception):
    """Enough was followed."""


def test_a_file_is_followed_through_errors_and_libraries(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each change makes one picture or one complaint, that of a library, too."""
    from terratool.definition import watch

    kit, path = tmp_path / "kit.json", tmp_path / "site.json"
    kit.write_text('{"elemTypes": {"b": {"x": [1]}}}', "utf-8")
    good = '{"use": ["kit.json"], "size": 10, "elemTree": {"type": "b", "vScale": 3}}'
    path.write_text(good, "utf-8")
    steps = iter(
        [
            lambda: kit.write_text('{"elemTypes": {"b": {"x": [1.25]}}}', "utf-8"),
            lambda: path.write_text(good[:-1], "utf-8"),
            lambda: path.unlink(),
            lambda: path.write_text(good.replace("3", "4"), "utf-8"),
        ]
    )
    calm = iter(range(100))

    def pause(seconds: float) -> None:
        if next(calm) % 2:  # a change counts when it has lasted for one pause
            return
        step = next(steps, None)
        if step is None:
            raise _DoneError
        step()

    monkeypatch.setattr(watch, "pause", pause)
    state, seen = LiveState(), []

    def told(problem: TerratoolError | None) -> None:
        high = None if state.shown is None else read_scene(state.shown.scene)[0]["heights"][1]
        seen.append((state.picture, high, type(problem).__name__ if problem else ""))

    def scene(site: Site) -> PageScene:
        return scene_of(site)

    with pytest.raises(_DoneError):
        follow(state, FollowedFile(str(path)), scene, told)
    assert seen == [
        (1, 3.0, ""), (2, 3.75, ""), (2, 3.75, "DefinitionError"), (2, 3.75, "ReadError"),
        (3, 5.0, ""),
    ]  # fmt: skip
    assert state.findings == []
