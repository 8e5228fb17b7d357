"""The page of a running machine, without a socket: what a browser is sent, what it may change, and what is refused."""

from __future__ import annotations

import asyncio
import gc
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim import tasks
from snr_sim.behaviors import after, machine, machine_parts, parse, state
from snr_sim.web import session
from snr_sim.web.messages import HungUpError
from tests.web.dive import BRIDGE, DIVER, SHA, Live, edit, event_at, parts, with_push

Record = Callable[..., Path]
REFUSED = ("{}", "[1, 2]", "garbage", b"\xff\x00", '{"kind": "do", "what": "terminate"}', '{"kind": "state"}', "")


def refuse(data: bytes) -> None:
    raise HungUpError("The browser does not read.")


def send_often(count: int, send: Callable[[int], None]) -> None:
    for i in range(count):
        send(i)


# -- what is shown ----------------------------------------------------------------------------------------------------


def test_new_browser_gets_program_timeline_and_state(live: Live) -> None:
    live.until(1.2)
    browser = live.browser()
    live.tick()
    assert [one["kind"] for one in browser.received] == ["hello", "timeline", "state"]
    hello, timeline, state = browser.received
    assert (hello["name"], hello["title"], hello["text"], hello["sha256"]) == ("diver", "a dive", DIVER, SHA)
    assert (hello["is_live"], hello["rights"], hello["is_editable"]) == (True, "change", True)
    assert [one["name"] for one in hello["graph"][0]["states"]] == ["sinking", "rising"]
    assert hello["parts"] == [
        {"name": "depth", "functions": ["age_ms", "read", "read_since_entry"], "unit": "m", "low": None, "high": None},
        {"name": "up", "functions": ["start", "stop"], "unit": "", "low": -50.0, "high": 50.0},
    ]
    assert hello["signals"] == ["halt"]
    assert timeline["is_complete"]
    assert [(one["t_s"], one["target"]) for one in timeline["moments"]] == [(0.0, "sinking"), (1.1, "rising")]
    assert (state["active"], state["entered_s"], state["is_live"]) == ({"diver": "rising"}, {"diver": 1.1}, True)
    assert state["last"] == timeline["moments"][-1]
    assert state["variables"] == {"push": 5}
    assert state["reads"]["depth"] == {"value": pytest.approx(1.2), "age_s": pytest.approx(0.0), "limit_s": 0.5}
    assert state["drives"] == {"up": {"value": 5.0, "delay_s": None}}
    assert (state["problems"], state["is_paused"], state["changes"], state["missed"]) == ([], False, [], 0)


def test_changes_of_state_are_sent_once_each(live: Live) -> None:
    browser = live.browser()
    for i in range(8):
        live.until(0.3 * i)
    changes = [one for state in browser.of("state") for one in state["changes"]]
    assert [one["target"] for one in changes] == ["rising", "sinking", "rising", "sinking", "rising", "sinking"]
    (begin,) = browser.newest("timeline")["moments"]
    assert (begin["kind"], live.machine.moments.count) == ("spawn", 1 + len(changes))
    assert not any(state["missed"] for state in browser.of("state"))


