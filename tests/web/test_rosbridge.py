"""rosbridge: tools of ROS see pages and publish events, and can do nothing else to the node."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from snr_sim import Config, Node, SimClock, SimRunner, TaskType, tasks
from snr_sim.behaviors.flow import wait
from snr_sim.behaviors.processes import ControlProcessFactory, ObserverState, reference_parts
from snr_sim.prelude.errors import ConfigError
from snr_sim.recording.reader import read_trace
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.program import program_header
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory
from snr_sim.web.messages import HungUpError
from snr_sim.web.ros_session import MAX_CALLS, RosSession
from snr_sim.web.rosbridge import RosbridgeFactory
from tests.web.served import TIMEOUT_S, wait_for

STATES = {"searching": {"FOUND": "resting"}, "resting": {"AGAIN": "searching"}}
TABLES: Any = {
    "topics": {"/reference": "reference", "/count": "count"},
    "events": {"/found": "FOUND", "/again": "AGAIN", "/any": "anything"},
    "services": {"/attach": ("reference.attach", "reference"), "/silent": ("anything", "nothing")},
}


class Idle(ObserverState):
    def run_state(self) -> Any:
        yield wait(100.0)


def parts() -> list[Any]:
    anything = FunctionEndpointFactory({(TaskType.event, "anything"): lambda task, key: None}, "anything")
    return [
        *reference_parts(STATES, observers=["eyes"]),
        *(ControlProcessFactory(name, "reference", dict.fromkeys(STATES, Idle)) for name in ("eyes", "ears")),
        anything,
    ]


class Ros:
    """A node stepped by hand, and a client without a socket."""

    def __init__(self, rights: Any = "change") -> None:
        self.clock = SimClock()
        self.node = Node("r", Config(factories={"r": parts()}), clock=self.clock)
        self.node.begin()
        self.node.run_ready()
        self.received: list[dict[str, Any]] = []
        offer = RosbridgeFactory(0, **TABLES).offer
        self.session = RosSession(self.node, offer, rights, lambda data: self.received.append(json.loads(data)))

    def ask(self, op: str, **fields: Any) -> list[dict[str, Any]]:
        """Send a message; return what has come since the last one."""
        self.session.receive(json.dumps({"op": op, **fields}))
        self.node.run_ready()
        return self.tick()

    def tick(self, now_s: float | None = None) -> list[dict[str, Any]]:
        # A control process is called at the same moment, after the node's tasks.
        while self.clock.next_s is not None and self.clock.next_s <= self.clock.now_s():
            self.clock.run_next()
            self.node.run_ready()
        self.session.tick(time.monotonic() if now_s is None else now_s)
        found, self.received[:] = list(self.received), []
        return found

    @property
    def state(self) -> Any:
        return self.node.get_data("reference")["state"]


@pytest.fixture
def ros() -> Ros:
    return Ros()


# -- without a port ---------------------------------------------------------------------------------------------------


def test_published_message_is_an_event_and_a_subscription_gets_pages(ros: Ros) -> None:
    (shown,) = ros.ask("subscribe", topic="/reference", type="std_msgs/String", queue_length=1, compression="none")
    assert (shown["op"], shown["topic"], shown["msg"]["state"]) == ("publish", "/reference", "searching")
    assert ros.ask("advertise", topic="/found", type="std_msgs/Empty", id="advertise:/found:1", latch=False) == []
    pages = ros.ask("publish", topic="/found", msg={"data": [0.5, "left"]})
    assert ros.state == "resting"
    assert (pages[-1]["msg"]["state"], pages[-1]["msg"]["values"]) == ("resting", [0.5, "left"])
    assert ros.tick() == [], "a page is sent once"
    ros.ask("unsubscribe", topic="/reference")
    assert ros.ask("publish", topic="/again", msg={}) == []
    assert ros.state == "searching"


@pytest.mark.parametrize(
    ("msg", "values"),
    [({}, []), ({"data": "x"}, ["x"]), ({"data": [1, 2]}, [1, 2]), ({"x": 1.0}, [{"x": 1.0}]), ({"data": None}, [])],
)
def test_values_of_an_event_are_the_data_of_the_message(msg: Any, values: Any, ros: Ros) -> None:
    ros.session.receive(json.dumps({"op": "publish", "topic": "/any", "msg": msg}))
    ((task, source),) = ros.node.inbox.waiting
    assert (task.type, task.name, list(task.val_list), source) == (TaskType.event, "anything", values, "rosbridge")


def test_throttled_topic_gets_the_newest_page_only(ros: Ros) -> None:
    ros.ask("subscribe", topic="/count", throttle_rate=1000)
    sent = []
    for i in range(25):
        ros.node.store_data("count", i)
        ros.node.run_ready()
        sent += [one["msg"]["data"] for one in ros.tick(1e6 + 0.1 * i)]
    assert sent == [0, 10, 20]


@pytest.mark.parametrize(
    "data",
    [np.arange(3.0), {"a": np.float64(2.0)}, (1, None), float("nan"), {1: b"x"}, {(1, 2)}, {(1, 2): 3}, "\ud800"],
)
def test_page_of_any_data_is_sent_as_json(data: Any, ros: Ros) -> None:
    ros.ask("subscribe", topic="/count")
    ros.node.store_data("count", data)
    ros.node.run_ready()
    (shown,) = ros.tick()
    assert isinstance(shown["msg"], dict)


def test_service_is_answered_by_the_next_page_or_not_in_time(ros: Ros) -> None:
    (answer,) = ros.ask("call_service", service="/attach", id="call:1", args={"data": "ears"})
    assert (answer["op"], answer["id"], answer["result"]) == ("service_response", "call:1", True)
    assert answer["values"]["attached"] == ["eyes", "ears"]
    assert ros.ask("call_service", service="/silent", args=[1], timeout=2.0) == []
    (answer,) = ros.tick(time.monotonic() + 3.0)
    assert (answer["result"], answer["values"], answer["id"]) == (False, "No answer within 2 s.", None)
    (answer,) = ros.ask("call_service", service="/attatch", id="2")
    assert not answer["result"]
    assert "There is no service '/attatch': did you mean '/attach'?" in answer["values"]


def test_calls_that_wait_are_bounded(ros: Ros) -> None:
    for _ in range(MAX_CALLS):
        assert ros.ask("call_service", service="/silent") == []
    (answer,) = ros.ask("call_service", service="/silent")
    assert (answer["result"], answer["values"]) == (False, "16 calls wait for their answers.")


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"op": "publish", "topic": "/fuond", "msg": {}}, "did you mean '/found'?"),
        ({"op": "publish", "topic": "/reference", "msg": {}}, "There is no topic of an event '/reference'"),
        ({"op": "advertise", "topic": "/x"}, "There is no topic of an event"),
        ({"op": "subscribe", "topic": "/found"}, "There is no topic of a page '/found'"),
        ({"op": "subscribe", "topic": "x" * 501}, "Not a request"),
        ({"op": "subscribe", "topic": 5}, "Not a request"),
        ({"op": "subscribe", "topic": "/count", "throttle_rate": -1}, "Not a request"),
        ({"op": "publish", "topic": "/any", "msg": [1]}, "Not a request"),
        ({"op": "fragment", "id": "1"}, "Not a request"),
        ({"topic": "/any"}, "Not a request"),
    ],
)
def test_message_that_cannot_be_carried_out_is_answered_and_changes_nothing(
    fields: dict[str, Any], text: str, ros: Ros
) -> None:
    ros.session.receive(json.dumps(fields))
    (answer,) = ros.received
    assert (answer["op"], answer["level"]) == ("status", "error")
    assert text in answer["msg"]
    assert not ros.node.inbox.waiting


@pytest.mark.parametrize(
    "data",
    ["", "{", b"\xff\xfe", '"' + "[" * 200, "[" * 101 + "]" * 101, '{"op":"publish","msg":{"data":' + "9" * 30 + "}}"],
)
def test_invalid_message_hangs_up_and_changes_nothing(data: str | bytes, ros: Ros) -> None:
    with pytest.raises(HungUpError, match="not a message"):
        ros.session.receive(data)
    assert not ros.node.inbox.waiting


def test_flood_of_messages_hangs_up(ros: Ros) -> None:
    def flood() -> None:
        for _ in range(100_000):
            ros.session.receive('{"op":"subscribe","topic":"/count"}')

    with pytest.raises(HungUpError, match="More than 200 messages a second"):
        flood()
    assert len(ros.session._subscribed) == 1


def test_read_token_may_subscribe_only() -> None:
    ros = Ros("look")
    assert len(ros.ask("subscribe", topic="/reference")) == 1
    for fields in ({"op": "publish", "topic": "/found"}, {"op": "call_service", "service": "/attach"}):
        (answer,) = ros.ask(**fields)
        assert answer["msg"] == "This token may only subscribe."
    assert ros.state == "searching"


json_values = st.recursive(
    st.none() | st.booleans() | st.floats(allow_nan=False) | st.integers(-(2**70), 2**70) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(("$", "data", "x")), inner, max_size=3),
    max_leaves=5,
)
ops = st.sampled_from(("publish", "subscribe", "unsubscribe", "advertise", "call_service", "status", 5))
names = st.sampled_from(("/any", "/count", "/reference", "/silent", "/attach", "/none"))


@pytest.mark.hypothesis
@given(messages=st.lists(st.fixed_dictionaries({"op": ops}, optional={
    "topic": names, "service": names, "msg": json_values, "args": json_values, "id": json_values,
    "timeout": json_values, "throttle_rate": json_values,
}), max_size=8))  # fmt: skip
def test_random_messages_are_answered_and_recorded(messages: list[Any], tmp_path_factory: Any) -> None:
    ros = Ros()
    for message in messages:
        with suppress(HungUpError):
            ros.session.receive(json.dumps(message))
        sent = list(ros.node.inbox.waiting)
        assert {task.name for task, _ in sent} <= {"anything", "reference.attach"}
        ros.node.run_ready()
        ros.tick()
        for task, _ in sent:
            folder = tmp_path_factory.mktemp("run")
            config = Config(factories={"r": [*parts()[-1:], FunctionLoopFactory(lambda loop, t=task: t, "s", 1.0)]})
            clock = SimClock()
            writer = TraceWriter(folder / FILE_NAME, program_header(["r"], config, __file__, clock))
            SimRunner(config, clock=clock, recorder=writer, until_s=0.1).run()
            writer.close()
            read_trace(folder / FILE_NAME)


def test_topic_of_a_page_and_an_event_is_refused() -> None:
    with pytest.raises(ConfigError, match="'/a' is a page and an event"):
        RosbridgeFactory(0, {"/a": "a"}, events={"/a": "A"})


# -- over its port ----------------------------------------------------------------------------------------------------


@contextmanager
def served(load: str = "") -> Iterator[tuple[Node, RosbridgeFactory]]:
    factory = RosbridgeFactory(0, **TABLES)
    ticks = FunctionLoopFactory(lambda loop: loop.store_data("count", [loop.caller.ticks, load]), "counter", 100.0)
    node = Node("r", Config(factories={"r": [factory, *parts(), ticks]}))
    thread = threading.Thread(target=node.loop)
    thread.start()
    try:
        wait_for(lambda: factory.port != 0 and node.get_data("count"))
        yield node, factory
        before = node.get_data("count")[0]
        wait_for(lambda: node.get_data("count")[0] > before + 5)  # the robot continues
    finally:
        node.enqueue_input(tasks.terminate("test"), "test")
        thread.join(TIMEOUT_S)
    assert not thread.is_alive()


def tool(url: str, **options: Any) -> Any:
    return connect(url, compression=None, open_timeout=TIMEOUT_S, proxy=None, max_size=None, **options)


def send(socket: ClientConnection, op: str, **fields: Any) -> None:
    socket.send(json.dumps({"op": op, **fields}))


def receive(socket: ClientConnection) -> dict[str, Any]:
    found = json.loads(socket.recv(timeout=TIMEOUT_S))
    assert isinstance(found, dict)
    return found


@pytest.mark.slow
def test_tool_with_the_token_in_its_address_leads_the_reference_machine() -> None:
    with served() as (_, factory), tool(factory.url) as socket:
        send(socket, "subscribe", topic="/reference")
        assert receive(socket)["msg"]["state"] == "searching"
        send(socket, "publish", topic="/found", msg={"data": [1]})
        while (page := receive(socket)["msg"])["state"] != "resting":
            pass
        assert page["values"] == [1]
        send(socket, "call_service", service="/attach", args=["ears"], id="a")
        while (answer := receive(socket))["op"] != "service_response":
            pass
        assert answer["values"]["attached"] == ["eyes", "ears"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "options"),
    [
        (lambda url: url.replace("token=", "token=x"), {}),
        (lambda url: url.split("?")[0], {}),
        (lambda url: url, {"origin": "http://evil.example"}),
        (lambda url: url, {"origin": "null"}),
        (lambda url: url.replace("127.0.0.1", "localhost"), {}),
    ],
)
def test_tool_without_the_token_or_of_a_foreign_page_is_refused(change: Any, options: dict[str, Any]) -> None:
    with served() as (_, factory):
        with pytest.raises(InvalidStatus) as refused, tool(change(factory.url), **options):
            pass
        assert refused.value.response.status_code == 403


def read_to_the_end(socket: ClientConnection) -> int:
    """Return how many messages come until the connection is closed, or 1000."""
    count = 0
    with suppress(ConnectionClosed):
        while count < 1000:
            receive(socket)
            count += 1
    return count


@pytest.mark.slow
def test_flood_and_a_message_that_is_too_large_close_the_connection_only() -> None:
    with served() as (_, factory):
        for messages in (['{"op":"subscribe","topic":"/count"}'] * 1000, ["x" * 300_000]):
            with tool(factory.url) as socket:
                with suppress(ConnectionClosed):
                    for message in messages:
                        socket.send(message)
                assert read_to_the_end(socket) < 100


@pytest.mark.slow
def test_tool_that_reads_nothing_is_closed_and_disturbs_no_other() -> None:
    with served("x" * 200_000) as (_, factory), tool(factory.url, max_queue=1) as paused, tool(factory.url) as other:
        for socket in (paused, other):
            send(socket, "subscribe", topic="/count")
        for _ in range(200):
            receive(other)
        assert read_to_the_end(paused) < 180, "it was closed"


ROSLIBPY = """
import sys, threading, roslibpy
ros = roslibpy.Ros(sys.argv[1])
ros.run(timeout=30)
states, rested = [], threading.Event()
def on_page(page):
    states.append(page["state"])
    if states[-1] == "resting":
        rested.set()
roslibpy.Topic(ros, "/reference", "std_msgs/String").subscribe(on_page)
found = roslibpy.Topic(ros, "/found", "std_msgs/Empty")
found.advertise()
found.publish(roslibpy.Message({"data": [2.5]}))
assert rested.wait(30)
service = roslibpy.Service(ros, "/attach", "rosapi/Any")
answer = service.call(roslibpy.ServiceRequest({"data": "ears"}), timeout=30)
print(states[-1], answer["attached"])
ros.terminate()
"""


@pytest.mark.slow
def test_roslibpy_drives_it(tmp_path: Path) -> None:
    with served() as (_, factory):
        done = subprocess.run(
            [sys.executable, "-c", ROSLIBPY, factory.url],
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
            cwd=tmp_path,
        )
        assert done.stdout.strip().endswith("resting ['eyes', 'ears']"), done.stdout + done.stderr
