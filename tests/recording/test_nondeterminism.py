"""Outside calls are reported with the student's line; repeatable calls are not reported."""

import gc
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from snr_sim import Config, SimClock, SimRunner
from snr_sim.recording.nondeterminism import NondeterministicCall, detect_nondeterminism, unwatched
from snr_sim.recording.reader import read_trace
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.library import load_program
from snr_sim.scenario.program import program_header

ROBOT = """
import datetime, logging, os, random, secrets, socket, subprocess, tempfile, threading, time, traceback, uuid
import numpy as np
from datetime import datetime as moment
from pathlib import Path
from random import gauss as bell
from time import perf_counter as stopwatch
from snr_sim import Config, Endpoint, EndpointFactory, TaskType, tasks
from snr_sim.testing.function_components import FunctionLoopFactory

HERE = Path(__file__)
OLD_GENERATOR = random.Random(5)
SEEDED = np.random.default_rng(5)
{at_load}

class Asker(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.task_handlers = {{(TaskType.process_data, "depth"): self.on_depth}}
        self.text = HERE.read_text()  # put together before the run: this repeats

    def on_depth(self, task, task_id):
        {line}  # the line

class AskerFactory(EndpointFactory):
    def get(self, parent):
        return Asker(self, parent, "asker")

def once(loop):
    loop.store_data("depth", 1.0)
    loop.stop()

config = Config(factories={{"r": [FunctionLoopFactory(once), AskerFactory()]}})
"""


def detected(tmp_path: Path, line: str, at_load: str = "") -> list[NondeterministicCall]:
    file = tmp_path / "asker.py"
    file.write_text(ROBOT.format(line=line, at_load=at_load))
    config: Config = load_program(str(file)).config
    clock = SimClock()
    writer = TraceWriter(tmp_path / FILE_NAME, program_header(["r"], config, file, clock))
    SimRunner(config, clock=clock, recorder=writer).run()
    writer.close()
    trace = read_trace(writer.path)
    with detect_nondeterminism() as calls:
        replay_node(trace, "r", load_program(str(file)).config)
    return list(calls.values())


ASKS = [
    ("time.time()", "time.time()"),
    ("time.monotonic_ns()", "time.monotonic_ns()"),
    ("stopwatch()", "time.perf_counter()"),
    ("time.strftime('%H')", "time.strftime()"),
    ("time.sleep(0)", "time.sleep()"),
    ("moment.now()", "datetime.now()"),
    ("datetime.date.today()", "date.today()"),
    ("random.random()", "random.random()"),
    ("random.gauss(0, 1)", "random.gauss()"),
    ("bell(0, 1)", "random.gauss()"),
    ("random.choice([1, 2])", "random.choice()"),
    ("random.shuffle([1, 2])", "random.shuffle()"),
    ("random.Random()", "random.Random()"),
    ("random.Random().random()", "random.Random()"),
    ("random.seed()", "random.seed()"),
    ("random.SystemRandom().random()", "random.SystemRandom.random() (os.urandom())"),
    ("os.urandom(4)", "os.urandom()"),
    ("uuid.uuid4()", "uuid.uuid4()"),
    ("secrets.token_hex()", "urandom"),
    ("np.random.normal()", "numpy.random.normal()"),
    ("np.random.rand(3)", "numpy.random.rand()"),
    ("np.random.default_rng()", "urandom"),
    ("open(__file__).close()", "reading"),
    ("open(__file__, 'r+').close()", "reading"),
    ("HERE.read_text()", "reading"),
    ("HERE.read_bytes()", "reading"),
    ("os.close(os.open(__file__, os.O_RDONLY))", "reading"),
    ("np.fromfile(HERE, dtype='u1')", "reading"),
]
# These start threads or processes.
SLOW_ASKS = [
    ("threading.Thread(target=print, args=('',)).start()", "threading.Thread.start() (starting a thread)"),
    ("threading.Timer(0, int).start()", "starting a thread"),
    ("subprocess.run(['true'])", "starting a process"),
    ("os.system('true')", "starting a process"),
    ("with socket.socket() as link: link.connect_ex(('127.0.0.1', 9))", "opening a connection"),
]

