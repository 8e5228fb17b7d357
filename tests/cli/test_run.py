"""`snr run`: its output and files, for valid requests and for every kind of invalid one."""

import json
import os
import subprocess
import sys
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from snr_sim.cli.arguments import pace_of
from snr_sim.recording.folder import RESULT_NAME
from snr_sim.recording.reader import read_trace
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.library import find
from tests.on_thread import wait_for

Snr = Callable[..., Any]
Mine = Callable[..., Path]

WIRED = '        return self.store_data_task("engine", {"throttle": 0.2})'
RUN = ("run", "lander_vertical", "--no-rrd")


def run_folder(here: Path) -> Path:
    (folder,) = (here / "runs").iterdir()
    return folder


def assert_nothing_written(here: Path) -> None:
    assert not (here / "runs").exists()


# A good run


def test_run_json_equals_result_file(snr: Snr, here: Path) -> None:
    answer = snr(*RUN, "--json")
    assert answer.status == 0
    fields = answer.json
    assert {
        "scenario", "seed", "engine", "success", "outcome", "touchdown", "fuel_kg", "fuel_optimum_kg",
        "fuel_optimum_to_rest_kg", "fuel_ratio",
        "sim_time_s", "wall_time_s", "tasks", "pages", "trace_digest", "run_dir",
    } <= fields.keys()  # fmt: skip
    assert fields["touchdown"].keys() == {"vertical_mps", "lateral_mps", "attitude_deg", "rate_degps"}
    assert (fields["outcome"], fields["success"], fields["seed"]) == ("landed", True, 0)
    folder = run_folder(here)
    assert Path(fields["run_dir"]) == folder.relative_to(here)
    assert json.loads((folder / RESULT_NAME).read_bytes()) == fields
    assert read_trace(folder / FILE_NAME).digest == fields["trace_digest"]
    assert sorted(path.name for path in folder.iterdir()) == [RESULT_NAME, FILE_NAME]
    assert answer.err == ""


def test_run_prints_outcome_and_folder(snr: Snr, here: Path) -> None:
    answer = snr(*RUN)
    assert answer.status == 0
    assert "lander_vertical, seed 0, controller optimal: landed" in answer.out
    assert f"run folder: {run_folder(here).relative_to(here)}" in answer.out


START_LINES = """

def start_lines(robot):
    return {}
"""


def saying(mine: Mine, returned: str) -> str:
    path = mine()
    path.write_text(path.read_text() + START_LINES.format(returned))
    return str(path)


def test_run_prints_start_lines_of_controller_except_with_json(snr: Snr, mine: Mine) -> None:
    path = saying(mine, '[f"failsafe  none of {robot.name}"]')
    assert "failsafe  none of lander\n" in snr(*RUN, "--controller", path).out
    assert "failsafe" not in snr(*RUN, "--controller", path, "--json").err


@pytest.mark.parametrize(
    ("returned", "expected"), [("'one'", "returned 'one'"), ("[1]", "returned [1]"), ("1 / 0", "zero")]
)
def test_invalid_start_lines_are_rejected_before_the_run(
    snr: Snr, here: Path, mine: Mine, returned: str, expected: str
) -> None:
    answer = snr(*RUN, "--controller", saying(mine, returned))
    assert answer.status == 2
    assert expected in answer.err
    assert_nothing_written(here)


def test_failed_criterion_returns_status_1(snr: Snr) -> None:
    answer = snr(*RUN, "--controller", "coast", "--json")
    assert (answer.status, answer.json["outcome"], answer.json["success"]) == (1, "crashed", False)
    assert "crashed: vertical 56.921 m/s is over 3.05 m/s." in answer.json["notes"]
    assert answer.json["touchdown"].keys() == {"vertical_mps", "lateral_mps", "attitude_deg", "rate_degps"}


