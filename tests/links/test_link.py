"""Options, keys and messages of links."""

from __future__ import annotations

import logging
import math
import re
import time
from collections.abc import Callable
from typing import Any

import pytest

from snr_sim import Config, LinkFaults, MemoryLink, Node, Page, SimRunner, SocketsPair, Task, ZenohNet
from snr_sim.core.clocks import WallClock
from snr_sim.core.config import AnyFactory
from snr_sim.links.link import MAX_REJECTED_KEYS, Link
from snr_sim.links.options import LinkOptions
from snr_sim.prelude.errors import ComponentFailedError, ConfigError, ParameterError
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

from .conftest import simulate

HERE = "127.0.0.1"
LIMIT_S = 90.0


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"timeout_s": 0.1}, r"timeout_s=0\.1 is too short for keep_alive_s=0\.5(.|\n)*timeout_s=1 or more"),
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
def test_invalid_option_raises_parameter_error(options: dict[str, Any], expected: str) -> None:
    with pytest.raises(ParameterError, match=expected):
        LinkOptions("t", **options)
    with pytest.raises(ParameterError, match=expected):
        SocketsPair((HERE, 0), **options)


def test_timeout_of_two_keep_alives_is_accepted() -> None:
    assert LinkOptions("t", timeout_s=1.0).timeout_s == 1.0


def test_boolean_tls_raises_config_error() -> None:
    with pytest.raises(ConfigError, match=r"tls=True(.|\n)*Tls\(certificate="):
        SocketsPair((HERE, 0), tls=True)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("localhost", 9120), "'localhost' and 9120(.|\n)*in parentheses"),
        (("localhost",), "'localhost' is not the address of a link"),
        ((("localhost", 91200),), "its port cannot be 91200(.|\n)*0 to 65535"),
        ((("localhost", "9120"),), "its port cannot be '9120'(.|\n)*integer"),
        ((("localhost", 9120.0),), r"its port cannot be 9120\.0"),
        ((("", 9120),), "its host cannot be ''"),
        ((9120,), "9120 is not the address of a link"),
    ],
)
def test_invalid_address_raises_config_error_with_the_wrong_part(arguments: Any, expected: str) -> None:
    with pytest.raises(ConfigError, match=expected):
        SocketsPair(*arguments)


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        (3, "keys are 3"),
        ([3], "3 is not a valid key"),
        (["3", ""], "'' is not a valid key"),
        ([[]], r"\[\] is not a valid key"),
    ],
)
def test_invalid_key_raises_config_error_with_the_key(keys: Any, expected: str) -> None:
    with pytest.raises(ConfigError, match=expected):
        SocketsPair((HERE, 0)).server(keys)


def test_uncalled_end_in_a_role_raises_config_error_with_fix() -> None:
    listed: Any = SocketsPair((HERE, 0)).server
    with pytest.raises(ConfigError, match=r"lists SocketsPair\.server(.|\n)*call it: .*\.server\(\.\.\.\)"):
        Node("robot", Config(factories={"robot": [listed]}))


def test_never_stored_key_is_noted_with_a_suggestion() -> None:
    tether = SocketsPair((HERE, 1), name="tether")
    depths = FunctionLoopFactory(lambda loop: loop.store_data("depth", 1.5), rate_hz=10)
    runner = simulate({"robot": [depths, tether.server(["dept", "depth"])], "topside": [tether.client()]}, until_s=1.0)
    (note,) = [note for note in runner.nodes["robot"].notes if "link_tether" in note]
    assert note.startswith("'link_tether' sends 'dept', but no page with this key was stored; did you mean 'depth'?")
    assert not any("link_tether" in note for note in runner.nodes["topside"].notes)


def test_unprintable_rejected_key_is_not_noted() -> None:
    tether = SocketsPair((HERE, 1), name="tether")
    sends = FunctionLoopFactory(
        lambda loop: (loop.store_data("d\x1b[2J", 1), loop.store_data("heading", 1)), rate_hz=10
    )
    roles = {"robot": [sends, tether.server(["d\x1b[2J", "heading"])], "topside": [tether.client(accept=["depth"])]}
    runner = simulate(roles, until_s=1.0)
    (note,) = (note for note in runner.nodes["topside"].notes if "link_tether" in note)
    assert "heading" in note
    assert note.isprintable()


