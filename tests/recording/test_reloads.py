"""Replays of runs in which components were reloaded, added and removed."""

import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from snr_sim import Config, SimClock, tasks
from snr_sim.core.reload.sources import ModuleReload
from snr_sim.prelude.errors import TraceError
from snr_sim.recording.checker import NodeReplay
from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.records import PageRecord
from snr_sim.recording.replay import describe_reloads, replay_node
from snr_sim.recording.sources import read_kept_files
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario.library import load_program
from snr_sim.scenario.program import record_program
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

# A robot that reloads, adds and removes in the middle of its run. Its pilot counts in itself and in its factory, and
# asks for something when it begins.
PROGRAM = """
import sys
from pathlib import Path

from snr_sim import Config, Endpoint, EndpointFactory, Loop, LoopFactory, SimClock, TaskType, tasks
from snr_sim.scenario.program import record_program

GAIN = 1
SCRIPT = {
    3: lambda: tasks.reload_component("pilot"),
    4: lambda: tasks.reload_component("ticker"),
    5: lambda: tasks.reload_component("all"),
    6: lambda: tasks.reload_component("pilto"),
    7: lambda: tasks.event("more"),
    9: lambda: tasks.reload_component("late"),
    10: lambda: tasks.remove_component("late"),
    11: lambda: tasks.remove_component("ticker 2"),
    12: lambda: tasks.remove_component("late"),
    20: lambda: tasks.terminate("done"),
}

class Pilot(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.count = 0
        self.task_handlers = {(TaskType.event, "tick"): self.on_tick, (TaskType.event, "more"): self.on_more}

    def begin(self):
        self.schedule(tasks.event(f"{self.name} began"))

    def on_tick(self, task, task_id):
        self.count += 1
        self.factory.count += 1
        return self.store_data_task(f"{self.name} thrust", [GAIN * self.count, self.factory.count])

    def on_more(self, task, task_id):
        return [tasks.add_component(PilotFactory("late")), tasks.add_component(TickerFactory("ticker 2"))]

class PilotFactory(EndpointFactory):
    def __init__(self, name):
        super().__init__(sys.modules[__name__] if name == "late" else None)
        self.name, self.count = name, 0

    def get(self, parent):
        return Pilot(self, parent, self.name)

class Ticker(Loop):
    def loop(self):
        self.factory.ticks += 1
        self.schedule(tasks.event("tick"))
        if self.name == "ticker":
            edit = Path(__file__).with_name("edit.py")
            if self.factory.ticks == 3 and edit.exists():
                Path(__file__).write_text(edit.read_text())
            self.schedule(SCRIPT.get(self.factory.ticks, lambda: None)())

class TickerFactory(LoopFactory):
    def __init__(self, name):
        super().__init__()
        self.name, self.ticks = name, 0

    def get(self, parent):
        return Ticker(self, parent, self.name, 100.0)

config = Config(factories={"r": [TickerFactory("ticker"), PilotFactory("pilot")]})
if __name__ == "__main__":
    print(record_program("r", config, __file__, clock=SimClock() if "sim" in sys.argv else None))
"""


def record(folder: Path, clock: str, program: str = PROGRAM) -> Trace:
    """Run a program as a script, as a student does."""
    (folder / "robot.py").write_text(program)
    done = subprocess.run(
        [sys.executable, "robot.py", clock], cwd=folder, capture_output=True, text=True, timeout=60, check=True
    )
    return read_trace(folder / done.stdout.strip() / FILE_NAME)


def with_two_reloads(until: int) -> str:
    """Return the program with the reloads of pilot and ticker only, and with this many ticks."""
    script = PROGRAM.partition("SCRIPT = {\n")[2].partition("}\n")[0]
    reloads = "".join(script.splitlines(True)[:2])
    return PROGRAM.replace(script, f"{reloads}{until}: lambda: tasks.terminate('done')\n")


def replay(trace: Trace) -> NodeReplay:
    config: Config = load_program(trace.trace_info.controller).config
    return replay_node(trace, "r", config)


def pages(trace: Trace, key: str) -> list[Any]:
    found = [one for one in trace.records if isinstance(one, PageRecord) and one.name == key]
    return [json.loads(bytes(one.values))[0]["data"] for one in found]