LEGITIMATE = [
    "self.rng.normal()",
    "self.rng.random(300)",
    "SEEDED.normal()",
    "np.random.default_rng(5).normal()",
    "np.random.Generator(np.random.PCG64(5)).normal()",
    "random.Random(5).random()",
    "OLD_GENERATOR.gauss(0, 1)",
    "self.get_time_s()",
    "import colorsys, email.mime.audio",
    "open(tempfile.gettempdir() + '/snr_sim_test_outside', 'w').close()",
    "open(tempfile.gettempdir() + '/snr_sim_test_outside', 'ab').close()",
    "self.log.warning('deep')",
    "logging.getLogger('x').error('deep')",
    "traceback.format_stack()",
    "return self.store_data_task('x', [1.0])",
    "return tasks.terminate('done')",
    "datetime.datetime(2021, 1, 1) + datetime.timedelta(days=1)",
    "sorted({3, 1, 2}), hash((1, 2)), sum(np.linspace(0, 1, 9))",
    "print('hello')",
]


@pytest.mark.parametrize(("line", "what"), [*ASKS, *(pytest.param(*ask, marks=pytest.mark.slow) for ask in SLOW_ASKS)])
def test_nondeterministic_call_is_reported_with_file_and_line(tmp_path: Path, line: str, what: str) -> None:
    calls = detected(tmp_path, line)
    number = ROBOT.format(line=line, at_load="").splitlines().index(f"        {line}  # the line") + 1
    assert [(Path(one.file).name, one.line) for one in calls] == [("asker.py", number)]
    assert what in calls[0].what
    assert "__" not in calls[0].what  # as written in the source line
    assert "does not repeat; " in str(calls[0])


@pytest.mark.parametrize("line", LEGITIMATE)
def test_deterministic_call_is_not_reported(tmp_path: Path, line: str) -> None:
    assert detected(tmp_path, line) == []


def test_import_reports_random_numbers_but_not_file_reads(tmp_path: Path) -> None:
    calls = detected(
        tmp_path, "pass", "MODEL = HERE.read_text()\nCHANCE = np.random.default_rng()\nBEGUN = time.time()"
    )
    lines = (tmp_path / "asker.py").read_text().splitlines()
    assert [lines[one.line - 1].split()[0] for one in calls] == ["CHANCE", "BEGUN"]


def test_calls_of_the_watching_code_are_not_reported() -> None:
    with detect_nondeterminism() as calls:
        time.time()
    assert calls == {}


def test_garbage_collector_callbacks_are_not_reported(tmp_path: Path) -> None:
    gc.callbacks.append(lambda phase, info: time.perf_counter())
    try:
        assert detected(tmp_path, "import gc; gc.collect()") == []
    finally:
        gc.callbacks.pop()


def test_detect_nondeterminism_restores_everything_on_exit() -> None:
    before = np.random.normal
    profile = sys.getprofile()
    with detect_nondeterminism():
        assert np.random.normal is not before
    assert np.random.normal is before
    assert sys.getprofile() is profile


def test_unwatched_function_runs_without_the_profiler() -> None:
    seen = []
    with detect_nondeterminism():
        watcher = sys.getprofile()
        unwatched(lambda: seen.append(sys.getprofile()))()
        with pytest.raises(ZeroDivisionError):
            unwatched(lambda: 1 / 0)()
        seen.append(sys.getprofile())
    assert seen == [None, watcher]
    assert watcher is not None


def test_line_with_thousand_calls_is_reported_once(tmp_path: Path) -> None:
    assert len(detected(tmp_path, "[random.random() for _ in range(1000)] and time.time()")) == 1


def test_hint_names_the_deterministic_alternative(tmp_path: Path) -> None:
    def hint(line: str) -> Any:
        (tmp_path / FILE_NAME).unlink(missing_ok=True)
        return detected(tmp_path, line)[0].hint

    assert "self.get_time_s()" in hint("time.time()")
    assert "self.rng" in hint("random.random()")
    assert "self.rng" in hint("np.random.default_rng()")
    assert "Loop" in hint("open(__file__).close()")


def test_file_name_in_bytes_is_accepted(tmp_path: Path) -> None:
    assert len(detected(tmp_path, "open(os.fsencode(__file__)).close()")) == 1
