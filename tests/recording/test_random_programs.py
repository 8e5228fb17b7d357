"""Random programs: each recorded run replays identically, whatever the components did and however the run ended."""

import shutil
import sys
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given, note

from snr_sim import SimClock, SimRunner
from snr_sim.cli.replay import _replay
from snr_sim.core.output_recording import record_output
from snr_sim.prelude.errors import SnrError
from snr_sim.recording.reader import read_trace
from snr_sim.recording.records import TraceInfo
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario import library
from snr_sim.scenario.program import _files_of, program_header
from snr_sim.scenario.replay_files import files_of_replay
from tests.recording.random_programs import Program, programs


def record(folder: Path, program: Program) -> Path:
    file = folder / "robot.py"
    for one in (file, folder / "first.txt"):
        one.write_text(program.text)
    run = folder / "run"
    run.mkdir()
    config = library.load_program(str(file)).config
    clock = SimClock()
    header = program_header(list(config.factories), config, file, clock, program.seed)
    writer = TraceWriter(run / FILE_NAME, header, TraceInfo.now("", str(file)))
    try:
        runner = SimRunner(
            config, clock=clock, recorder=writer, seed=program.seed, until_s=program.until_s, log_notes=False
        )
        with library.keep_copies(run, _files_of(file)), record_output(list(runner.nodes.values())), suppress(SnrError):
            runner.run()
    finally:
        writer.close()
    return run


@pytest.mark.nightly
@given(program=programs())
def test_random_program_replays_identically(program: Program, tmp_path_factory: pytest.TempPathFactory) -> None:
    note(program.text)
    folder, path = tmp_path_factory.mktemp("random"), list(sys.path)
    try:
        trace = read_trace(record(folder, program) / FILE_NAME)
        plan = files_of_replay(trace)
        done = _replay(trace, plan, "", [], is_checking=True)
        assert done.divergences == []
        assert done.calls == []
        assert (plan.is_recorded, plan.unknown) == (True, [])
    finally:
        sys.path[:] = path
        shutil.rmtree(folder)
