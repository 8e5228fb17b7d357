"""The machine of a recorded run over time: what the node knew then is shown of that moment; nothing is executed."""

from __future__ import annotations

import gc
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from snr_sim import ListReplayerFactory, TimeoutLoopFactory, tasks
from snr_sim.behaviors import Bridge, MachineFactory, after, machine, machine_parts, parse, state
from snr_sim.prelude.errors import TraceError, UnknownNameError
from snr_sim.prelude.task import Page
from snr_sim.prelude.values import decode_value
from snr_sim.recording.reader import read_trace
from snr_sim.recording.records import PageRecord
from snr_sim.recording.trace import FILE_NAME
from snr_sim.web.moments import moment_of
from snr_sim.web.recorded_machine import RecordedMachine
from snr_sim.web.timeline import RecordedTimeline, machines_in
from tests.web.dive import BRIDGE, DEPTHS, DIVER, event_at, with_push

Record = Callable[..., Path]


Timeline = Callable[..., RecordedTimeline]


@pytest.fixture
def timeline() -> Iterator[Timeline]:
    """Return a function that reads the machine of a run folder."""
    with ExitStack() as stack:

        def read(folder: Path, name: str = "", bridge: Bridge | None = BRIDGE) -> RecordedTimeline:
            found = RecordedTimeline(folder, name, bridge)
            stack.callback(found.close)
            found.read_all()
            return found

        yield read


def pages_of(folder: Path, key: str) -> list[tuple[float, Any]]:
    """What the reader of traces finds: time and data of the pages of a key."""
    found = []
    for record in read_trace(folder / FILE_NAME).records:
        if isinstance(record, PageRecord) and record.name == key:
            page: Page = decode_value(bytes(record.values), {"page": Page})[0]
            found.append((record.t, page.data))
    return found


def newest(pages: list[tuple[float, Any]], t_s: float) -> Any:
    return next((data for stored_s, data in reversed(pages) if stored_s <= t_s), None)


def test_state_at_any_moment_equals_the_newest_pages_then(record: Record, timeline: Timeline) -> None:
    folder = record(event_at(0.5, "diver.edit", with_push(9)), event_at(1.7, "halt"))
    shown = timeline(folder)
    diver, depth, thrust = (pages_of(folder, key) for key in ("diver", "depth", "thrust"))
    for i in range(61):
        t_s = 0.05 * i
        state, then = shown.state_at(t_s), newest(diver, t_s)
        assert (state.active, state.variables) == (then["active"], then["variables"])
        assert state.reads["depth"].value == newest(depth, t_s)["depth_m"]
        assert state.drives["up"].value == newest(thrust, t_s)["up_n"]
        assert state.number == then["program"]
        age_s = state.reads["depth"].age_s
        assert age_s is not None
        assert 0.0 <= age_s < 0.1 + 1e-9


def test_moments_are_the_changes_of_the_run_with_their_program(record: Record, timeline: Timeline) -> None:
    shown = timeline(record(event_at(1.05, "diver.edit", with_push(9))))
    moments, missed = shown.moments.since(0, 100)
    assert missed == 0
    assert [(one.t_s, one.kind, one.source, one.target, one.number) for one in moments[:3]] == [
        (0.0, "spawn", "", "sinking", 1),
        (1.1, "on", "sinking", "rising", 2),
        (1.4, "ontime", "rising", "sinking", 2),
    ]
    assert (moments[2].held_s, moments[2].line) == (0.3, 9)
    assert shown.state_at(1.2).last == moments[1]
    assert shown.state_at(1.05).last == moments[0]
    assert shown.until_s == pytest.approx(3.0, abs=0.02)


def test_moments_of_many_programs_share_their_names() -> None:
    names = {one: "-".join(["a", one]) for one in ("machine", "kind", "name", "source", "target")}
    fields = [
        {"t_ns": 1, "held_ns": 0, "line": 1, **{key: "".join(list(name)) for key, name in names.items()}} for _ in "12"
    ]
    one, other = (moment_of(row, number) for number, row in enumerate(fields))
    assert all(getattr(one, key) is getattr(other, key) for key in names)


def test_before_the_first_page_nothing_is_known(record: Record, timeline: Timeline) -> None:
    shown = timeline(record())
    state = shown.state_at(-1.0)
    assert (state.active, state.last, state.reads["depth"].value, state.reads["depth"].age_s) == ({}, None, None, None)


def test_programs_are_those_of_the_edits_that_were_taken(record: Record, timeline: Timeline) -> None:
    texts = [with_push(9), "(machine", with_push(7)]
    shown = timeline(record(*(event_at(0.4 + 0.2 * i, "diver.edit", text) for i, text in enumerate(texts))))
    assert [shown.program(number).text for number in (1, 2, 3)] == [DIVER, with_push(9), with_push(7)]
    assert [shown.program(number).by for number in (1, 2, 3)] == ["start", "elsewhere", "elsewhere"]
    assert shown.program(2).sha256 == parse(with_push(9), BRIDGE.parts).sha256
    assert shown.program(1).sha256 == parse(DIVER, BRIDGE.parts).sha256
    assert [one.name for one in shown.program(3).graph[0].states] == ["sinking", "rising"]
    assert shown.program(1).signals == ["halt"]
    assert [shown.state_at(t_s).number for t_s in (0.39, 0.41, 0.7, 0.9)] == [1, 2, 2, 3]


