"""The live page over its port: who is let in, what closes a connection, and that the robot notices nothing of it."""

from __future__ import annotations

import contextlib
import json
import os
import socket
import time
from collections.abc import Iterator
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus

from snr_sim import Node
from snr_sim.prelude.errors import LinkError
from snr_sim.web.access import POLICY, Access
from snr_sim.web.live import LiveLoopFactory
from snr_sim.web.messages import MAX_MESSAGE_BYTES
from tests.on_thread import wait_for
from tests.web.dive import DIVER, with_push
from tests.web.served import browser, get, goes_on, last_words, served

pytestmark = pytest.mark.slow
Served = tuple[Node, LiveLoopFactory]


@pytest.fixture
def server() -> Iterator[Served]:
    with served() as found:
        yield found


def inputs_of_page(node: Node) -> int:
    """Number of tasks of a machine's page that the node has executed."""
    seen = node.seen_tasks()
    names = {name for kind, rows in seen.items() if kind == "event" for name in rows}
    return len(names & {"diver.edit", "diver.set", "diver.pause", "diver.go", "halt"})


# -- what is served ---------------------------------------------------------------------------------------------------


def test_token_goes_from_the_address_to_a_cookie(server: Served) -> None:
    access = server[1].access
    status, headers, _ = get(access, f"/machine/diver/?token={access.token}")
    assert (status, headers["location"]) == (303, "/machine/diver/")
    assert headers["set-cookie"] == f"{access.cookie}={access.token}; Path=/; HttpOnly; SameSite=Strict"
    assert access.token not in headers["location"]


def test_first_page_leads_to_the_machine(server: Served) -> None:
    access = server[1].access
    status, headers, _ = get(access, "/", Cookie=f"{access.cookie}={access.token}")
    assert (status, headers["location"]) == (303, "/machine/diver/")


@pytest.mark.parametrize("path", ["/", "/machine/diver/", "/static/live.js", "/nowhere", "/?token=wrong"])
def test_every_answer_has_the_policy(path: str, server: Served) -> None:
    access = server[1].access
    for headers in (
        get(access, path, Cookie=f"{access.cookie}={access.token}")[1],
        get(access, path)[1],
    ):
        assert headers["content-security-policy"] == POLICY
        assert headers["referrer-policy"] == "no-referrer"
        assert headers["x-content-type-options"] == "nosniff"
        assert "server" not in headers


def test_static_files_stay_in_their_folder(server: Served) -> None:
    access = server[1].access
    for path in ("/static/../server.py", "/static/..%2fserver.py", "/static//etc/passwd", "/static/%2e%2e/server.py"):
        assert get(access, path, Cookie=f"{access.cookie}={access.token}")[0] == 404, path


def test_state_and_edits_go_through(server: Served) -> None:
    node, live = server
    with browser(live.access) as page:
        hello = page.receive()
        assert (hello["kind"], hello["text"]) == ("hello", DIVER)
        page.wait("state", lambda one: one["active"] == {"diver": "sinking"})
        page.send("edit", number=1, text=with_push(9), base_sha256=hello["sha256"])
        assert page.wait("edited")["ok"]
        assert page.wait("state", lambda one: one["number"] == 2)["variables"] == {"push": 9}
    assert node.get_data("diver.edited")["ok"]


def test_two_browsers_see_each_others_edits(server: Served) -> None:
    with browser(server[1].access) as one, browser(server[1].access) as other:
        sha256 = one.receive()["sha256"]
        other.receive()
        one.send("edit", number=1, text=with_push(9), base_sha256=sha256)
        assert one.wait("edited")["ok"]
        assert other.wait("program")["text"] == with_push(9)
        other.send("edit", number=1, text=with_push(7), base_sha256=sha256)
        answer = other.wait("edited")
        assert (answer["ok"], answer["is_stale"], answer["text"]) == (False, True, with_push(9))


def test_page_of_the_wrong_port_is_an_error() -> None:
    with served() as (_, live), pytest.raises(LinkError, match="Address already in use"):
        LiveLoopFactory(live.port).claim()


# -- who is let in ----------------------------------------------------------------------------------------------------


def test_foreign_origin_is_refused(server: Served) -> None:
    expect_403(server, origin="http://example.org")


def test_no_origin_is_refused(server: Served) -> None:
    expect_403(server, origin=None)


