"""Random programs: each recorded run replays identically, whatever the components did and however the run ended."""

import shutil
import sys
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given, note

from snr_sim import SimClock, SimRunner, SynchronousRunner
from snr_sim.cli.replay import _replay
from snr_sim.core import interrupts
from snr_sim.core.output_recording import record_output
from snr_sim.prelude.errors import SnrError
from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.records import PageRecord, TraceInfo
from snr_sim.recording.sources import keep_copies, program_files
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario import library
from snr_sim.scenario.program import program_header
from snr_sim.scenario.replay_files import files_of_replay
from tests.recording.random_programs import HEAD, HELPERS, Program, programs, programs_with_processes


def record(folder: Path, program: Program) -> Path:
    file = folder / "robot.py"
    for one in (file, folder / "first.txt"):
        one.write_text(program.text)
    run = folder / "run"
    run.mkdir()
    config = library.load_program(str(file)).config
    clock = SimClock() if program.is_in_lock_step else None
    header = program_header(list(config.factories), config, file, clock, program.seed)
    writer = TraceWriter(run / FILE_NAME, header, TraceInfo.now("", str(file)))
    try:
        runner: SimRunner | SynchronousRunner
        if clock is None:
            runner = SynchronousRunner("r", config, recorder=writer, seed=program.seed)
            nodes = [runner.node]
        else:
            runner = SimRunner(
                config, clock=clock, recorder=writer, seed=program.seed, until_s=program.until_s, log_notes=False
            )
            nodes = list(runner.nodes.values())
        with keep_copies(run, program_files(file), library.is_own), record_output(nodes), suppress(SnrError):
            runner.run()
    finally:
        writer.close()
    return run


def check(program: Program, folder: Path) -> Trace:
    """Record a program in a folder, assert that its replay is identical, and return the trace."""
    path = list(sys.path)
    try:
        trace = read_trace(record(folder, program) / FILE_NAME)
        plan = files_of_replay(trace)
        done = _replay(trace, plan, "", [], is_checking=True)
        assert done.divergences == []
        assert done.calls == []
        assert (plan.is_recorded, plan.unknown) == (True, [])
        return trace
    finally:
        sys.path[:] = path
        shutil.rmtree(folder)


@pytest.mark.nightly
@given(program=programs())
def test_random_program_replays_identically(program: Program, tmp_path_factory: pytest.TempPathFactory) -> None:
    note(program.text)
    check(program, tmp_path_factory.mktemp("random"))


@pytest.mark.nightly(minutes=15)
@given(program=programs_with_processes())
def test_random_program_with_a_process_replays_identically(
    program: Program, tmp_path_factory: pytest.TempPathFactory
) -> None:
    note(program.text)
    check(program, tmp_path_factory.mktemp("process"))


# A loop edits the file at its second tick; `two` fails on the text of `one`.
EDITED = f"""{HEAD}{HELPERS}
class One(Parts, Endpoint):
    def begin(self):
        # begin
        self.bump()

    @handles(event="go")
    def on_event(self, task):
        # first
        self.bump()
        self.store_data("beta", self.count)
        # spare
        return self.store_data_task("alpha", [self.count, self.factory.total])


class Two(Endpoint):
    def begin(self):
        global NODE
        NODE = self.parent

    @handles("alpha")
    def on_page(self, data):
        self.store_data("gamma", data)
        return self.store_data_task("far", [number + 1 for number in data])


class Beat(Parts, Loop):
    max_tick_rate_hz = 10.0

    def setup(self):
        # setup
        pass

    def loop(self):
        # loop
        self.bump()
        if self.factory.total == 2:
            Path(__file__).write_text(Path(__file__).with_name("edited.txt").read_text())
            self.schedule(tasks.reload_component("one", "beat"))
        self.schedule(tasks.event("go"))


# top
made = [One.factory("one"), Two.factory("two"), Beat.factory("beat")]
config = Config(factories={{"r": made}}, max_tasks_per_moment=1000)
"""


def test_reload_whose_page_was_not_stored_when_the_run_ended_replays_identically(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    folder, reload = tmp_path_factory.mktemp("ended"), 'tasks.reload_component("one", "beat")'
    (folder / "edited.txt").write_text("")
    text = EDITED.replace(reload, f'[{reload}, tasks.event("stop")]')
    fails = '    @handles(event="stop")\n    def on_stop(self, task):\n        raise ValueError\n\n'
    trace = check(Program(text.replace('    @handles("alpha")', fails + '    @handles("alpha")'), 0, 1.0), folder)
    assert not [one for one in trace.records if isinstance(one, PageRecord) and one.name == "reload"]


@pytest.mark.parametrize(
    ("place", "line", "outcome"),
    [
        ("# first", "hang(self)", "one, beat as before it"),
        ("# spare", "hang(self)", "one, beat as before it"),
        ("# spare", "self.store_data('alpha', 1)", "'one' has made page"),
        ("# begin", "hang(self)", "Kept as before: one"),
        ("# loop", "hang(self)", "one, beat as before it"),
        ("# loop", "self.store_data('alpha', 1)", "'beat' has made page"),
        ("# setup", "self.missing()", "Kept as before: beat"),
        ("# setup", "hang(self)", "Kept as before: beat"),
        ("# spare", "self.schedule(tasks.event(5))", "one, beat as before it"),
        ("# loop", "self.schedule(tasks.event(5))", "one, beat as before it"),
        ("# loop", "self.schedule([tasks.event('go')] * 1001)", "one, beat as before it"),
        ("# loop", "self.next_tick_at_s = 0.0", "one, beat as before it"),
        ("# top", "while interrupt_new_code(NODE, 'It has not returned.'): pass", "Kept as before: one, beat"),
    ],
)
def test_run_with_an_edit_that_is_interrupted_or_fails_others_replays_identically(
    place: str,
    line: str,
    outcome: str,
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(interrupts, "SIGNALS", 1)  # they are sent by the thread that gets them
    folder = tmp_path_factory.mktemp("edited")
    (folder / "edited.txt").write_text(EDITED.replace(place, line))
    trace = check(Program(EDITED, 0, 1.0), folder)
    pages = [one for one in trace.records if isinstance(one, PageRecord) and one.name == "reload"]
    assert outcome in bytes(pages[-1].values).decode()