@pytest.mark.parametrize(("accept", "has_note"), [("dept", True), ("depth", False), ("key_1", False)])
def test_never_received_key_is_noted_with_rejected_keys(accept: str, has_note: bool) -> None:
    def store(loop: Any) -> None:
        loop.store_data("depth", 1.5)
        for number in range(50):
            loop.store_data(f"key_{number}", number)

    tether = SocketsPair((HERE, 1), name="tether")
    keys = ["depth", *(f"key_{number}" for number in range(50))]
    roles = {
        "robot": [FunctionLoopFactory(store, rate_hz=10), tether.server(keys)],
        "topside": [tether.client(accept=[accept])],
    }
    runner = simulate(roles, until_s=1.0)
    link = runner.nodes["topside"].components["link_tether"]
    notes = [note for note in runner.nodes["topside"].notes if "link_tether" in note]
    assert len(link._rejected_keys) == MAX_REJECTED_KEYS  # type: ignore[attr-defined]
    assert len(notes) == has_note
    expected = "'link_tether' accepts 'dept', of which no page came; did you mean 'depth'? Kept out were: "
    assert all(note.startswith(expected) for note in notes)


def store_photo(size: int) -> AnyFactory:
    def take(part: Any) -> None:
        part.schedule(part.store_data_task("photo", "x" * size if size else {"camera": object()}))

    return FunctionEndpointFactory(begin=take, name="camera")


@pytest.mark.parametrize(("size", "expected"), [(1 << 21, "more than a frame"), (0, "object")])
def test_unsendable_page_raises_error_with_the_line_that_stored_it(size: int, expected: str) -> None:
    tether = SocketsPair((HERE, 1), name="tether")
    runner = SimRunner(Config(factories={"robot": [store_photo(size), tether.server("photo")]}), until_s=1.0)
    with pytest.raises(ComponentFailedError) as raised:
        runner.run()
    first, second = str(raised.value).splitlines()[:2]
    assert re.search(r"test_link\.py, line \d+: part\.schedule\(part\.store_data_task\(.photo.", first)
    assert "'link_tether' cannot send page 'photo': " in second
    assert "take() of component 'camera'" in str(raised.value)
    assert expected in str(raised.value)


def test_foreign_page_beyond_the_frame_limit_is_dropped_and_logged_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    wide = SocketsPair((HERE, 1), name="wide")
    narrow = SocketsPair((HERE, 2), name="narrow", max_frame_bytes=1000)
    photos = FunctionLoopFactory(lambda loop: loop.store_data("photo", "x" * 2000), rate_hz=10.0, name="camera")
    depths = FunctionLoopFactory(lambda loop: loop.store_data("depth", 1.0), rate_hz=10.0, name="gauge")
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
    (warning,) = [message for message in caplog.messages if "cannot send page 'photo'" in message]
    assert "by node 'robot_node'" in warning


def test_unserialisable_page_raises_error_with_the_line_that_stored_it() -> None:
    config = Config(factories={"robot": [store_photo(0)], "topside": []})
    with pytest.raises(
        ComponentFailedError, match=r"(?s)test_link\.py, line .*link from 'robot' to 'topside' cannot send"
    ):
        SimRunner(config, links=[MemoryLink(["photo"], "robot", "topside")], until_s=1.0).run()


def test_foreign_unserialisable_page_is_dropped_and_logged_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    def pass_on(loop: Any) -> None:
        loop.parent.enqueue_input(Task.store_page(Page("count", 2**70, "other_node", 0.0)), "elsewhere")
        loop.store_data("depth", 1.0)

    relay = MemoryLink(["count", "depth"], "relay", "topside")
    runner = SimRunner(
        Config(factories={"relay": [FunctionLoopFactory(pass_on, rate_hz=10.0)], "topside": []}),
        links=[relay],
        until_s=1.05,
    )
    with caplog.at_level(logging.WARNING):
        runner.run()
    (direction,) = relay.directions
    assert direction.sent == direction.delivered == direction.dropped > 5
    (warning,) = [message for message in caplog.messages if "cannot send page 'count'" in message]
    assert "by node 'other_node'" in warning