def test_origin_of_another_port_is_refused(server: Served) -> None:
    expect_403(server, origin=f"http://127.0.0.1:{server[1].port + 1}")


def test_null_origin_is_refused(server: Served) -> None:
    expect_403(server, origin="null")


def test_wrong_token_is_refused(server: Served) -> None:
    expect_403(server, cookie=f"{server[1].access.cookie}={'x' * 22}")


def test_no_token_is_refused(server: Served) -> None:
    expect_403(server, cookie="")


def test_token_of_another_run_is_refused(server: Served) -> None:
    expect_403(server, cookie=f"snr_1={server[1].access.token}")


@pytest.mark.parametrize("host", ["evil.example", "localhost"])
def test_wrong_host_is_refused(host: str, server: Served) -> None:
    """A name that an attacker lets point to this computer; its page's origin is that name, too."""
    access = server[1].access
    expect_403(server, host=f"{host}:{access.port}")
    expect_403(server, host=f"{host}:{access.port}", origin=f"http://{host}:{access.port}")
    status, _, text = get(access, "/", Cookie=f"{access.cookie}={access.token}", Host=f"{host}:{access.port}")
    assert status == 403
    assert text == f"This server is at {access.origin} only, under no other name.\n"


def expect_403(server: Served, **options: Any) -> None:
    node, live = server
    with pytest.raises(InvalidStatus) as error, browser(live.access, **options):
        pass
    assert error.value.response.status_code == 403
    assert inputs_of_page(node) == 0


def test_request_without_token_says_where_it_is(server: Served) -> None:
    status, _, text = get(server[1].access, "/machine/diver/")
    assert status == 403
    assert "Open the address that the program has printed" in text


def test_request_of_a_foreign_page_is_refused(server: Served) -> None:
    access = server[1].access
    cookie = f"{access.cookie}={access.token}"
    assert get(access, "/static/live.js", Cookie=cookie, Origin="http://example.org")[0] == 403
    assert get(access, f"/?token={access.token}", Origin="http://example.org")[0] == 403


def test_read_token_shows_and_changes_nothing(server: Served) -> None:
    node, live = server
    access = live.access
    _, headers, _ = get(access, f"/?read={access.read_token}")
    assert headers["set-cookie"].startswith(f"{access.cookie}={access.read_token};")
    with browser(access, access.read_token) as page:
        hello = page.receive()
        assert (hello["rights"], hello["is_editable"]) == ("look", False)
        page.wait("state")
        for message in (
            {"kind": "edit", "number": 1, "text": "", "base_sha256": hello["sha256"]},
            {"kind": "do", "what": "pause"},
            {"kind": "set", "path": "push", "value": 1},
        ):
            page.socket.send(json.dumps(message))
            assert "may only look" in page.wait("refused")["reason"]
    assert inputs_of_page(node) == 0


# -- what closes a connection -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("data", ["garbage", "{}", b"\x00\xff", '{"kind": "do", "what": "terminate"}', "[" * 10_000])
def test_garbage_closes_the_connection(data: str | bytes, server: Served) -> None:
    node, live = server
    with browser(live.access) as page:
        page.socket.send(data)
        assert "not a message" in last_words(page)
    goes_on(node)
    assert inputs_of_page(node) == 0


def test_message_that_is_too_large_closes_the_connection(server: Served) -> None:
    node, live = server
    with browser(live.access) as page:
        page.receive()
        with contextlib.suppress(ConnectionClosed):
            page.socket.send("x" * (MAX_MESSAGE_BYTES + 1))
        last_words(page)
        assert page.socket.close_code == 1009  # too big, RFC 6455
    goes_on(node)
    assert inputs_of_page(node) == 0


def test_more_than_50_edits_a_second_close_the_connection(server: Served) -> None:
    node, live = server
    with browser(live.access) as page:
        sha256 = page.receive()["sha256"]
        with contextlib.suppress(ConnectionClosed):
            for i in range(500):
                page.send("edit", number=i, text=with_push(i), base_sha256=sha256)
        assert last_words(page) in ("More than 50 changes a second.", "64 edits wait for the robot's program.")
    goes_on(node)
    assert node.get_data("diver.edited")["program"] == 2  # the others named a text that was not the present one


