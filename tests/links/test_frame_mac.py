"""An attacker between two ends that share a secret can cut the connection, but cannot change any data on it."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim import LinkFaults, Page, SocketsPair, TaskType
from snr_sim.console.wire import PURPOSE, CommandMessage, decode_request, decode_response, encode_request
from snr_sim.links.frames import HEADER_BYTES, MAC_BYTES, FrameMac, LengthPrefixedReader, encode_frame
from snr_sim.links.session import Session, SessionConfig
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

from .conftest import simulate
from .test_campaign import LINK, History

SECRET = b"sixteen or more bytes"
PAGES = [Page("joystick", {"surge": i / 8}, "pilot_node", float(i)) for i in range(6)]


def end(node: str, is_server: bool, nonce: bytes, purpose: str = "pages", secret: bytes | None = SECRET) -> Session:
    decode: Any = {} if purpose == "pages" else {"decode": decode_request if is_server else decode_response}
    return Session(SessionConfig(node, is_server, secret, purpose), 0.0, nonce=nonce, **decode)


def pilot_and_robot() -> tuple[Session, Session]:
    return end("pilot_node", False, b"p" * 16), end("robot_node", True, b"r" * 16)


def output_of(session: Session) -> list[bytes]:
    return [session.seal(frame) for frame in session.take_output()]


def recorded() -> tuple[list[bytes], list[bytes]]:
    """Return the frames of a session in which the pilot sends PAGES: the pilot's, and the robot's."""
    pilot, robot = pilot_and_robot()
    there: list[bytes] = []
    back: list[bytes] = []
    while frames := (output_of(pilot), output_of(robot)):
        if not any(frames):
            break
        there, back = there + frames[0], back + frames[1]
        robot.receive(b"".join(frames[0]), 0.0)
        pilot.receive(b"".join(frames[1]), 0.0)
    there += [pilot.seal(encode_frame(page.serialize())) for page in PAGES]
    return there, back


THERE, BACK = recorded()
STREAM = b"".join(THERE)


def taken(stream: bytes, cuts: list[int] = [1 << 20]) -> tuple[list[Any], Session]:  # noqa: B006 - never changed
    """Return the pages that the robot accepts from a stream sent for the pilot, split into reads; and its session."""
    robot = end("robot_node", True, b"r" * 16)
    pages: list[Any] = []
    i = start = 0
    while start < len(stream):
        pages += robot.receive(stream[start : start + cuts[i % len(cuts)]], 0.0)
        start, i = start + cuts[i % len(cuts)], i + 1
    return pages, robot


def test_unchanged_stream_arrives_complete() -> None:
    pages, robot = taken(STREAM, [7, 1, 300])
    assert pages == PAGES
    assert robot.is_up


def test_seal_keeps_the_message_and_adds_a_mac_that_no_other_key_makes() -> None:
    frame = encode_frame(b"message")
    one, other = FrameMac(b"1" * 32).seal(frame), FrameMac(b"2" * 32).seal(frame)
    assert one[HEADER_BYTES:-MAC_BYTES] == b"message" == other[HEADER_BYTES:-MAC_BYTES]
    assert len(LengthPrefixedReader().feed(one)[0]) == len(b"message") + MAC_BYTES
    assert one[-MAC_BYTES:] != other[-MAC_BYTES:]


def test_all_frames_after_hello_and_auth_have_a_mac() -> None:
    macs = [payload[-1:] != b"}" for frame in THERE for payload in LengthPrefixedReader().feed(frame)]
    assert macs[:2] == [False, False]
    assert sum(macs[2:]) >= len(PAGES)  # a MAC may end with any byte


FRAMES = list(range(len(THERE)))
ATTACKS = {
    "a page is added": [*THERE, encode_frame(PAGES[0].serialize())],
    "a page with a MAC of nothing is added": [*THERE, encode_frame(PAGES[0].serialize() + b"\0" * MAC_BYTES)],
    "a page is left out": [*THERE[:-2], THERE[-1]],
    "two pages change places": [*THERE[:-2], THERE[-1], THERE[-2]],
    "a page is repeated": [*THERE, THERE[-1]],
    "an older page is repeated": [*THERE, THERE[-3]],
    "the robot's own frame is sent back": [*THERE, BACK[-1]],
    "a frame too short for a MAC": [*THERE, encode_frame(b"short")],
    "an empty frame": [*THERE, encode_frame(b"")],
}


@pytest.mark.parametrize("attack", ATTACKS)
def test_changed_stream_is_detected_at_the_first_wrong_frame(attack: str) -> None:
    frames = ATTACKS[attack]
    same = next(i for i in range(len(frames)) if frames[i : i + 1] != THERE[i : i + 1])
    pages, robot = taken(b"".join(frames))
    assert pages == PAGES[: len(PAGES) - (len(THERE) - same)]
    assert robot.is_closed
    assert robot.was_forged
    assert "changes, repeats or leaves out frames" in robot.reason
    assert robot.rejected == 0


def test_each_flipped_bit_closes_the_session_before_its_frame() -> None:
    for i in range(len(STREAM)):
        changed = bytearray(STREAM)
        changed[i] ^= 1 << i % 8
        pages, robot = taken(bytes(changed))
        robot.tick(100.0)
        assert robot.is_closed
        assert pages == PAGES[: len(pages)]
        assert len(pages) < len(PAGES)


frames = st.lists(st.sampled_from([*THERE, *BACK, *map(encode_frame, (b"", b"{}", PAGES[0].serialize()))]), max_size=16)
places = st.integers(0, len(STREAM))


@st.composite
def byte_edits(draw: st.DrawFn) -> bytes:
    """Return the stream with bytes overwritten, inserted, removed, or copied from elsewhere."""
    stream = STREAM
    for _ in range(draw(st.integers(1, 4))):
        start, length = draw(places), draw(st.integers(0, 200))
        other = draw(st.one_of(st.binary(max_size=64), places.map(lambda i: STREAM[i : i + 150])))
        stream = stream[:start] + other + stream[start + length :]
    return stream


@st.composite
def frame_edits(draw: st.DrawFn) -> bytes:
    """Return frames of either direction in any order after an honest start."""
    honest = draw(st.integers(0, len(THERE)))
    return b"".join([*THERE[:honest], *draw(frames)])


@given(byte_edits() | frame_edits(), st.lists(st.integers(1, 400), min_size=1, max_size=4))
def test_randomly_changed_stream_never_returns_a_changed_page(stream: bytes, cuts: list[int]) -> None:
    pages, robot = taken(stream, cuts)
    assert pages == PAGES[: len(pages)]
    if STREAM.startswith(stream):  # only truncated: the rest could still arrive
        assert not robot.is_closed
        return
    robot.tick(100.0)  # a changed length makes it wait for more
    assert robot.is_closed
    assert len(pages) < len(PAGES) or len(stream) > len(STREAM)


# Greetings


def relayed(message: dict[str, Any], **changed: Any) -> bytes:
    return encode_frame(msgspec.json.encode({**message, **changed}))


@pytest.mark.parametrize(
    ("purpose", "changed"),
    [("console", {"purpose": "console"}), ("pages", {"node": "other_node"}), ("pages", {"max_frame_bytes": 1 << 30})],
    ids=["another purpose", "another name", "another limit"],
)
@pytest.mark.parametrize("honest", ["client", "server"])
def test_proof_with_another_greeting_is_refused(purpose: str, changed: dict[str, Any], honest: str) -> None:
    """A pilot's proof, forwarded to a console of the same secret, used to open it."""
    pilot = end("pilot_node", False, b"p" * 16, purpose if honest == "server" else "pages")
    robot = end("robot_node", True, b"r" * 16, "pages" if honest == "server" else purpose)
    (there,), (back,) = output_of(pilot), output_of(robot)
    hellos = [msgspec.json.decode(frame[HEADER_BYTES:]) for frame in (there, back)]
    # The attacker sends to each end what the other sent, modified so that it looks like its own protocol.
    to_robot, to_pilot = relayed(hellos[0], **changed), relayed(hellos[1], purpose=hellos[0]["purpose"])
    if honest == "server":
        to_robot = relayed(hellos[0], **{**changed, "purpose": "pages"})
    robot.receive(to_robot, 0.0)
    pilot.receive(to_pilot, 0.0)
    (proof,) = output_of(pilot)
    robot.receive(proof, 0.0)
    assert not robot.is_up
    assert robot.was_refused
    assert "forwarded or changed a greeting" in robot.reason