def test_same_seed_gives_same_digest_and_other_seed_another(snr: Snr) -> None:
    digests = [
        snr("run", "lander_pad", "--no-rrd", "--json", "--seed", seed).json["trace_digest"] for seed in (7, 7, 8)
    ]
    assert digests[0] == digests[1] != digests[2]


@pytest.mark.slow
def test_digest_is_equal_in_process_with_other_hash_seed(snr: Snr, here: Path) -> None:
    mine = snr("run", "lander_pad", "--no-rrd", "--json", "--seed", 7).json["trace_digest"]
    for hash_seed in ("1", "2"):
        command = [sys.executable, "-m", "snr_sim", "run", "lander_pad", "--no-rrd", "--json", "--seed", "7"]
        environment = {**os.environ, "PYTHONHASHSEED": hash_seed}
        done = subprocess.run(command, capture_output=True, check=True, env=environment)
        assert json.loads(done.stdout)["trace_digest"] == mine


def test_controller_in_other_folder_gives_same_digest(snr: Snr, here: Path, mine: Mine) -> None:
    first = snr(*RUN, "--json", "--controller", mine()).json
    (here / "elsewhere").mkdir()
    second = snr(*RUN, "--json", "--controller", mine(name="elsewhere/mine.py")).json
    assert first["trace_digest"] == second["trace_digest"]


def test_view_changes_neither_run_nor_result(snr: Snr) -> None:
    pytest.importorskip("rerun")
    with_view = snr("run", "lander_vertical", "--rrd", "--json").json
    without = snr("run", "lander_vertical", "--json").json
    assert {path.name for path in Path(without["run_dir"]).iterdir()} == {"trace.jsonl", "result.json"}
    assert (Path(with_view["run_dir"]) / "view.rrd").stat().st_size > 1000
    for changing in ("wall_time_s", "run_dir"):
        del with_view[changing], without[changing]
    assert with_view == without


@pytest.mark.parametrize("seed", [-1, -(2**40), 2**63, 10**30])
def test_any_whole_number_is_a_seed(snr: Snr, seed: int) -> None:
    answer = snr(*RUN, "--json", "--seed", seed)
    assert answer.status in (0, 1)
    assert answer.json["seed"] == seed


@pytest.mark.parametrize("speed", ["0", "nan", "-1", "abc", "inf", ""])
def test_invalid_speed_is_rejected(snr: Snr, here: Path, speed: str) -> None:
    answer = snr(*RUN, "--speed", speed)
    assert answer.status == 2
    assert f"--speed must be 'fast', 'real' or a number greater than 0, not '{speed}'." in answer.err
    assert_nothing_written(here)


def test_speed_is_virtual_seconds_per_wall_second(snr: Snr) -> None:
    assert (pace_of("fast"), pace_of("real"), pace_of("2.5")) == (None, 1.0, 2.5)
    fields = snr(*RUN, "--speed", "100", "--json").json
    assert fields["wall_time_s"] > 0.9 * fields["sim_time_s"] / 100


# Wrong requests: a sentence, status 2, and nothing written