def test_flood_of_messages_closes_the_connection(server: Served) -> None:
    node, live = server
    with browser(live.access, live.access.read_token) as page:
        with contextlib.suppress(ConnectionClosed):
            for _ in range(20_000):
                page.socket.send('{"kind": "do", "what": "pause"}')
        last_words(page)
        assert page.socket.close_code in (1008, 1006)  # if bytes are left unread, a close is a reset for the client
    goes_on(node)
    assert inputs_of_page(node) == 0


def test_browser_that_reads_nothing_disturbs_no_other(server: Served) -> None:
    node, live = server
    access = live.access
    raw = socket.create_connection((access.host, access.port))
    raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    raw.sendall(
        f"GET /machine/diver/socket HTTP/1.1\r\nHost: {access.netloc}\r\nOrigin: {access.origin}\r\n"
        f"Cookie: {access.cookie}={access.token}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n".encode()
    )
    assert raw.recv(12) == b"HTTP/1.1 101"
    goes_on(node)
    with browser(access) as page:
        page.wait("state")
    raw.close()
    goes_on(node)


def test_browser_that_is_killed_changes_nothing(server: Served) -> None:
    node, live = server
    with browser(live.access) as page:
        page.wait("state")
        page.socket.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")  # a reset, no goodbye
        page.socket.socket.close()
    goes_on(node)
    with browser(live.access) as page:
        page.wait("state")


def test_page_that_fails_is_served_again(server: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    node, live = server
    with browser(live.access) as page:
        page.wait("state")
        count = []

        def fail(self: object, now_s: float) -> None:
            count.append(now_s)
            raise RuntimeError("planted")

        with monkeypatch.context() as patch:
            patch.setattr("snr_sim.web.session.MachinePage.tick", fail)
            wait_for(lambda: count)
    goes_on(node)

    def is_served() -> bool:
        try:
            with browser(live.access) as page:
                return bool(page.wait("state"))
        except (OSError, ConnectionClosed, InvalidStatus):
            return False

    wait_for(is_served)


def test_too_many_pages_are_refused(server: Served) -> None:
    node, live = server
    with contextlib.ExitStack() as stack:
        for _ in range(32):
            stack.enter_context(browser(live.access)).receive()
        with browser(live.access) as page:
            assert last_words(page) == "32 pages are open, the maximum: close one."
    goes_on(node)


def test_end_of_the_run_is_sent_and_does_not_wait() -> None:
    with contextlib.ExitStack() as stack:
        with served() as (node, live):
            page = stack.enter_context(browser(live.access))
            page.wait("state")
            for request in (b"GET / HTTP/1.1\r\n", b""):  # two that hang
                raw = stack.enter_context(contextlib.closing(socket.create_connection((live.host, live.port))))
                raw.sendall(request)
            begun_s = time.monotonic()
        assert time.monotonic() - begun_s < 5.0
        assert last_words(page) == "The run has ended: test."
    assert not [one for one in node.notes if "live" in one]


def test_half_a_request_holds_up_nothing(server: Served) -> None:
    node, live = server
    with contextlib.ExitStack() as stack:
        for _ in range(20):
            raw = stack.enter_context(contextlib.closing(socket.create_connection((live.host, live.port))))
            raw.sendall(b"GET / HTTP/1.1\r\nHost: ")
        with browser(live.access) as page:
            page.wait("state")
    goes_on(node)


@pytest.mark.parametrize("request_text", [b"", b"GET / HTTP/1.1\r\nHost: "])
def test_connections_without_token_keep_no_browser_out(server: Served, request_text: bytes) -> None:
    node, live = server
    before = len(os.listdir("/proc/self/fd"))
    with contextlib.ExitStack() as stack:
        for _ in range(300):
            raw = stack.enter_context(contextlib.closing(socket.create_connection((live.host, live.port))))
            raw.sendall(request_text)
        with browser(live.access) as page:
            page.wait("state")
            assert len(os.listdir("/proc/self/fd")) < before + 300 + 100  # 300 are the ends of this test
        assert get(live.access, f"/?token={live.access.token}")[0] == 303
    goes_on(node)


def test_access_is_new_for_each_run() -> None:
    one, other = Access("127.0.0.1", 1), Access("127.0.0.1", 1)
    assert len({one.token, one.read_token, other.token, other.read_token}) == 4
    assert all(len(token) == 22 for token in (one.token, one.read_token))  # 128 bits in base64
    assert one.token not in repr(one)