def test_changed_console_line_is_not_executed() -> None:
    console, node = end("console", False, b"c" * 16, PURPOSE), end("rov_node", True, b"n" * 16, PURPOSE)
    for _ in range(3):
        node.receive(b"".join(output_of(console)), 0.0)
        console.receive(b"".join(output_of(node)), 0.0)
    assert node.receive(console.seal(encode_request(CommandMessage(1, "dump depth"))), 0.0) == [
        CommandMessage(1, "dump depth")
    ]
    changed = console.seal(encode_request(CommandMessage(2, "dump depth"))).replace(b"dump depth", b"task leave")
    assert node.receive(changed, 0.0) == []
    assert node.was_forged


# Links


@pytest.fixture
def history(monkeypatch: pytest.MonkeyPatch) -> Iterator[History]:
    """Provide a robot and an operator with a secret, over a simulated network, both up."""
    history = History(2, monkeypatch)
    history.settle()
    yield history
    history.settle()
    history.end()


def test_forged_frame_closes_its_connection_and_logs_once(
    history: History, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    link = history.link(history.robot)
    with caplog.at_level(logging.WARNING, "snr"):
        logging.getLogger("snr").setLevel(logging.WARNING)
        for count in (1, 2, 3):
            (stream,) = link.transport.streams
            stream.port._sock.come += encode_frame(Page("stick", "forged", "operator_node", 0.0).serialize())
            history.rounds(50)  # time for the other end to read the reason
            assert stream not in link.transport.streams
            assert history.robot.get_data(LINK)["forged"] == count
            assert history.robot.get_data("stick") != "forged"
            history.settle()
    assert len([record for record in caplog.records if record.filename == "streams.py"]) == 1
    assert not link.failures


def test_simulated_link_carries_with_macs_what_it_carried_without(monkeypatch: pytest.MonkeyPatch) -> None:
    def run() -> list[Any]:
        stored: list[Any] = []
        faults = LinkFaults(latency_s=0.02, jitter_s=0.05, loss=0.1, duplication=0.2, reordering=0.3, cut=((2.0, 6.0),))
        pair = SocketsPair(("127.0.0.1", 1), name="t", secret=SECRET, faults=faults)
        keep = FunctionEndpointFactory({TaskType.store_page: lambda task, task_id: stored.append(task.val_list[0])})
        source = FunctionLoopFactory(lambda loop: loop.store_data("x", loop.get_time_s()))
        simulate({"a": [source, pair.client("x")], "b": [keep, pair.server()]}, until_s=10.0)
        return stored

    with_macs = run()
    monkeypatch.setattr(FrameMac, "seal", lambda self, frame: frame)
    monkeypatch.setattr(FrameMac, "open", lambda self, payload: payload)
    assert with_macs == run()
    assert sum(page.key == "x" for page in with_macs) > 20
