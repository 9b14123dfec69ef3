"""`rubhpc view`: what it gives, to whom, and how it ends."""

from __future__ import annotations

import http.client
import signal
import socket
import struct
import threading
import zlib

import pytest
from running import start

from postproc.report.server import Library, Server
from postproc.store.open import open_store
from rubhpc.errors import InputError


@pytest.fixture(scope="module")
def server(synthetic_path):
    with Server(Library(lambda: open_store(synthetic_path))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server
        server.shutdown()


def ask(server: Server, path: str, method: str = "GET", **headers: str) -> tuple[int, bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=120)
    connection.putrequest(method, path, skip_host="Host" in headers)
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.endheaders()
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, body


def test_the_page_carries_no_cases(server):
    status, body = ask(server, "/")
    assert status == 200
    assert b'"isServed":true' in body
    assert b'id="records">{}<' in body


def test_measures_and_cases_come_when_asked_for(server):
    assert len(zlib.decompress(ask(server, "/values/status")[1])) == 4 * 60
    status, body = ask(server, "/record/59")
    assert status == 200
    assert b'"waves"' in zlib.decompress(body)


@pytest.mark.parametrize(
    "path",
    [
        "/record/0",  # diverged: no record
        "/record/60",
        "/record/-1",
        "/record/1e3",
        "/record/" + "9" * 30,
        "/record/%C2%B2",
        "/record/",
        "/values/",
        "/values/vertical",
        "/values/../../etc/passwd",
        "/../../../../etc/passwd",
        "/%2e%2e/%2e%2e/etc/passwd",
        "//etc/passwd",
        "/.rubhpc/manifest.json",
        "/zarr.json",
        "/assets/page.js",
    ],
)
def test_nothing_else_is_to_be_had(server, path):
    status, body = ask(server, path)
    assert status == 404
    assert body == b"nothing here\n"


def test_only_this_machine_is_answered(server):
    assert server.server_address[0] == "127.0.0.1"
    assert ask(server, "/", Host="evil.example")[0] == 403
    assert ask(server, "/", Host=f"localhost:{server.port}")[0] == 200


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},  # another port of this machine
        {"Host": "127.0.0.1"},
    ],
)
def test_other_sites_are_refused(server, headers):
    assert ask(server, "/record/59", **headers)[0] == 403


def test_a_browser_is_answered_that_shows_the_page_itself(server):
    own = {"Origin": f"http://127.0.0.1:{server.port}", "Sec-Fetch-Site": "same-origin"}
    assert ask(server, "/values/status", **own)[0] == 200


def test_the_page_is_in_no_frame(server):
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=120)
    connection.request("HEAD", "/values/status")
    assert "frame-ancestors 'none'" in connection.getresponse().headers["Content-Security-Policy"]
    connection.close()


def test_silent_connections_hold_up_nobody_and_are_closed(server, monkeypatch):
    monkeypatch.setattr(server.RequestHandlerClass, "timeout", 0.2)
    silent = [socket.create_connection(("127.0.0.1", server.port), timeout=60) for _ in range(20)]
    silent[0].sendall(b"GET / HTTP/1.1\r\nHost: 127")
    assert ask(server, "/values/status")[0] == 200
    assert all(connection.recv(1) == b"" for connection in silent)


def test_a_page_asked_for_again_at_once_is_not_made_again(synthetic_path):
    opened = []
    library = Library(lambda: (opened.append(1), open_store(synthetic_path))[1])
    assert library.page() == library.page()
    assert len(opened) == 2  # for the library itself, and for the page


def test_nothing_can_be_sent_to_it(server):
    assert ask(server, "/", method="POST")[0] == 501
    status, body = ask(server, "/", method="HEAD")
    assert (status, body) == (200, b"")


def test_a_port_in_use_is_said(server, synthetic_path):
    with pytest.raises(InputError, match=f"--port: {server.port} is not available"):
        Server(Library(lambda: open_store(synthetic_path)), server.port)


def test_a_connection_that_breaks_is_passed_over(server, capfd):
    with socket.create_connection(("127.0.0.1", server.port), timeout=60) as connection:
        connection.sendall(b"GET / HTTP/1.1\r\n")
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # ends by a reset
    assert ask(server, "/")[0] == 200
    assert capfd.readouterr().err == ""


def test_the_command_says_where_it_is_and_ends_on_interrupt(synthetic_path):
    process = start("view", synthetic_path)
    assert process.stdout is not None
    line = process.stdout.readline()
    port = int(line.split("http://127.0.0.1:")[1].split("/")[0])
    with socket.create_connection(("127.0.0.1", port), timeout=60):
        process.send_signal(signal.SIGINT)
        said, errors = process.communicate(timeout=60)
    assert process.returncode == 0, errors
    assert errors == ""
    assert said == ""
