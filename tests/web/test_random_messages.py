"""Many messages over the live page's port, right ones and damaged ones: robot and page continue, and nothing grows."""

from __future__ import annotations

import gc
import json
import random
import tracemalloc
from typing import Any

import msgspec
import pytest

from snr_sim.web import live_machine, session, timeline
from snr_sim.web.live import LiveLoopFactory
from snr_sim.web.messages import decode_from_page
from tests.web.dive import with_push
from tests.web.served import Client, browser, goes_on, last_words, served

pytestmark = pytest.mark.slow


def send_random(live: LiveLoopFactory, count: int) -> None:
    """Send random messages; after an invalid one, the server is to close the connection."""
    rng, sent = random.Random(1), 0
    while sent < count:
        with browser(live.access) as page:
            sha256 = page.receive()["sha256"]
            is_message = True
            while sent < count and is_message:
                data = random_message(rng, sha256)
                sent += 1
                try:
                    decode_from_page(data)
                except (msgspec.DecodeError, UnicodeDecodeError):
                    is_message = False
                page.socket.send(data)
                if is_message and sent % 20 == 0:  # reads what has come; who does not is hung up on
                    page.wait("state")
            if not is_message:
                assert "not a message" in last_words(page)


def random_message(rng: random.Random, sha256: str) -> str | bytes:
    kinds: list[dict[str, Any]] = [
        {"kind": "edit", "number": rng.randrange(9), "text": with_push(rng.randrange(9)), "base_sha256": sha256},
        {"kind": "set", "path": rng.choice(["push", "x"]), "value": rng.choice([1, 2.5, "a", None, True])},
        {"kind": "do", "what": rng.choice(["pause", "go", "step", "undo"])},
        {"kind": "show", "t_s": rng.random()},
        {"kind": "give", "signal": rng.choice(["halt", "y"])},
        {"kind": "why", "machine": "", "transition": "", "from_s": 0.0, "until_s": rng.random()},
    ]
    text = json.dumps(rng.choice(kinds))
    if rng.random() < 0.95:
        return text
    at = rng.randrange(len(text))
    damaged = text[:at] + rng.choice(["", "{", '"', "9", "\u2028", "null"]) + text[at + rng.randrange(3) :]
    return damaged if rng.random() < 0.8 else damaged.encode() + bytes([rng.randrange(256)])


def check_random(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    for limit in ("MESSAGES_PER_S", "MESSAGES_AT_ONCE", "CHANGES_PER_S", "CHANGES_AT_ONCE"):
        monkeypatch.setattr(session, limit, 1e9)  # it is the messages that are tried here
    monkeypatch.setattr(live_machine, "MAX_UNANSWERED", count)
    with served() as (node, live):
        send_random(live, count)
        goes_on(node)
        with browser(live.access) as page:
            hello = page.receive()
            page.send("do", what="go")
            page.send("edit", number=1, text=with_push(50), base_sha256=hello["sha256"])
            assert page.wait("edited")["ok"]
            assert page.wait("state", lambda one: one["variables"] == {"push": 50})


def test_2000_random_messages_leave_robot_and_page_alive(monkeypatch: pytest.MonkeyPatch) -> None:
    check_random(2_000, monkeypatch)


@pytest.mark.nightly(minutes=4)
def test_100_000_random_messages_leave_robot_and_page_alive(monkeypatch: pytest.MonkeyPatch) -> None:
    check_random(100_000, monkeypatch)


def edit_often(page: Client, sha256: str, count: int) -> str:
    """Edit, by 97 texts in turn: 4096 compiled blocks are kept, which is not what is looked for here."""
    for i in range(count):
        page.send("edit", number=i, text=with_push(i % 97), base_sha256=sha256)
        answer = page.wait("edited")
        assert answer["ok"]
        sha256 = answer["sha256"]
        page.received.clear()
    gc.collect()
    return sha256


@pytest.mark.nightly(minutes=3)
def test_2000_edits_leave_no_growth(monkeypatch: pytest.MonkeyPatch) -> None:
    """As many as a person makes in a quarter of an hour."""
    monkeypatch.setattr(session, "CHANGES_PER_S", 1e9)
    monkeypatch.setattr(session, "CHANGES_AT_ONCE", 1e9)
    with served() as (node, live), browser(live.access) as page:
        sha256 = edit_often(page, page.receive()["sha256"], timeline.MAX_PROGRAMS + 300)
        tracemalloc.start()
        try:
            sha256 = edit_often(page, sha256, 500)
            before = tracemalloc.get_traced_memory()[0]
            edit_often(page, sha256, 1000)
            growth = tracemalloc.get_traced_memory()[0] - before
            assert growth < 200_000, growth
        finally:
            tracemalloc.stop()
        goes_on(node)
