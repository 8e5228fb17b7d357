"""Output that components print and log is in the trace, in order and bounded, and does not affect a replay."""

import logging
import sys
from pathlib import Path
from typing import Any

import pytest

from snr_sim import Config, Endpoint, SimClock, TaskType, WallClock, tasks
from snr_sim.core.output_recording import record_output
from snr_sim.prelude.errors import ComponentFailedError
from snr_sim.recording import node_trace
from snr_sim.recording.reader import read_trace
from snr_sim.recording.records import MAX_LOG_LINE_CHARS, LogLineRecord, Record
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario.program import record_program
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory


def recorded(tmp_path: Path, config: Config, clock: Any = None) -> list[Record]:
    folder = record_program("r", config, __file__, tmp_path, clock=clock or SimClock())
    return read_trace(folder / FILE_NAME).records


def log_lines(records: list[Record]) -> list[tuple[str, str, str]]:
    return [(one.component, one.level, one.text) for one in records if isinstance(one, LogLineRecord)]


def logging_config(words: Any) -> Config:
    """One component that handles one event by saying something."""

    class Part(FunctionEndpointFactory):
        def get(self, parent: Any) -> Any:
            part = super().get(parent)
            part.task_handlers = {(TaskType.event, "start"): lambda task, task_id: words(part)}
            part.begin = lambda: part.schedule(tasks.event("start"))
            return part

    return Config(factories={"r": [Part({})]})


def helper(words: str) -> None:
    print("one", words, sep="\n", end="")
    print(" and the rest")


def test_loop_output_is_recorded_with_component_and_time(tmp_path: Path) -> None:
    def loop(loop: Any) -> None:
        helper(f"tick {loop.get_time_s():g}")
        loop.log.debug("not this")
        loop.log.info("at %s", "work")
        loop.log.warning("soon over")
        if loop.get_time_s() >= 0.1:
            loop.schedule(tasks.terminate("done"))

    records = recorded(tmp_path, Config(factories={"r": [FunctionLoopFactory(loop, "x", 10.0)]}))
    of_one = ("x", "PRINT", "one"), ("x", "INFO", "at work"), ("x", "WARNING", "soon over")
    assert log_lines(records)[:4] == [of_one[0], ("x", "PRINT", "tick 0 and the rest"), *of_one[1:]]
    assert log_lines(records)[4:] == [of_one[0], ("x", "PRINT", "tick 0.1 and the rest"), *of_one[1:]]
    assert {one.t for one in records if isinstance(one, LogLineRecord)} == {0.0, 0.1}
    assert all(one.cause < one.seq for one in records if isinstance(one, LogLineRecord))


def test_unterminated_line_is_recorded_at_end(tmp_path: Path) -> None:
    def words(part: Any) -> None:
        print("no line end", end="")

    records = recorded(tmp_path, logging_config(words))
    assert log_lines(records) == [("part", "PRINT", "no line end")]
    assert records[-1].seq == records[-2].seq + 1


def test_failure_of_a_handler_that_has_printed_replays_identically(tmp_path: Path) -> None:
    def words(part: Any) -> None:
        print("one\ntwo")
        raise KeyError("three")

    with pytest.raises(ComponentFailedError, match="three"):
        recorded(tmp_path, logging_config(words))
    trace = read_trace(next(tmp_path.iterdir()) / FILE_NAME)
    assert log_lines(trace.records) == [("part", "PRINT", "one"), ("part", "PRINT", "two")]
    assert replay_node(trace, "r", logging_config(words)).is_identical
    assert not replay_node(trace, "r", logging_config(lambda part: None)).is_identical


def test_replay_leaves_out_a_handler_that_has_printed_and_was_interrupted(tmp_path: Path) -> None:
    def words(part: Any) -> None:
        print("before it stands")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        recorded(tmp_path, logging_config(words))
    trace = read_trace(next(tmp_path.iterdir()) / FILE_NAME)
    assert replay_node(trace, "r", logging_config(words)).is_identical