WRONG = [
    (("run", "lander_verticl"), "no scenario 'lander_verticl'", "did you mean 'lander_vertical'?"),
    (("run", "./no.py"), "no scenario './no.py'", "Try: one of: "),
    (("run", ""), "no scenario ''", "Try: one of: "),
    ((*RUN, "--controller", "optiml"), "no controller 'optiml'", "did you mean 'optimal'?"),
    ((*RUN, "--controller", "optiml"), "robot 'lander' has none of that name", "Or a file: --controller ./mine.py."),
    ((*RUN, "--controller", "./no.py"), "There is no file './no.py'.", "Try: by name, one of: coast, "),
    ((*RUN, "--controller", "no/where.py"), "no file 'no/where.py', nor a folder no.", "Try: by name, one of: coast, "),
    ((*RUN, "--controller", "."), "controller '.' is a folder, not a Python file", "Try: by name, one of: coast, "),
    ((*RUN, "--controller", "/dev/null"), "'/dev/null' is not a file that can be read", "Try: by name, one of: "),
    ((*RUN, "--role", "landr"), "no role 'landr'", "did you mean 'lander'?"),
    ((*RUN, "--engine", "pymnk"), "does not run on engine 'pymnk'", "Try: 'closed_form' is the only one."),
    ((*RUN, "--io", "pi"), "no devices for --io pi", "Try: one of: emulated, loopback, maestro, mcu"),
    ((*RUN, "--option", "t_go_s"), "--option t_go_s is not KEY=VALUE", "Try: --option"),
    ((*RUN, "--option", "t_go_s=60"), "--option t_go_s=...: there is no such option here.", "Try: leave it out."),
    (
        ("run", "urov_teleop", "--option", "pilto=manual"),
        "no such option here",
        "did you mean 'pilot'? One of: allow, camera, ",
    ),
    (("run", "urov_teleop", "--option", "port=9130", "--option", "prot=9"), "--option prot=", "did you mean 'port'?"),
    (
        ("run", "urov_teleop", "--option", "port=9120", "--option", "port=9121"),
        "port=9120 and port=9121",
        "leave one of them out.",
    ),
    (("run", "urov_teleop", "--role", "topside", "--speed", "4"), "runs alone, in real time only", "--speed real"),
    ((*RUN, "--io", "mcu:/dev/ttyNowhere", "--speed", "4"), "has devices that run in real time only", "Try: "),
    ((*RUN, "--io", "mcu:/dev/ttyNowhere"), "no serial port /dev/ttyNowhere", "Try: "),
    ((*RUN, "--io", "mcu"), "mcu:PORT", "Try: "),
    ((*RUN, "--io", "maestro:/dev/null,crc=perhaps"), "crc=yes or crc=no", "Try: "),
    ((*RUN, "--io", "pca9685:1:0x40,oscillator_hz=nan"), "23e6 to 27e6 Hz", "Try: "),
    ((*RUN, "--io", "replay:nowhere"), "There is no run at", "Try: "),
    ((*RUN, "--io", "sin"), "did you mean 'sim'", "Try: "),
    ((*RUN, "--watch"), "--watch needs --speed", "--watch --speed real"),
    ((*RUN, "--seed", "seven"), "--seed seven: it takes a whole number.", "--seed 3"),
    ((*RUN, "--bogus"), "No such option: --bogus", "--help"),
    (("runn",), "No such command", "--help"),
    (("run",), "Missing argument", "--help"),
]


@pytest.mark.parametrize(("words", "found", "fix"), WRONG)
def test_invalid_request_returns_status_2_with_fix(
    snr: Snr, here: Path, words: tuple[str, ...], found: str, fix: str
) -> None:
    answer = snr(*words)
    assert answer.status == 2
    assert found in answer.err
    assert fix in answer.err
    assert answer.out == ""
    as_json = snr(*words, "--json")
    assert as_json.status == 2
    assert found in as_json.json["error"]
    assert list(here.iterdir()) == []


def test_unwritable_out_is_rejected(snr: Snr, here: Path) -> None:
    (here / "file").write_text("mine")
    for out in ("file", "file/below", "/proc/snr"):
        answer = snr(*RUN, "--out", out, "--json")
        assert answer.status == 2
        assert "--out" in answer.json["error"]
    assert (here / "file").read_text() == "mine"
    assert [path.name for path in here.iterdir()] == ["file"]


def test_runs_within_one_second_get_separate_folders(snr: Snr, here: Path) -> None:
    folders = {snr(*RUN, "--json", "--out", "here/and/there").json["run_dir"] for _ in range(3)}
    assert len(folders) == 3
    assert all((here / folder / RESULT_NAME).is_file() for folder in folders)


# Controller files that cannot be used: found before anything is written