def test_more_changes_than_fit_are_counted(live: Live, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(session, "MAX_CHANGES", 1)
    browser = live.browser()
    live.until(1.5)
    state = browser.newest("state")
    assert len(state["changes"]) == 1
    assert state["missed"] == live.machine.moments.count - 2 > 0  # the browser had the first one


def test_state_that_has_not_changed_is_sent_five_times_a_second(live: Live) -> None:
    browser = live.browser()
    live.page.tick(0.0)
    count = len(browser.received)
    for i in range(1, 31):
        live.page.tick(i / 30)
    assert len(browser.received) - count in (4, 5)


def test_long_timeline_is_sent_in_pieces(live: Live, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(session, "MOMENTS_PER_MESSAGE", 1)
    live.until(2.0)
    pieces = live.browser().of("timeline")
    assert [len(one["moments"]) for one in pieces] == [1] * live.machine.moments.count
    assert [one["is_complete"] for one in pieces] == [False] * (len(pieces) - 1) + [True]


def test_failed_block_is_shown_at_its_line() -> None:
    text = DIVER.replace("robot.up.start(push)", "robot.up.start(1 / (push - 5))")
    live = Live(*parts()[:1], *machine_parts(parse(text, BRIDGE.parts), "diver", bridge=BRIDGE))
    browser = live.browser()
    live.until(1.2)
    (problem,) = browser.newest("state")["problems"]
    assert (problem["line"], problem["is_error"]) == (6, True)
    assert "ZeroDivisionError" in problem["message"]
    assert problem["message"].startswith("At 1.1 s, 1 times in all:")


def test_machine_in_python_is_shown_with_its_pages_and_cannot_be_edited() -> None:
    blink = machine("blink", "lit", [state("lit", after(0.5, to="dark")), state("dark", after(0.5, to="lit", when=id))])
    live = Live(parts()[0], *machine_parts(blink, "blink", reacts_to=["depth"]), name="blink")
    browser = live.browser()
    live.until(0.6)
    assert not browser.newest("hello")["is_editable"]
    assert browser.newest("state")["active"] == {"blink": "dark"}
    assert browser.newest("state")["reads"]["depth.depth_m"]["value"] == pytest.approx(0.6)
    edit(browser, 1, DIVER)
    assert "made in Python" in browser.newest("refused")["reason"]


def test_reloaded_component_is_introduced_again(live: Live) -> None:
    browser = live.browser()
    edit(browser, 1, with_push(9))
    live.tick()
    live.node.enqueue_input(tasks.reload_component("diver"), "test")
    live.tick()
    hello, again = browser.of("hello")
    assert (again["number"], again["text"]) == (1, hello["text"])
    assert browser.newest("state")["number"] == 1
    edit(browser, 2, with_push(7))
    live.tick()
    assert browser.newest("program")["text"] == with_push(7)


# -- other moments ----------------------------------------------------------------------------------------------------


def test_moment_of_a_run_that_is_not_recorded_is_refused(live: Live) -> None:
    browser = live.browser()

    async def ask() -> None:
        browser.send("show", t_s=0.5)
        browser.send("why", machine="", transition="", from_s=0.0, until_s=1.0)
        await asyncio.sleep(0)
        await asyncio.sleep(0)

    asyncio.run(ask())
    assert [one["message"] for one in browser.of("refused")] == ["show", "why"]
    assert all("not recorded" in one["reason"] for one in browser.of("refused"))


def test_moment_is_read_from_the_recording(record: Record) -> None:
    folder = record(event_at(0.5, "diver.edit", with_push(9)))
    live = Live(folder=folder)
    browser = live.browser()

    async def ask() -> None:
        browser.send("show", t_s=1.2)
        while not browser.of("state"):
            await asyncio.sleep(0)

    asyncio.run(ask())
    program, shown = browser.received[-2:]
    assert (program["kind"], program["number"], program["text"]) == ("program", 2, with_push(9))
    assert (shown["is_live"], shown["t_s"], shown["active"]) == (False, 1.2, {"diver": "rising"})
    live.machine.close()


def test_answer_to_a_browser_that_reads_nothing_is_dropped(live: Live) -> None:
    browser = live.browser()
    browser.session._send = refuse
    failed: list[object] = []

    async def ask() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda loop, context: failed.append(context))
        browser.send("show", t_s=0.5)
        for _ in range(3):
            await asyncio.sleep(0)
        gc.collect()

    asyncio.run(ask())
    assert failed == []


def test_questions_that_wait_are_bounded(live: Live) -> None:
    browser = live.browser()

    async def ask() -> None:
        for _ in range(session.MAX_QUESTIONS + 1):
            browser.send("show", t_s=0.5)
        assert len(browser.of("refused")) == 1
        browser.session.close()
        await asyncio.sleep(0)

    asyncio.run(ask())
    assert "questions are being answered" in browser.newest("refused")["reason"]


# -- what is refused --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "fields"),
    [
        ("edit", {"number": 1, "text": "", "base_sha256": SHA}),
        ("set", {"path": "push", "value": 1}),
        ("do", {"what": "pause"}),
        ("do", {"what": "undo"}),
        ("give", {"signal": "halt"}),
    ],
)
def test_browser_that_may_only_look_changes_nothing(kind: str, fields: dict[str, Any], live: Live) -> None:
    browser = live.browser("look")
    browser.send(kind, **fields)
    assert "may only look" in browser.newest("refused")["reason"]
    assert not live.node.inbox.waiting
    assert not browser.newest("hello")["is_editable"]