@pytest.mark.slow
def test_pages_delayed_by_faults_count_as_dropped_at_session_end(
    start: Callable[..., Any], raw: Callable[..., Any]
) -> None:
    pair = SocketsPair((HERE, 0), name="t", faults=LinkFaults(latency_s=60.0))
    robot = start("robot", [pair.server("depth")], down="t")
    far = raw(pair.port)
    robot.until_link("t")
    robot.store("depth", *range(7))
    robot.until_stored("depth", 7)
    far.reset()
    state = robot.until_link("t", up=False)
    assert (state["sent"], state["dropped"]) == (0, 7)


@pytest.mark.slow
def test_link_logs_up_and_down(start: Callable[..., Any], caplog: pytest.LogCaptureFixture) -> None:
    pair = SocketsPair((HERE, 0), name="tether")
    with caplog.at_level("INFO"):
        robot = start("robot", [pair.server()], down="tether")
        topside = start("topside", [pair.client()])
        robot.until_link("tether")
        topside.end()
        robot.until_link("tether", up=False)
    messages = [record.getMessage() for record in caplog.records]
    assert "link_tether is down: nobody has connected yet." in messages  # plain: nobody
    assert "link_tether is up: topside_node" in messages


@pytest.mark.slow
def test_page_age_is_correct_with_a_clock_offset(start: Callable[..., Any]) -> None:
    pair = SocketsPair((HERE, 0), name="tether")
    robot = start("robot", [pair.server()], down="tether")
    topside = start("topside", [pair.client("controls")], clock=WallClock(time.monotonic() - 5000.0))
    begun_s = robot.node.clock.now_s()
    topside.store("controls", 1)
    robot.until_stored("controls")
    robot.until(lambda: math.isfinite(robot.node.get_age_s("controls")), "the first report of the peers")
    assert robot.node.get_page("controls").created_at_s > 5000.0
    age_s = robot.node.get_age_s("controls")
    assert -LIMIT_S < age_s <= robot.node.clock.now_s() - begun_s


@pytest.mark.slow
@pytest.mark.parametrize("key", ["link_tether", "reload", "add_component"])
def test_peer_cannot_overwrite_pages_about_this_node(start: Callable[..., Any], key: str) -> None:
    pair = SocketsPair((HERE, 0), name="tether")
    robot = start("robot", [pair.server()], down="tether")
    intruder = start("intruder", [SocketsPair((HERE, pair.port), name="other").client([key, "end"])], up="other")
    intruder.store(key, {"up": True, "peers": 5})
    intruder.store("end", 1)
    robot.until_stored("end")
    assert {"up": True, "peers": 5} not in robot.stored[key]
    assert robot.node.components["link_tether"].rejected == 1


@pytest.mark.slow
def test_page_about_a_peer_is_accepted_on_request(start: Callable[..., Any]) -> None:
    pair = SocketsPair((HERE, 0), name="tether")
    topside = start("topside", [pair.server(accept=["reload"])], down="tether")
    robot = start("robot", [pair.client("reload")])
    robot.store("reload", {"ok": True})
    assert topside.until_stored("reload") == [{"ok": True}]