@pytest.mark.slow
def test_run_with_reloads_additions_and_removals_replays_identically(tmp_path: Path) -> None:
    trace = record(tmp_path, "sim")
    assert [page["ok"] for page in pages(trace, "reload")] == [True, True, True, False, True]
    assert pages(trace, "reload")[2]["created"] == ["ticker", "pilot"]
    assert [page["component"] for page in pages(trace, "add_component")] == ["late", "ticker 2"]
    assert [page["ok"] for page in pages(trace, "remove_component")] == [True, True, False]
    assert pages(trace, "late thrust")
    replayed = replay(trace)
    assert replayed.is_identical, replayed.divergences[0]
    assert replayed.executed == replayed.recorded > 60
    assert describe_reloads(trace, replayed.records) == []


@pytest.mark.slow
def test_threaded_run_with_reloads_replays_identically(tmp_path: Path) -> None:
    trace = record(tmp_path, "wall")  # what waits for what depends on how busy the computer is; the replay does not
    assert {page["component"] for page in pages(trace, "reload")} == {"pilot", "ticker", "all", "pilto", "late"}
    replayed = replay(trace)
    assert replayed.is_identical, replayed.divergences[0]


@pytest.mark.slow
def test_describe_reloads_reports_reload_of_changed_code(tmp_path: Path) -> None:
    (tmp_path / "edit.py").write_text(PROGRAM.replace("GAIN = 1", "GAIN = 5"))
    trace = record(tmp_path, "sim")
    assert [thrust[0] for thrust in pages(trace, "pilot thrust")][:6] == [1, 2, 3, 5, 10, 5]
    replayed = replay(trace)
    first = replayed.divergences[0]
    assert (first.field, first.recorded, first.replayed) == ("pilot thrust[0]", 1, 5)
    sentences = describe_reloads(trace, replayed.records)
    assert len(sentences) == 4
    assert "'pilot' was reloaded with other code than the run began with" in sentences[0]
    assert (
        f"({tmp_path.name}/robot.py). This replay ran the current contents of the files from the beginning."
        in sentences[0]
    )
    assert "changed again" not in sentences[0]
    (tmp_path / "robot.py").write_text(PROGRAM)
    replayed = replay(trace)
    assert replayed.divergences[0].seq > first.seq
    assert "They have changed again since." in describe_reloads(trace, replayed.records)[0]


@pytest.mark.slow
def test_run_with_reloads_of_edited_files_replays_as_recorded_by_snr(tmp_path: Path) -> None:
    (tmp_path / "edit.py").write_text(PROGRAM.replace("GAIN = 1", "GAIN = 5"))
    trace = record(tmp_path, "sim")
    kept = read_kept_files(trace.path.parent)
    assert len({one.sha256 for one in kept if one.path.name == "robot.py"}) == 2
    (tmp_path / "robot.py").write_text("1 / 0\n")
    done = snr(tmp_path, "replay", trace.path.parent)
    assert done.stdout.startswith("identical: "), done.stdout + done.stderr
    assert "was reloaded with other code" not in done.stderr


@pytest.mark.slow
def test_reload_of_a_program_whose_file_was_emptied_fails_and_replays(tmp_path: Path) -> None:
    (tmp_path / "edit.py").write_text("")
    trace = record(tmp_path, "sim")
    page = pages(trace, "reload")[0]
    assert not page["ok"]
    assert "no longer has the class Pilot" in page["message"]
    done = snr(tmp_path, "replay", trace.path.parent)
    assert done.stdout.startswith("identical: "), done.stdout + done.stderr


def test_reload_of_a_program_keeps_only_what_its_start_alone_defines(tmp_path: Path) -> None:
    file = tmp_path / "robot.py"
    file.write_text("def gone(): pass\nif __name__ == '__main__':\n    def started(): pass\n")
    module = ModuleType("__main__")
    module.__file__ = str(file)
    exec(file.read_text(), vars(module))
    file.write_text("if __name__ == '__main__':\n    def started(): raise AssertionError\n")
    ModuleReload(module).execute()
    assert "gone" not in vars(module)
    assert module.started() is None


@pytest.mark.slow
def test_failed_reload_replays_with_recorded_invalid_source(tmp_path: Path) -> None:
    (tmp_path / "edit.py").write_text(PROGRAM.replace("GAIN = 1", "GAIN ="))
    trace = record(tmp_path, "sim")
    assert pages(trace, "reload")[0]["ok"] is False
    assert f"{tmp_path.name}/robot.py" in pages(trace, "reload")[0]["sources"]
    (tmp_path / "robot.py").write_text(PROGRAM)
    done = snr(tmp_path, "replay", trace.path.parent)
    assert done.stdout.startswith("identical: "), done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("clock", ["sim", "wall"])