def test_old_programs_are_not_kept_and_read_again(
    record: Record, timeline: Timeline, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("snr_sim.web.timeline.MAX_PROGRAMS", 20)
    used, shown = [], {}
    for count in (40, 240):
        edits = [event_at(0.4 + 0.01 * i, "diver.edit", with_push(i % 97)) for i in range(count)]
        folder = record(*edits, name=f"{count}")
        tracemalloc.start()
        try:
            shown[count] = timeline(folder)
            gc.collect()
            used.append(tracemalloc.get_traced_memory()[0])
        finally:
            tracemalloc.stop()
    assert used[1] - used[0] < 20_000, used  # 500 bytes were measured, and 560 000 when all were kept
    for number in (241, 100, 2, 100, 222):
        assert shown[240].program(number).text == with_push((number - 2) % 97)
    assert shown[240].program(1).text == shown[240].program(1000).text == DIVER


def test_edit_of_a_live_page_is_known_by_its_source(record: Record, timeline: Timeline) -> None:
    edit = TimeoutLoopFactory(0.5, task=tasks.event("diver.edit", [with_push(9)]), name="live")
    assert timeline(record(edit)).program(2).by == "page"


def test_edits_at_one_moment_are_matched_in_order(record: Record, timeline: Timeline) -> None:
    stale = "0" * 64
    shown = timeline(
        record(
            event_at(0.5, "diver.edit", with_push(3), stale),
            event_at(0.5, "diver.edit", with_push(9)),
            event_at(0.5, "diver.edit", "("),
            event_at(0.5, "diver.edit", with_push(8)),
        )
    )
    assert [shown.program(number).text for number in (2, 3)] == [with_push(9), with_push(8)]


def test_paused_machine_is_shown_as_paused(record: Record, timeline: Timeline) -> None:
    shown = timeline(record(event_at(0.5, "diver.pause"), event_at(0.9, "diver.go")))
    assert [shown.state_at(t_s).is_paused for t_s in (0.4, 0.6, 1.0)] == [False, True, False]


# -- imported files, several machines ---------------------------------------------------------------------------------

TURN = "(machine turn (state left))\n(export turn)\n"
USES = '(import "turn.lrp")\n(machine m (state a (onentry (spawn turn left))))\n(spawn m a)\n'


def test_imported_files_and_their_edits_are_found(record: Record, timeline: Timeline) -> None:
    program = parse(USES, {}, {"turn.lrp": TURN})
    other = TURN.replace("(state left)", "(state left)(state right)(eps left -> right)")
    folder = record(factories=[*machine_parts(program, "m"), event_at(0.5, "m.edit_file", other, "turn.lrp")])
    edited = timeline(folder)
    assert edited.program(1).files == {"turn.lrp": TURN}
    assert edited.program(2).files == {"turn.lrp": other}
    assert edited.program(2).text == USES
    inner = edited.program(2).graph[0].states[0].machines[0]
    assert [one.name for one in inner.states] == ["left", "right"]


def test_one_of_several_machines_has_to_be_named(record: Record, timeline: Timeline) -> None:
    blink = machine("blink", "lit", [state("lit", after(0.5, to="dark")), state("dark", after(0.5, to="lit"))])
    both = [*machine_parts(blink, "one"), *machine_parts(blink, "two", step_hz=10.0)]
    folder = record(factories=both)
    assert machines_in(folder / FILE_NAME) == ["one", "two"]
    assert {one.machine for one in timeline(folder, "two").moments.since(0, 100)[0]} == {"blink"}
    assert timeline(folder, "two").state_at(0.55).active == {"blink": "dark"}
    with pytest.raises(UnknownNameError, match="has several machines"):
        timeline(folder)
    with pytest.raises(UnknownNameError, match="has no machine 'thre'"):
        timeline(folder, "thre")


def test_run_without_a_machine_is_refused(record: Record, timeline: Timeline) -> None:
    folder = record(factories=[ListReplayerFactory(DEPTHS, "depth", rate_hz=10.0)])
    with pytest.raises(UnknownNameError, match="has no state machine") as error:
        timeline(folder)
    assert "whose controller has one" in error.value.fix


def test_machine_in_python_is_shown_by_its_listing_and_its_sensors(record: Record, timeline: Timeline) -> None:
    blink = machine("blink", "lit", [state("lit", after(0.5, to="dark")), state("dark", after(0.5, to="lit"))])
    depth = ListReplayerFactory(DEPTHS, "depth", rate_hz=10.0)
    shown = timeline(record(factories=[depth, *machine_parts(blink, "blink")]), bridge=None)
    assert shown.program(1).text == blink.text
    assert [one.name for one in shown.program(1).graph[0].transitions] == ["lit->dark", "dark->lit"]
    assert shown.state_at(0.62).active == {"blink": "dark"}
    reading = shown.state_at(0.62).reads["depth.depth_m"]
    assert (reading.value, reading.age_s) == (DEPTHS[6]["depth_m"], pytest.approx(0.02))


# -- traces that grow, or are damaged ---------------------------------------------------------------------------------


def test_trace_that_grows_is_read_as_far_as_it_has_whole_lines(
    record: Record, timeline: Timeline, tmp_path: Path
) -> None:
    folder = record(event_at(0.5, "diver.edit", with_push(9)))
    data, whole = (folder / FILE_NAME).read_bytes(), timeline(folder)
    (tmp_path / "growing").mkdir()
    path = tmp_path / "growing" / FILE_NAME
    begin = data.index(b'"kind":"input"') - 1
    path.write_bytes(data[:begin])
    growing = timeline(tmp_path / "growing")
    with open(path, "ab") as file:
        for at in range(begin, len(data), 7919):  # a prime: lines are cut at all places
            file.write(data[at : at + 7919])
            file.flush()
            growing.read_all()
            assert growing.moments.count <= whole.moments.count
    assert growing.moments.since(0, 1000) == whole.moments.since(0, 1000)
    assert growing.state_at(2.0) == whole.state_at(2.0)
    assert growing.until_s == whole.until_s


def test_trace_in_small_pieces_gives_the_same(
    record: Record, timeline: Timeline, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = record(event_at(0.5, "diver.edit", with_push(9)))
    whole = timeline(folder)
    monkeypatch.setattr("snr_sim.web.trace_index.CHUNK_BYTES", 100)
    pieces = timeline(folder)
    assert pieces.moments.since(0, 1000) == whole.moments.since(0, 1000)
    assert [pieces.state_at(0.1 * i) for i in range(30)] == [whole.state_at(0.1 * i) for i in range(30)]


def test_bytes_that_were_never_written_end_the_trace(record: Record, timeline: Timeline) -> None:
    folder = record()
    whole = timeline(folder)
    with open(folder / FILE_NAME, "ab") as file:
        file.write(b"\0" * 5000 + b"\n" * 3)
    assert timeline(folder).moments.since(0, 1000) == whole.moments.since(0, 1000)


def test_text_that_looks_like_a_record_is_ignored(record: Record, timeline: Timeline) -> None:
    text = DIVER + '; ["event","diver.transition",[{}]] "type":"store_page","name":"depth", \n'
    diver = machine_parts(parse(text, BRIDGE.parts), "diver", bridge=BRIDGE)
    folder = record(factories=[ListReplayerFactory(DEPTHS, "depth", rate_hz=10.0), *diver])
    assert timeline(folder).program(1).text == text
    assert timeline(folder).state_at(0.35).reads["depth"].value == DEPTHS[3]["depth_m"]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b'"t_ns":', b'"t_xs":'),
        (b'["event","diver.transition",[{', b'["event","diver.transition",[7,{'),
        (b'"diver.edited",[{"$":"page"', b'"diver.edited",[{"$":"paqe"'),
        (b'"ok":true', b'"ok":true,,'),
    ],
)
def test_damaged_record_is_an_error_with_its_file(old: bytes, new: bytes, record: Record, timeline: Timeline) -> None:
    folder = record(event_at(0.5, "diver.edit", with_push(9)))
    data = (folder / FILE_NAME).read_bytes()
    assert old in data
    (folder / FILE_NAME).write_bytes(data.replace(old, new))
    with pytest.raises(TraceError, match=FILE_NAME):
        timeline(folder).state_at(2.0)


def test_page_over_a_damaged_run_is_an_error_and_closes_the_file(record: Record) -> None:
    folder = record()
    data = (folder / FILE_NAME).read_bytes()
    (folder / FILE_NAME).write_bytes(data.replace(b'"t_ns":', b'"t_xs":'))
    with pytest.raises(TraceError, match="not one of a machine"):
        RecordedMachine(folder, "", "a dive", BRIDGE)


def test_missing_or_foreign_file_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(TraceError, match="cannot be read"):
        RecordedTimeline(tmp_path, "")
    (tmp_path / FILE_NAME).write_text("{}\n{}\n")
    with pytest.raises(TraceError, match="is not a trace"):
        RecordedTimeline(tmp_path, "")


def test_factory_that_was_given_a_name_with_quotes_is_found(record: Record, timeline: Timeline) -> None:
    name = 'a "name" \\ here'
    blink = machine("blink", "lit", [state("lit", after(0.5, to="dark")), state("dark", after(0.5, to="lit"))])
    steps = [event_at(time_s, f"{name}.step") for time_s in (0.1, 0.6)]
    folder = record(factories=[MachineFactory(blink, name), *steps])
    assert timeline(folder, name).state_at(1.0).active == {"blink": "dark"}
