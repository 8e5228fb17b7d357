"""Options, keys and messages of links."""

from __future__ import annotations

import logging
import math
import re
import time
from collections.abc import Callable
from typing import Any

import pytest

from snr_sim import Config, Faults, MemoryLink, Node, Page, SimRunner, SocketsPair, Task
from snr_sim.core.clocks import WallClock
from snr_sim.core.config import AnyFactory
from snr_sim.links.link import KEPT_OUT_REMEMBERED
from snr_sim.links.options import LinkOptions
from snr_sim.prelude.errors import ComponentFailed, ConfigError, ParameterError
from snr_sim.testing.parts import PartFactory, TickerFactory

from .conftest import simulate

HERE = "127.0.0.1"
LIMIT_S = 90.0


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"timeout_s": 0.1}, r"timeout_s=0\.1 and keep_alive_s=0\.5(.|\n)*timeout_s=1 or more"),
        ({"timeout_s": float("nan")}, "timeout_s=nan"),
        ({"timeout_s": "3"}, "timeout_s='3'"),
        ({"keep_alive_s": 0}, "keep_alive_s=0"),
        ({"keep_alive_s": -1.0}, r"keep_alive_s=-1\.0"),
        ({"queue_pages": 0}, "queue_pages=0"),
        ({"queue_pages": 1.5}, r"queue_pages=1\.5"),
        ({"max_frame_bytes": 0}, "max_frame_bytes=0"),
        ({"max_frame_bytes": 1 << 32}, "max_frame_bytes=4294967296"),
        ({"policy": "drop"}, "policy='drop'(.|\n)*drop_oldest, refuse"),
        ({"faults": 0.1}, r"faults=0\.1"),
    ],
)
def test_an_option_that_makes_no_sense_is_refused_where_it_is_given(options: dict[str, Any], said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        LinkOptions("t", **options)
    with pytest.raises(ParameterError, match=said):
        SocketsPair((HERE, 0), **options)


def test_a_timeout_of_two_keep_alives_is_enough() -> None:
    assert LinkOptions("t", timeout_s=1.0).timeout_s == 1.0


def test_tls_is_certificates_and_not_a_switch() -> None:
    with pytest.raises(ConfigError, match=r"tls=True(.|\n)*Tls\(certificate="):
        SocketsPair((HERE, 0), tls=True)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("localhost", 9120), "'localhost' and 9120(.|\n)*in parentheses"),
        (("localhost",), "address is 'localhost'"),
        ((("localhost", 91200),), "its port is 91200(.|\n)*0 to 65535"),
        ((("localhost", "9120"),), "its port is '9120'(.|\n)*whole number"),
        ((("localhost", 9120.0),), r"its port is 9120\.0"),
        ((("", 9120),), "its host is ''"),
        ((9120,), "address is 9120"),
    ],
)
def test_an_address_that_is_none_is_refused_with_what_is_wrong_in_it(arguments: Any, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        SocketsPair(*arguments)


@pytest.mark.parametrize(
    ("keys", "said"),
    [(3, "keys are 3"), ([3], "hold 3, which"), (["3", ""], "hold '', which"), ([[]], r"hold \[\], which")],
)
def test_what_is_no_key_is_shown_as_it_stands(keys: Any, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        SocketsPair((HERE, 0)).server(keys)


def test_a_role_that_lists_an_end_without_calling_it_is_told_to_call_it() -> None:
    listed: Any = SocketsPair((HERE, 0)).server
    with pytest.raises(ConfigError, match=r"lists SocketsPair\.server(.|\n)*call it: .*\.server\(\.\.\.\)"):
        Node("robot", Config(factories={"robot": [listed]}))


def test_a_key_that_nobody_stores_is_noted_with_the_nearest_name() -> None:
    tether = SocketsPair((HERE, 1), name="tether")
    depths = TickerFactory(lambda loop: loop.store_data("depth", 1.5), rate_hz=10)
    runner = simulate({"robot": [depths, tether.server(["dept", "depth"])], "topside": [tether.client()]}, until_s=1.0)
    (note,) = [note for note in runner.nodes["robot"].notes if "link_tether" in note]
    assert note.startswith("'link_tether' waits for store_page 'dept', which nobody stored; did you mean 'depth'?")
    assert not any("link_tether" in note for note in runner.nodes["topside"].notes)


def test_a_kept_out_key_that_no_terminal_shows_stands_in_no_note() -> None:
    tether = SocketsPair((HERE, 1), name="tether")
    sends = TickerFactory(lambda loop: (loop.store_data("d\x1b[2J", 1), loop.store_data("heading", 1)), rate_hz=10)
    roles = {"robot": [sends, tether.server(["d\x1b[2J", "heading"])], "topside": [tether.client(accept=["depth"])]}
    runner = simulate(roles, until_s=1.0)
    (note,) = (note for note in runner.nodes["topside"].notes if "link_tether" in note)
    assert "heading" in note
    assert note.isprintable()


@pytest.mark.parametrize(("accept", "has_note"), [("dept", True), ("depth", False), ("key_1", False)])
def test_an_accepted_key_that_never_comes_is_noted_with_those_that_were_kept_out(accept: str, has_note: bool) -> None:
    def store(loop: Any) -> None:
        loop.store_data("depth", 1.5)
        for number in range(50):
            loop.store_data(f"key_{number}", number)

    tether = SocketsPair((HERE, 1), name="tether")
    keys = ["depth", *(f"key_{number}" for number in range(50))]
    roles = {
        "robot": [TickerFactory(store, rate_hz=10), tether.server(keys)],
        "topside": [tether.client(accept=[accept])],
    }
    runner = simulate(roles, until_s=1.0)
    link = runner.nodes["topside"].components["link_tether"]
    notes = [note for note in runner.nodes["topside"].notes if "link_tether" in note]
    assert len(link._kept_out) == KEPT_OUT_REMEMBERED  # type: ignore[attr-defined]
    assert len(notes) == has_note
    said = "'link_tether' accepts 'dept', of which no page came; did you mean 'depth'? Kept out were: "
    assert all(note.startswith(said) for note in notes)


def store_photo(size: int) -> AnyFactory:
    def take(part: Any) -> None:
        part.schedule(part.store_data_task("photo", "x" * size if size else {"camera": object()}))

    return PartFactory(begin=take, name="camera")


@pytest.mark.parametrize(("size", "said"), [(1 << 21, "more than a frame"), (0, "object")])
def test_a_page_that_cannot_be_sent_is_blamed_on_the_line_that_stored_it(size: int, said: str) -> None:
    tether = SocketsPair((HERE, 1), name="tether")
    runner = SimRunner(Config(factories={"robot": [store_photo(size), tether.server("photo")]}), until_s=1.0)
    with pytest.raises(ComponentFailed) as raised:
        runner.run()
    first, second = str(raised.value).splitlines()[:2]
    assert re.search(r"test_link\.py, line \d+: part\.schedule\(part\.store_data_task\(.photo.", first)
    assert "'link_tether' cannot send page 'photo': " in second
    assert "take() of component 'camera'" in str(raised.value)
    assert said in str(raised.value)


def test_foreign_page_beyond_the_next_links_frame_is_dropped_told_once_and_ends_no_node(
    caplog: pytest.LogCaptureFixture,
) -> None:
    wide = SocketsPair((HERE, 1), name="wide")
    narrow = SocketsPair((HERE, 2), name="narrow", max_frame_bytes=1000)
    photos = TickerFactory(lambda loop: loop.store_data("photo", "x" * 2000), rate_hz=10.0, name="camera")
    depths = TickerFactory(lambda loop: loop.store_data("depth", 1.0), rate_hz=10.0, name="gauge")
    factories: dict[str, list[AnyFactory]] = {
        "robot": [photos, depths, wide.client(["photo", "depth"])],
        "relay": [wide.server(), narrow.server(["photo", "depth"])],
        "topside": [narrow.client()],
    }
    runner = SimRunner(Config(factories=factories), until_s=2.05)
    with caplog.at_level(logging.WARNING):
        runner.run()
    assert runner.nodes["topside"].get_data("depth") == 1.0
    link = runner.nodes["relay"].components["link_narrow"]
    assert link.sent == runner.nodes["topside"].components["link_narrow"].received > 10  # type: ignore[attr-defined]
    assert link.dropped > 10  # type: ignore[attr-defined]
    (told,) = [message for message in caplog.messages if "cannot send page 'photo'" in message]
    assert "by node 'robot_node'" in told


def test_a_page_that_cannot_cross_memory_is_blamed_on_the_line_that_stored_it() -> None:
    config = Config(factories={"robot": [store_photo(0)], "topside": []})
    with pytest.raises(ComponentFailed, match=r"(?s)test_link\.py, line .*link from 'robot' to 'topside' cannot send"):
        SimRunner(config, links=[MemoryLink(["photo"], "robot", "topside")], until_s=1.0).run()


def test_foreign_page_that_cannot_cross_memory_is_dropped_told_once_and_ends_no_node(
    caplog: pytest.LogCaptureFixture,
) -> None:
    def pass_on(loop: Any) -> None:
        loop.parent.enter(Task.store_page(Page("count", 2**70, "other_node", 0.0)), "elsewhere")
        loop.store_data("depth", 1.0)

    relay = MemoryLink(["count", "depth"], "relay", "topside")
    runner = SimRunner(
        Config(factories={"relay": [TickerFactory(pass_on, rate_hz=10.0)], "topside": []}), links=[relay], until_s=1.05
    )
    with caplog.at_level(logging.WARNING):
        runner.run()
    (way,) = relay.ways
    assert way.sent == way.delivered == way.dropped > 5
    (told,) = [message for message in caplog.messages if "cannot send page 'count'" in message]
    assert "by node 'other_node'" in told


@pytest.mark.slow
def test_pages_that_faults_still_delay_count_as_dropped_when_the_session_ends(
    start: Callable[..., Any], raw: Callable[..., Any]
) -> None:
    pair = SocketsPair((HERE, 0), name="t", faults=Faults(latency_s=60.0))
    robot = start("robot", [pair.server("depth")], down="t")
    far = raw(pair.port)
    robot.until_link("t")
    robot.store("depth", *range(7))
    robot.until_stored("depth", 7)
    far.reset()
    state = robot.until_link("t", up=False)
    assert (state["sent"], state["dropped"]) == (0, 7)


@pytest.mark.slow
def test_the_log_names_the_link_that_is_up_or_down(start: Callable[..., Any], caplog: pytest.LogCaptureFixture) -> None:
    pair = SocketsPair((HERE, 0), name="tether")
    with caplog.at_level("INFO"):
        robot = start("robot", [pair.server()], down="tether")
        topside = start("topside", [pair.client()])
        robot.until_link("tether")
        topside.end()
        robot.until_link("tether", up=False)
    said = [record.getMessage() for record in caplog.records]
    assert "link_tether is down: nobody has connected yet." in said
    assert "link_tether is up: topside_node" in said


@pytest.mark.slow
def test_a_page_of_a_node_whose_clock_shows_another_time_is_as_old_as_it_is(start: Callable[..., Any]) -> None:
    pair = SocketsPair((HERE, 0), name="tether")
    robot = start("robot", [pair.server()], down="tether")
    topside = start("topside", [pair.client("controls")], clock=WallClock(time.monotonic() - 5000.0))
    begun_s = robot.node.clock.now_s()
    topside.store("controls", 1)
    robot.until_stored("controls")
    robot.until(lambda: math.isfinite(robot.node.get_age_s("controls")), "the first report of who is there")
    assert robot.node.get_page("controls").created_at_s > 5000.0
    age_s = robot.node.get_age_s("controls")
    assert -LIMIT_S < age_s <= robot.node.clock.now_s() - begun_s


@pytest.mark.slow
@pytest.mark.parametrize("key", ["link_tether", "reload", "add_component"])
def test_what_a_node_tells_of_itself_no_far_end_can_overwrite(start: Callable[..., Any], key: str) -> None:
    pair = SocketsPair((HERE, 0), name="tether")
    robot = start("robot", [pair.server()], down="tether")
    intruder = start("intruder", [SocketsPair((HERE, pair.port), name="other").client([key, "end"])], up="other")
    intruder.store(key, {"up": True, "peers": 5})
    intruder.store("end", 1)
    robot.until_stored("end")
    assert {"up": True, "peers": 5} not in robot.stored[key]
    assert robot.node.components["link_tether"].unwanted == 1


@pytest.mark.slow
def test_what_a_far_end_tells_of_itself_comes_in_if_it_is_asked_for(start: Callable[..., Any]) -> None:
    pair = SocketsPair((HERE, 0), name="tether")
    topside = start("topside", [pair.server(accept=["reload"])], down="tether")
    robot = start("robot", [pair.client("reload")])
    robot.store("reload", {"ok": True})
    assert topside.until_stored("reload") == [{"ok": True}]