MADE = "return [MineFactory()]"
UNUSABLE = [
    (("return [MineFactory()]", "return [MineFactory("), "mine.py, line 5: ", "SyntaxError"),
    (("from snr_sim import", "import no_such_package\nfrom snr_sim import"), "mine.py, line 2: import no_such_package",
     "ModuleNotFoundError"),
    (("def factories(robot):", "1 / 0\ndef factories(robot):"), "mine.py, line 4: 1 / 0", "ZeroDivisionError"),
    (("def factories(robot):", "exit(0)\ndef factories(robot):"), "mine.py, line 4: exit(0)", "SystemExit"),
    (("def factories(robot):", "def factory(robot):"), "mine.py has no `factories`", "def factories(robot)"),
    (("def factories(robot):\n    return [MineFactory()]", "factories = []"), "`factories` is [], not a function",
     "def factories(robot)"),
    (("def factories(robot):", "def factories():"), "factories() is called with 1",
     "def factories():"),
    ((MADE, "return None"), "returned None, which is not a list", "return [MyEndpointFactory()]"),
    ((MADE, "return 42"), "returned 42, which is not a list", "return [MyEndpointFactory()]"),
    ((MADE, "return MineFactory()"), "which is not a list", "return [MyEndpointFactory()]"),
    ((MADE, "return [MineFactory]"), "which is not a factory", "with the brackets"),
    ((MADE, "return [Mine]"), "which is not a factory", "with the brackets"),
    ((MADE, "return [None]"), "a list with None, which is not a factory", "with the brackets"),
    ((MADE, "return [robot.parametrs]"), "mine.py, line 5: return [robot.parametrs]", "AttributeError"),
    ((MADE, "return [MineFactory(), MineFactory()]"), "two components named 'mine'", "a name of its own"),
    ((MADE, "exit(0)"), "mine.py, line 5: exit(0)", "SystemExit"),
    (('return Mine(self, parent, "mine")', "return None"), "MineFactory.get() of role 'lander' returned None",
     "return MyEndpoint"),
    (('return Mine(self, parent, "mine")', "return Mine()"), "mine.py, line 9: return Mine()",
     "missing 3 required positional arguments"),
    (('return Mine(self, parent, "mine")', "pass"), "but should return an Endpoint", "return MyEndpoint"),
    (("super().__init__(factory, parent, name)", "pass"), "mine.py, line 15: ", "super().__init__(factory, parent"),
    (("self.ticks = 0", "self.ticks = 1 / 0"), "mine.py, line 14: self.ticks = 1 / 0", "ZeroDivisionError"),
    (("def on_radar(self, task, task_id):", "def on_radar(self, task):"), "mine.py, line 15: self.task_handlers = ",
     "Try: def on_radar(self, task, task_id)"),
    (("self.ticks += 1", "yield"), "'mine.on_radar' for process_data 'radar' is a generator function: it has a yield.",
     "Try: return a list of tasks instead of the yields."),
    (("def on_radar", "async def on_radar"), "'mine.on_radar' for process_data 'radar' is an async function",
     "Try: write def without async"),
    (("self.on_radar}", "self.on_radar()}"), "mine.py, line 15: ", "missing 2 required positional arguments"),
    (("self.on_radar}", "self.on_rader}"), "mine.py, line 15: ", "on_rader"),
    (('(TaskType.process_data, "radar")', '"radar"'), "mine.py, line 15: ", "a key is TaskType.event"),
    (('(TaskType.process_data, "radar")', '("radar", TaskType.process_data)'), "the two are swapped", "Try: (TaskType"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("change", "found", "fix"), UNUSABLE, ids=lambda value: value[1][:40] if len(value) == 2 else ""
)
def test_unusable_controller_is_reported_and_nothing_is_written(
    snr: Snr, here: Path, mine: Mine, change: tuple[str, str], found: str, fix: str
) -> None:
    answer = snr(*RUN, "--controller", mine(change), "--json")
    assert answer.status == 2
    error = answer.json["error"]
    assert found in error
    assert fix in error
    assert answer.err.strip() == error
    if found.startswith("mine.py, line"):
        assert error.startswith("mine.py, line")  # the student's line comes first
    assert "snr_sim/" not in error
    assert_nothing_written(here)


NO_PYTHON = [
    (b"\xff\xfe\x00", "mine.py, line 1: this is not Python source: byte 0xff is not text."),
    (b"# one\nx = '\xe4'", "mine.py, line 2: this is not Python source: byte 0xe4 is not text."),
    (b"x = 1\n\ny = 2\x00", "mine.py, line 3: this is not Python source: byte 0x00 is not text."),
    (b"# coding: latin-1\nx = '\xe4'\nx = =", "mine.py, line 3: x = ="),
    (b"# coding: klingon\nx = 1", "unknown encoding: klingon"),
    (b" \n", "mine.py is empty: it has no `factories`, which a controller needs."),
]


@pytest.mark.parametrize(("content", "expected"), NO_PYTHON)
def test_non_python_controller_is_reported(snr: Snr, here: Path, content: bytes, expected: str) -> None:
    (here / "mine.py").write_bytes(content)
    answer = snr(*RUN, "--controller", "mine.py", "--json")
    assert answer.status == 2
    assert expected in answer.json["error"]
    assert_nothing_written(here)


def test_missing_controller_file_suggests_nearest(snr: Snr, mine: Mine) -> None:
    mine(name="mine.py")
    assert (
        "Try: did you mean 'mine.py'? In . there are: mine.py. Or by name, "
        in snr(*RUN, "--controller", "./min.py").err
    )
    assert "Try: a file in it: --controller mine.py. Or by name, " in snr(*RUN, "--controller", ".").err


def test_run_that_a_component_ends_prints_its_reason(snr: Snr, here: Path, mine: Mine) -> None:
    answer = snr(*RUN, "--controller", mine((WIRED, f"        return tasks.terminate('far enough')\n{WIRED}")))
    assert (answer.status, "note: ended: far enough." in answer.err) == (1, True)
    assert json.loads((run_folder(here) / RESULT_NAME).read_text())["notes"] == ["ended: far enough."]


# Controllers that fail during the run: the recording is complete up to the failure

LATE = "if now_s >= 30.0: "
FAILING = [
    ("raise ValueError('too low')", "ValueError: too low", "process_data 'radar' at t = 30.0"),
    ("1 / 0", "ZeroDivisionError: division by zero", "in on_radar(), component 'mine'"),
    ("exit(0)", "SystemExit: 0", "tasks.terminate('why')"),
    ("import sys; sys.exit()", "SystemExit", "tasks.terminate('why')"),
    ("return 42", "'mine.on_radar' returned 42, which is not a task", "a Task or a list of Tasks"),
    ("return 'burn'", "'mine.on_radar' returned 'burn'", "did you mean tasks.event('burn')?"),
    ("return [None]", "a list with None, which is not a task", "a Task or a list of Tasks"),
    ("return TaskType.event", "which is not a task", "tasks.event('name')"),
    ("return self.get_data('radarr')['altitude_m']", "TypeError: 'NoneType' object is not subscriptable", "line"),
    ("return tasks.event(5)", "5", ""),
    ("raise KeyboardInterrupt", "", ""),
]


@pytest.mark.parametrize(("line", "found", "fix"), FAILING)
def test_failing_controller_leaves_trace_complete_up_to_failure(
    snr: Snr, here: Path, mine: Mine, line: str, found: str, fix: str
) -> None:
    path = mine((WIRED, f"        {LATE}{line}\n{WIRED}"))
    answer = snr(*RUN, "--controller", path, "--json")
    assert answer.status == 1
    fields = answer.json
    assert fields["outcome"] == ("interrupted" if "Keyboard" in line else "error")
    folder = run_folder(here)
    assert json.loads((folder / RESULT_NAME).read_bytes()) == fields
    trace = read_trace(folder / FILE_NAME)
    assert trace.digest == fields["trace_digest"]
    assert trace.is_ended
    assert trace.records[-1].t == pytest.approx(30.0, abs=0.11)
    if fields["outcome"] == "error":
        number = path.read_text().splitlines().index(f"        {LATE}{line}") + 1
        assert found in fields["error"]
        assert fix in fields["error"]
        if "returned" in found or "not a task" in found:
            assert fields["error"].startswith("mine.py, line 17: def on_radar(self, task, task_id):")
        elif "event(5)" not in line:
            assert fields["error"].startswith(f"mine.py, line {number}: {LATE}{line}")
    replayed = snr("replay", folder)
    assert replayed.status == 0, replayed.out


@pytest.mark.parametrize("line", ["raise ValueError(object())", "return [object()]", "return (one for one in [])"])
def test_digest_is_independent_of_memory_addresses(snr: Snr, mine: Mine, line: str) -> None:
    path = mine((WIRED, f"        self.kept = [object() for _ in range(id(self) % 97)]\n        {line}\n{WIRED}"))
    answers = [snr(*RUN, "--controller", path, "--json").json for _ in range(2)]
    assert answers[0]["trace_digest"] == answers[1]["trace_digest"]
    assert "0x" not in answers[0]["error"]


COMMANDS = [
    ("float('nan')", "engine.throttle must be a finite number, not nan."),
    ("float('inf')", "engine.throttle must be a finite number, not inf."),
    ("'full'", "throttle is the text 'full', but must be a number from 0 to 1."),
    ("None", "throttle is None, but must be a number"),
    ("[0.5]", "throttle is the list [0.5], but must be a number"),
    ("True", "throttle is True, but must be a number"),
]


@pytest.mark.parametrize(("value", "found"), COMMANDS)
def test_invalid_command_stops_run_and_names_value(snr: Snr, mine: Mine, value: str, found: str) -> None:
    answer = snr(*RUN, "--controller", mine(("0.2", value)), "--json")
    assert (answer.status, answer.json["outcome"]) == (1, "error")
    assert found in answer.json["error"]
    assert "Try: " in answer.json["error"]
    assert answer.json["error"].startswith("mine.py, line 20: return self.store_data_task(")
    assert "It was stored at t = 0.000 s by on_radar() of component 'mine'." in answer.json["error"]


def test_unknown_command_field_suggests_nearest(snr: Snr, mine: Mine) -> None:
    answer = snr(*RUN, "--controller", mine(('"throttle"', '"throtle"')), "--json")
    assert (answer.status, answer.json["outcome"]) == (1, "error")
    assert "did you mean 'throttle'?" in answer.json["error"]


def test_command_out_of_range_is_clamped_and_logged_once(snr: Snr, mine: Mine) -> None:
    for value in ("1.5", "-3"):
        fields = snr(*RUN, "--controller", mine(("0.2", value)), "--json").json
        assert len([note for note in fields["notes"] if "clamped" in note]) == 1
        assert fields["outcome"] != "error"


def test_controller_without_components_is_noted(snr: Snr, mine: Mine) -> None:
    answer = snr(*RUN, "--controller", mine(("return [MineFactory()]", "return []")), "--json")
    assert answer.status == 1
    assert "mine.py: factories(robot) returned [], so no component controls the robot." in answer.json["notes"]


def test_unhandled_tasks_are_noted_with_nearest_name(snr: Snr, mine: Mine) -> None:
    handlers = '{(TaskType.process_data, "radr"): self.on_radar, (TaskType.event, "ignition"): self.on_radar}'
    path = mine(('{(TaskType.process_data, "radar"): self.on_radar}', handlers))
    answer = snr(*RUN, "--controller", path, "--json")
    notes = "\n".join(answer.json["notes"])
    assert "process_data 'radr'" in notes
    assert "did you mean 'radar'?" in notes
    assert "event 'ignition', which was never sent" in notes
    assert "note: " in answer.err
    asks = mine((WIRED, "        self.get_data('motor')\n        return tasks.event('ignite')"))
    notes = "\n".join(snr(*RUN, "--controller", asks, "--json").json["notes"])
    assert "Page 'motor' was requested but never stored" in notes
    assert "No component handled event 'ignite'" in notes


# Faulty controllers

FAULTY_HANDLERS = [
    "print('altitude')",
    "import os; os.write(1, b'altitude')",
    "import subprocess; subprocess.run(['echo', 'altitude'])",
    "import sys; sys.stdout.close()",
    "import sys; sys.stdout.write('x'); sys.stdout.flush(); sys.stdout = None",
    "import os; os.close(1)",
    "import os; os.chdir('/')",
]


@pytest.mark.slow
@pytest.mark.parametrize("line", FAULTY_HANDLERS)
@pytest.mark.parametrize("place", ["at load", "in a handler"])
def test_faulty_handlers_leave_json_and_files_intact(snr: Snr, here: Path, mine: Mine, line: str, place: str) -> None:
    at_load = ("def factories(robot):", f"{line}\ndef factories(robot):")
    in_handler = (WIRED, f"        if self.ticks == 5:\n            {line}\n{WIRED}")
    path = mine(at_load if place == "at load" else in_handler)
    before = Path.cwd()
    try:
        answer = snr(*RUN, "--controller", path, "--json")
    finally:
        os.chdir(before)
    assert answer.json["outcome"] == "out_of_fuel" or answer.json["outcome"] in ("crashed", "out_of_bounds", "timeout")
    folder = run_folder(here)
    assert json.loads((folder / RESULT_NAME).read_bytes()) == answer.json
    assert read_trace(folder / FILE_NAME).digest == answer.json["trace_digest"]


def test_controller_output_is_printed_without_json(snr: Snr, mine: Mine) -> None:
    answer = snr(*RUN, "--controller", mine((WIRED, f"        print('altitude')\n        1 / 0\n{WIRED}")))
    assert "altitude" in answer.out
    assert "run folder: " in answer.out
    assert "the trace is whole up to there" in answer.out
    assert answer.err.startswith("mine.py, line 21: 1 / 0\n  ZeroDivisionError: division by zero\n")


def test_nan_in_pages_gives_strict_json(snr: Snr, mine: Mine) -> None:
    path = mine((WIRED, f"        self.store_data('x', float('nan'))\n{WIRED}"))
    assert "NaN" not in snr(*RUN, "--controller", path, "--json").out


# --watch

EDITS_ITSELF = """
        if self.ticks == 100 and not self.parent.is_replay:
            with open(__file__, "a") as file:
                file.write("# what a student does with an editor\\n")
"""


@pytest.mark.slow
def test_watched_run_reloads_controller_and_replay_notes_it(snr: Snr, here: Path, mine: Mine) -> None:
    mine((WIRED, EDITS_ITSELF + WIRED.replace("0.2", "0.3")))  # rises, and flies until its time is over
    answer = snr("run", "lander_low_gate", "--controller", "./mine.py", "--speed", "100", "--watch", "--no-rrd")
    assert "INFO snr.lander_node.node_core: Recreated: mine." in answer.err
    folder = next(here.glob("runs/*"))
    replayed = snr("replay", folder, "--check")
    assert (replayed.status, "asks the outside" in replayed.out) == (0, False)
    assert "Changed since the run: controller/mine.py. This replay executes it as it was recorded" in replayed.err


# Metrics

UNMEASURED = """

def metrics(plant, seed):
    return {"settling_s": float("inf"), "error_m": float("nan"), "worst_m": None, "depth_m": 1.5}
"""


def test_non_finite_metrics_are_null_in_json_and_words_in_text(snr: Snr, here: Path) -> None:
    (here / "unmeasured.py").write_text(Path(find("scenarios", "lander_vertical").path).read_text() + UNMEASURED)
    answer = snr("run", "./unmeasured.py", "--no-rrd")
    lines = [line.split(maxsplit=1) for line in answer.out.splitlines() if line.startswith("  ")]
    printed = {name: words for name, words in lines if name.endswith(("_s", "_m"))}
    assert printed == {**dict.fromkeys(("settling_s", "error_m", "worst_m"), "not reached"), "depth_m": "1.500"}
    fields = json.loads((run_folder(here) / RESULT_NAME).read_text(), parse_constant=pytest.fail)
    assert [fields[name] for name in printed] == [None, None, None, 1.5]


@pytest.mark.parametrize("io", ["mcu:/dev/ttyNowhere", "pi"])
def test_real_outputs_from_environment_are_printed_first(snr: Snr, monkeypatch: pytest.MonkeyPatch, io: str) -> None:
    warning = f"real outputs: {io}, from SNR_SIM_IO"
    assert warning not in snr(*RUN, "--io", io).err
    monkeypatch.setenv("SNR_SIM_IO", io)
    assert snr(*RUN).err.splitlines()[0] == warning
    assert warning not in snr(*RUN, "--io", io).err
    monkeypatch.setenv("SNR_SIM_IO", "loopback")
    assert "real outputs" not in snr(*RUN).err


def test_device_that_fails_to_open_is_reported_first_and_alone(snr: Snr) -> None:
    answer = snr("run", "urov_depth_hold", "--no-rrd", "--io", "mcu:/dev/null")
    assert answer.status == 1
    assert answer.err.splitlines()[0].startswith("/dev/null cannot be opened as a serial port")
    assert "in setup() of component 'pwm_actuator' at t = 0.000 s" in answer.err
    assert "waits for" not in answer.err
    assert "not reached" not in answer.out, "nothing was measured"
    assert "error after 0.0 s" in answer.out


@pytest.mark.parametrize("io", ["sim", "mcu:/dev/null"])
def test_only_run_with_real_outputs_continues_without_its_recording(
    snr: Snr, monkeypatch: pytest.MonkeyPatch, io: str
) -> None:
    softly: list[Any] = []
    monkeypatch.setattr(TraceWriter, "fail_softly", lambda self, nodes: softly.append(nodes))
    snr("run", "lander_vertical" if io == "sim" else "urov_depth_hold", "--io", io)
    assert bool(softly) == (io != "sim")


# Views


@pytest.fixture
def no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    """A computer that one has reached by ssh."""
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.parametrize("speed", ["fast", "real"])
def test_view_without_display_is_rejected_before_the_run(snr: Snr, here: Path, speed: str, no_display: None) -> None:
    answer = snr("run", "lander_vertical", "--view", "--speed", speed)
    assert answer.status == 2
    assert answer.err.splitlines() == [
        "--view opens a window, and there is no display: neither DISPLAY nor WAYLAND_DISPLAY is set.",
        "  Try: --web-view shows it in a browser.",
    ]
    assert not list(here.iterdir())


def test_view_verb_without_display_suggests_browser(snr: Snr, here: Path, no_display: None) -> None:
    run = snr("run", "lander_vertical", "--json").json["run_dir"]
    answer = snr("view", run)
    assert answer.status == 2
    assert f"snr view {run} --web" in answer.err
    assert len(answer.err.splitlines()) == 2
    assert not (here / run / "view.rrd").exists()


@pytest.mark.slow
def test_a_live_run_is_shown_in_the_browser(here: Path) -> None:
    command = [sys.executable, "-m", "snr_sim", "run", "lander_vertical", "--speed", "5", "--web-view"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        url = process.stderr.readline().split()[-1]
        assert url.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(url, timeout=60) as answer:
            assert "canvas" in answer.read().decode()
        wait_for(lambda: any(path.stat().st_size > 2000 for path in here.glob("runs/*/trace.jsonl")))  # the run began
        process.terminate()
        out, err = process.communicate(timeout=60)
    assert "interrupted" in out
    assert "INFO" not in err  # of rerun's own log