@pytest.mark.parametrize("net", [False, True])
def test_large_pages_of_a_peer_fill_a_stated_memory(net: bool, caplog: pytest.LogCaptureFixture) -> None:
    keys = [f"key_{number}" for number in range(30)]

    def store(loop: Any) -> None:
        loop.store_data("first", ["x" * 40_000])
        for key in keys:
            loop.store_data(key, [[]] * 3000)  # 9 kB of JSON, 295 kB of lists
        loop.store_data("small", (loop.get_time_s(), 1.0))
        loop.store_data("first", ["y" * 40_000])  # what replaces it may be as large

    options: Any = {"name": "tether", "max_held_bytes": 1_000_000}
    pair: Any = ZenohNet(listen="tcp/127.0.0.1:7447", **options) if net else SocketsPair((HERE, 1), **options)
    every = [*keys, "first", "small"]
    ends = [pair.link(every), pair.link()] if net else [pair.server(every), pair.client()]
    runner = simulate({"robot": [FunctionLoopFactory(store, rate_hz=2), ends[0]], "topside": [ends[1]]}, until_s=1.8)
    topside = runner.nodes["topside"]
    arrived = {key.split("/")[-1] for key in topside.datastore.pages} & set(every)
    assert arrived == {"first", "key_0", "key_1", "key_2", "small"}
    assert topside.get_data("small")[0] == 1.5
    assert topside.get_data("first") == ["y" * 40_000]
    assert topside.get_data("link_tether")["rejected"] >= 27
    (warning,) = [one.getMessage() for one in caplog.records if "that fill" in one.getMessage()]
    assert "'link_tether' takes pages that fill 1 MB. 'key_3' is dropped, and all further." in warning


@pytest.mark.parametrize("net", [False, True])
def test_peer_with_a_thousand_other_keys_fills_no_memory(
    net: bool, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("snr_sim.links.link.MAX_KEYS", 20)
    keys = [f"key_\x1b{number}" for number in range(30)]

    def store(loop: Any) -> None:
        for number, key in enumerate(keys):
            long = "x" * 5000 * (number % 2)  # the key of a long page is looked at before the page is decoded
            loop.store_data(key, (loop.get_time_s(), long))

    pair: Any = ZenohNet(name="tether", listen="tcp/127.0.0.1:7447") if net else SocketsPair((HERE, 1), name="tether")
    ends = [pair.link(keys), pair.link()] if net else [pair.server(keys), pair.client()]
    runner = simulate({"robot": [FunctionLoopFactory(store, rate_hz=2), ends[0]], "topside": [ends[1]]}, until_s=1.8)
    topside = runner.nodes["topside"]
    arrived = {key for key in topside.datastore.pages if "key_" in key}
    assert arrived == {key for key in topside.datastore.pages if key.endswith(tuple(keys[:20]))}
    assert len(arrived) == 20
    assert min(topside.get_data(key)[0] for key in arrived) == 1.5  # those that it knows keep arriving
    assert topside.get_data("link_tether")["rejected"] >= 20
    (warning,) = [one.getMessage() for one in caplog.records if "different keys" in one.getMessage()]
    assert "takes 20 different keys" in warning
    assert "accept=[...]" in warning
    assert warning.isprintable()


def test_send_reaches_the_named_peers_only_and_counts_absent_ones() -> None:
    pair = SocketsPair(("127.0.0.1", 0), name="net")
    runner = SimRunner(
        Config(factories={"s": [pair.server()], "a": [pair.client()], "b": [pair.client()]}),
        until_s=2.0,
        log_notes=False,
    )
    node = runner.nodes["s"]
    link = node.components["link_net"]
    assert isinstance(link, Link)
    page = node.page("k", 1)
    # Equal pages of another node, as of a publisher that repeats itself: none is taken for one that went in a circle.
    relayed = Page("k", 2, "far_node", 0.5)
    runner.clock.call_at(1.0, lambda: link.send(page, ["a_node", "absent_node"]))
    for time_s in (1.1, 1.1):
        runner.clock.call_at(time_s, lambda: link.send(relayed, ["b_node"]))
    runner.run()
    assert runner.nodes["a"].get_data("k") == 1
    assert runner.nodes["b"].get_data("k") == 2
    state = node.get_data("link_net")
    assert (state["dropped"], state["peers"]["b_node"]["sent"]) == (1, 2)


def test_send_to_all_keeps_a_page_of_any_key_for_the_first_peer() -> None:
    pair = SocketsPair(("127.0.0.1", 0), name="net")
    runner = SimRunner(Config(factories={"s": [pair.server()], "a": [pair.client()]}), until_s=1.0, log_notes=False)
    link = runner.nodes["a"].components["link_net"]
    assert isinstance(link, Link)
    link.send(runner.nodes["a"].page("early", 1))
    runner.run()
    assert runner.nodes["s"].get_data("early") == 1