@pytest.mark.parametrize("data", REFUSED)
def test_invalid_message_hangs_up_and_changes_nothing(data: str | bytes, live: Live) -> None:
    browser = live.browser()
    with pytest.raises(HungUpError, match="not a message"):
        browser.session.receive(data)
    assert not live.node.inbox.waiting


def test_more_than_50_changes_a_second_hang_up(live: Live) -> None:
    browser = live.browser()
    with pytest.raises(HungUpError, match="More than 50 changes a second"):
        send_often(200, lambda i: browser.send("set", path="push", value=1))
    assert len(live.node.inbox.waiting) < 100


def test_more_than_200_messages_a_second_hang_up(live: Live) -> None:
    browser = live.browser("look")
    with pytest.raises(HungUpError, match="More than 200 messages a second"):
        send_often(1000, lambda i: browser.send("do", what="pause"))
    assert not live.node.inbox.waiting


def test_more_than_64_unanswered_edits_hang_up(live: Live) -> None:
    browsers = [live.browser() for _ in range(3)]
    with pytest.raises(HungUpError, match="64 edits wait"):
        send_often(100, lambda i: edit(browsers[i % 3], i, with_push(i % 4)))
    assert len(live.node.inbox.waiting) == 64


def test_closed_browser_is_sent_nothing_more(live: Live) -> None:
    browser = live.browser()
    edit(browser, 1, with_push(9))
    live.page.close(browser.session)
    browser.session._send = refuse
    count = len(browser.received)
    live.until(0.5)
    assert live.machine.newest().number == 2
    assert len(browser.received) == count


def test_browser_that_reads_nothing_disturbs_no_other(live: Live) -> None:
    other = live.browser()
    stuck = live.browser()
    stuck.session._send = refuse
    edit(stuck, 1, with_push(9))
    live.until(0.5)
    assert other.newest("state")["number"] == 2


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)
NAMES = st.sampled_from(["push", "diver.push", "halt", "pause", "terminate", "diver", "", SHA, DIVER])
MESSAGES = st.builds(
    lambda kind, fields: {"kind": kind, **fields},
    st.sampled_from(["edit", "set", "do", "show", "why", "give", "hello"]),
    st.dictionaries(
        st.sampled_from(
            ["number", "text", "base_sha256", "path", "value", "what", "t_s", "signal", "machine", "from_s", "until_s"]
        ),
        NAMES | ANYTHING,
        max_size=4,
    ),
)


@given(st.lists(MESSAGES | ANYTHING, max_size=5))
def test_random_message_of_a_browser_that_may_only_look_enters_no_task(messages: list[Any]) -> None:
    live = LOOKED_AT
    browser = live.browser("look")
    for message in messages:
        try:
            browser.session.receive(json.dumps(message))
        except HungUpError:
            break
        except RuntimeError as error:  # without a loop a question cannot be asked
            assert "no running event loop" in str(error)
    assert not live.node.inbox.waiting
    live.page.close(browser.session)


LOOKED_AT = Live()