def test_rollback_of_handler_and_of_loop_replays_identically_and_with_check(tmp_path: Path, clock: str) -> None:
    fails = PROGRAM.replace("        self.count += 1\n", "        self.count += 1\n        self.missing()\n")
    fails = fails.replace(
        "        self.factory.ticks += 1\n", "        self.factory.ticks += 1\n        self.absent()\n"
    )
    (tmp_path / "edit.py").write_text(fails)
    trace = record(tmp_path, clock)
    reloads = pages(trace, "reload")
    rolled_back = [page["component"] for page in reloads if "which was rolled back" in page["message"]]
    assert set(rolled_back) >= ({"pilot", "ticker"} if clock == "sim" else {"pilot"})
    counts = [count for _, count in pages(trace, "pilot thrust")]
    assert counts == list(range(1, len(counts) + 1))
    assert len(counts) > 10
    (tmp_path / "elsewhere").mkdir()
    replayed = snr(tmp_path / "elsewhere", "replay", trace.path.parent, "--check")
    assert replayed.stdout.startswith("identical: "), replayed.stdout + replayed.stderr
    changed = snr(tmp_path, "replay", trace.path.parent, "--with", "robot.py")
    assert changed.returncode == 1


@pytest.mark.slow
@pytest.mark.parametrize("clock", ["sim", "wall"])
def test_rollback_of_code_that_does_not_return_replays_identically(tmp_path: Path, clock: str) -> None:
    program = with_two_reloads(300)
    count, ticks = "        self.count += 1\n", "        self.factory.ticks += 1\n"
    hangs = program.replace(count, f"{count}        while True: pass\n")
    if clock == "sim":  # on the wall clock a loop has a thread of its own, which does not block the node
        hangs = hangs.replace(ticks, f"{ticks}        while True: pass\n")
    (tmp_path / "edit.py").write_text(hangs)
    trace = record(tmp_path, clock, program)
    rolled_back = [page["message"] for page in pages(trace, "reload") if "which was rolled back" in page["message"]]
    assert len(rolled_back) == (2 if clock == "sim" else 1)
    assert all("line 26: while True: pass\n  on_tick() of component 'pilot'" in one for one in rolled_back[:1])
    counts = [count for _, count in pages(trace, "pilot thrust")]
    assert counts == list(range(1, len(counts) + 1))
    assert len(counts) > 100
    replayed = snr(tmp_path, "replay", trace.path.parent, "--check")
    assert replayed.stdout.startswith("identical: "), replayed.stdout + replayed.stderr


@pytest.mark.slow
def test_rollback_for_a_page_that_a_link_cannot_send_replays_identically(tmp_path: Path) -> None:
    program = with_two_reloads(20).replace("SimClock, TaskType", "SimClock, SocketsPair, TaskType")
    program = program.replace('TickerFactory("ticker"),', 'TickerFactory("ticker"), LINK,')
    program = program.replace("GAIN =", "LINK = SocketsPair(('127.0.0.1', 1)).server(['pilot thrust'])\nGAIN =")
    made = 'self.store_data_task(f"{self.name} thrust", [GAIN * self.count, self.factory.count])'
    too_long = 'self.store_data_task("pilot thrust", self.factory.count << 70)'
    (tmp_path / "edit.py").write_text(program.replace(made, too_long))
    trace = record(tmp_path, "sim", program)
    _, first = (page["message"] for page in pages(trace, "reload") if page["component"] == "pilot")
    assert "pilot as before it." in first
    assert first.splitlines()[0].endswith(too_long)
    assert "'link_1' cannot send page 'pilot thrust': An integer needs more than 64 bits" in first
    assert isinstance(pages(trace, "pilot thrust")[-1], list)
    replayed = snr(tmp_path, "replay", trace.path.parent, "--check")
    assert replayed.stdout.startswith("identical: "), replayed.stdout + replayed.stderr


def snr(folder: Path, *words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "snr_sim", *map(str, words)]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60, check=False)


def test_input_that_adds_component_raises_on_replay_with_fix(tmp_path: Path) -> None:
    adding = FunctionLoopFactory(
        lambda loop: loop.schedule(tasks.add_component(FunctionEndpointFactory())), rate_hz=1.0
    )
    config = Config(factories={"r": [adding]})
    trace = read_trace(record_program("r", config, __file__, tmp_path, clock=SimClock(), until_s=0.5) / FILE_NAME)
    with pytest.raises(TraceError, match=r"add_component(.|\n)*a handler return tasks.add_component\(MyFactory\(\)\)"):
        replay_node(trace, "r", config)