def test_print_reaches_terminal_and_library_logs_are_not_recorded(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def words(part: Any) -> None:
        logging.getLogger("other").warning("of a library")
        print("hello")

    records = recorded(tmp_path, logging_config(words))
    assert capsys.readouterr().out == "hello\n"
    assert log_lines(records) == [("part", "PRINT", "hello")]  # also by a handler that is a plain function


def test_print_is_recorded_identically_in_a_second_run(tmp_path: Path) -> None:
    def loop(loop: Any) -> None:
        print("half \udc80 a character", "x" * 5000)
        loop.schedule(tasks.terminate("done"))

    digests = []
    for name in ("a", "b"):
        folder = record_program(
            "r",
            Config(factories={"r": [FunctionLoopFactory(loop, "x", 10.0)]}),
            __file__,
            tmp_path / name,
            clock=SimClock(),
        )
        trace = read_trace(folder / FILE_NAME)
        digests.append(trace.digest)
        ((component, _, text),) = log_lines(trace.records)
        assert component == "x"
        assert text.startswith("half \\udc80 a character x")
        assert len(text) <= MAX_LOG_LINE_CHARS + len("\\udc80")
    assert digests[0] == digests[1]


def test_log_lines_of_node_are_limited_with_a_warning(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(node_trace, "MAX_LOG_LINES", 20)

    def loop(loop: Any) -> None:
        for number in range(50):
            loop.log.info("%d", number)
        if loop.get_time_s() >= 0.3:
            loop.schedule(tasks.terminate("done"))

    lines = log_lines(recorded(tmp_path, Config(factories={"r": [FunctionLoopFactory(loop, "x", 10.0)]})))
    assert [text for _, _, text in lines[:20]] == [str(number) for number in range(20)]
    assert lines[20:] == [("x", "WARNING", "what is printed and logged after 20 lines is not recorded")]


@pytest.mark.slow
def test_output_of_threaded_loop_is_recorded(tmp_path: Path) -> None:
    ticks: list[float] = []

    def loop(loop: Any) -> None:
        ticks.append(loop.get_time_s())
        print("from a thread")
        if len(ticks) == 3:
            loop.schedule(tasks.terminate("done"))

    lines = log_lines(recorded(tmp_path, Config(factories={"r": [FunctionLoopFactory(loop, "x", 50.0)]}), WallClock()))
    assert set(lines) == {("x", "PRINT", "from a thread")}
    assert len(lines) >= 2


def test_replay_ignores_changed_output(tmp_path: Path) -> None:
    prints = [True]

    def words(part: Any) -> Any:
        if prints[0]:
            part.log.info("only in the first run")
        return tasks.event("next")

    config = logging_config(words)
    folder = record_program("r", config, __file__, tmp_path, clock=SimClock())
    trace = read_trace(folder / FILE_NAME)
    assert log_lines(trace.records) == [("part", "INFO", "only in the first run")]
    prints[0] = False
    assert replay_node(trace, "r", config).is_identical


def test_invalid_log_call_does_not_end_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(logging.getLogger("snr"), "level", logging.CRITICAL)  # pytest's own handler would raise

    class Unspeakable:
        def __str__(self) -> str:
            raise RuntimeError

    def words(part: Any) -> Any:
        part.log.info("%(a)s", {"a": 1})
        part.log.info("one too many", 1)
        part.log.info("%d", "no number")
        part.log.info(Unspeakable())
        return tasks.terminate("done")

    logging.getLogger("snr").manager._clear_cache()  # type: ignore[attr-defined]
    texts = [text for _, _, text in log_lines(recorded(tmp_path, logging_config(words)))]
    assert texts == [
        "1",
        "a message of str and 1 values cannot be worded: TypeError",
        "a message of str and 1 values cannot be worded: TypeError",
        "a message of Unspeakable and 0 values cannot be worded: RuntimeError",
    ]


def test_component_sees_unchanged_stdout_attributes(tmp_path: Path) -> None:
    seen: list[Any] = []

    def words(part: Any) -> Any:
        seen.append((sys.stdout.encoding, sys.stdout.buffer, sys.stdout.isatty()))
        return tasks.terminate("done")

    before = sys.stdout.encoding, sys.stdout.buffer, sys.stdout.isatty()
    recorded(tmp_path, logging_config(words))
    assert seen == [before]


def test_runs_ending_out_of_order_restore_stdout() -> None:
    before = sys.stdout
    first, second = record_output([]), record_output([])
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert sys.stdout is not before
    second.__exit__(None, None, None)
    assert sys.stdout is before


def test_print_without_stdout_is_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def words(part: Any) -> Any:
        print("unheard", flush=True)
        return tasks.terminate("done")

    monkeypatch.setattr(sys, "stdout", None)
    assert log_lines(recorded(tmp_path, logging_config(words))) == [("part", "PRINT", "unheard")]


def test_print_before_node_exists_is_accepted(tmp_path: Path) -> None:
    class Early(Endpoint):
        def __init__(self, factory: Any, parent: Any, name: str) -> None:
            print("early")
            super().__init__(factory, parent, name)

    def words(part: Any) -> Any:
        Early(part.factory, part.parent, "early")
        return tasks.terminate("done")

    assert log_lines(recorded(tmp_path, logging_config(words))) == []
