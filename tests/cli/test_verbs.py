"""The other verbs of `snr`: replay, resim, trace, list, new, doctor, and help."""

import json
import os
import platform
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from snr_sim.cli import verbs
from snr_sim.cli.resim import with_devices
from snr_sim.learning.discretiser import Discretiser
from snr_sim.learning.q_table import QTable
from snr_sim.recording.folder import RESULT_NAME
from snr_sim.recording.reader import read_trace
from snr_sim.recording.records import TaskRecord
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario.simulation import Request

Snr = Callable[..., Any]
Mine = Callable[..., Path]
WIRED = '        return self.store_data_task("engine", {"throttle": 0.2})'
VERTICAL = "snr_sim/LanderVertical-v0"
VERBS = tuple(verbs.VERBS)


@pytest.fixture(scope="session")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that caches the run of `recorded_run`, so that it is simulated once."""
    return tmp_path_factory.mktemp("kept")


@pytest.fixture
def recorded_run(snr: Snr, here: Path, kept: Path) -> Path:
    """A run of lander_vertical."""
    if not (kept / "runs").exists():
        snr("run", "lander_vertical", "--no-rrd", "--json", "--out", kept / "runs")
    (run,) = (kept / "runs").iterdir()
    return shutil.copytree(run, here / "runs" / run.name)


@pytest.fixture
def recorded_mine(snr: Snr, here: Path, mine: Mine) -> Path:
    """A run of mine.py."""
    fields = snr("run", "lander_vertical", "--no-rrd", "--json", "--controller", mine()).json
    return here / str(fields["run_dir"])


# Help


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_explains_itself(snr: Snr, verb: str) -> None:
    answer = snr(verb, "--help")
    assert answer.status == 0
    assert answer.out.startswith(f"Usage: snr {verb}")
    assert snr(verb, "-h").out == answer.out


@pytest.mark.parametrize("verb", verbs.VERBS)
def test_verb_help_begins_with_summary_and_ends_with_valid_examples(snr: Snr, verb: str) -> None:
    known = verbs.VERBS[verb]
    helped = snr(verb, "--help").out
    assert helped.split("\n\n")[1].strip() == known.about
    assert helped.rstrip().endswith("\n    ".join(("For example:", *known.examples)))
    for example in known.examples:
        _, named, *words = shlex.split(example)
        assert named == verb
        verbs.command_of(verb, known).make_context(verb, words, resilient_parsing=True).close()


@pytest.mark.slow
def test_help_imports_no_verb() -> None:
    code = "import sys; from snr_sim.cli import main; sys.argv = ['snr', '-h']\ntry: main.main()\nfinally: "
    code += "print([name for name in sys.modules if name.startswith('snr_sim.cli.')])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == str([f"snr_sim.cli.{one}" for one in ("stopping", "verbs", "main")])


def test_shell_completion_contains_verbs(snr: Snr, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "--install-completion" in snr("--help").out
    monkeypatch.setenv("_SNR_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", "snr re")
    monkeypatch.setenv("COMP_CWORD", "1")
    assert snr().out.split() == ["replay", "resim"]


def test_no_arguments_print_help_with_every_verb(snr: Snr) -> None:
    answer = snr("--help")
    assert answer.status == 0
    assert all(f"  {verb} " in answer.out for verb in VERBS)
    assert snr().err.strip() == answer.out.strip()
    assert snr().status == 2


@pytest.mark.slow
def test_python_m_snr_sim_is_snr(here: Path) -> None:
    for words in (["--help"], ["run", "nothing", "--json"]):
        results = [
            subprocess.run([*way, *words], capture_output=True, text=True)
            for way in ([sys.executable, "-m", "snr_sim"], [str(Path(sys.executable).with_name("snr"))])
        ]
        assert results[0].stdout == results[1].stdout
        assert results[0].stderr == results[1].stderr
        assert results[0].returncode == results[1].returncode


# replay


def test_replay_of_unchanged_code_is_identical(snr: Snr, recorded_run: Path) -> None:
    for words in ((recorded_run,), (recorded_run / FILE_NAME,), (recorded_run, "--check")):
        answer = snr("replay", *words)
        assert answer.status == 0
        assert answer.out.startswith("identical: ")
        assert answer.err == ""
    fields = snr("replay", recorded_run, "--json", "--check").json
    assert fields["identical"] is True
    assert fields["first_divergence"] is None
    assert fields["outside_calls"] == []
    assert fields["trace_digest"] == json.loads((recorded_run / RESULT_NAME).read_bytes())["trace_digest"]
    assert fields["tasks"] == fields["nodes"][0]["recorded"] > 0


def test_replay_with_other_policy_file_names_the_file(snr: Snr, here: Path) -> None:
    def save(throttle: int) -> None:
        table = QTable(Discretiser(("altitude_m", "velocity_mps"), ((), ())), ("off", "low", "half", "full"), VERTICAL)
        table.visits[0, throttle] = 1
        table.save(here / "policy.npz")

    save(0)
    policy = ("--controller", "q", "--policy", "policy.npz")
    run = snr("run", "lander_vertical", "--no-rrd", "--json", *policy).json["run_dir"]
    assert "option/policy" in read_trace(here / run / FILE_NAME).header.sources
    expected = f"executes, as recorded: {here / 'policy.npz'}\n"
    assert (snr("replay", run).status, snr("replay", run).err) == (0, expected)
    save(3)
    assert (snr("replay", run).status, snr("replay", run).err) == (0, expected)
    shutil.rmtree(here / run / "sources")  # a run as it was before files were kept
    answer = snr("replay", run)
    assert answer.status == 2
    assert f"It would execute:\n  {here / 'policy.npz'}\n" in answer.err
    answer = snr("replay", run, "--trust")
    assert answer.status == 1
    assert f"The policy FILE is another one than was recorded: {here / 'policy.npz'}" in answer.err
    assert "Changed since the run" not in answer.err


def test_replay_with_changed_constant_names_the_record(snr: Snr, recorded_mine: Path, mine: Mine) -> None:
    path = mine((WIRED, '        return self.store_data_task("engine", {"throttle": 0.2 if now_s < 20.0 else 0.23})'))
    as_recorded = snr("replay", recorded_mine, "--check")
    assert as_recorded.status == 0
    assert "Changed since the run: controller/mine.py. This replay executes it as it was recorded" in as_recorded.err
    today = ("replay", recorded_mine, "--with", path)
    answer = snr(*today, "--check")
    assert answer.status == 1
    records = read_trace(recorded_mine / FILE_NAME).records
    processed = (one for one in records if isinstance(one, TaskRecord) and one.name == "radar")
    seq = next(one.seq for one in processed if one.t >= 20.0)
    for part in (
        f"seq {seq}, t = 20.000 s, node lander_node, while handling process_data 'radar'",
        "component mine, handler on_radar (value)",
        "engine.throttle: recorded 0.2, replayed 0.23",
        "radar_sensor brought store_page 'radar'",
        f"commands to actuators differ from seq {seq}, t = 20.000 s: after this the recorded sensors no longer answer",
        "snr resim",
    ):
        assert part in answer.out
    fields = snr(*today, "--json").json
    first = fields["first_divergence"]
    assert (first["seq"], first["component"], first["handler"], first["field"]) == (
        seq,
        "mine",
        "on_radar",
        "engine.throttle",
    )
    assert (first["recorded"], first["replayed"], first["kind"]) == (0.2, 0.23, "value")
    assert fields["commands_differ_from_seq"] == seq
    assert snr(*today, "--tolerance", "engine.throttle=0.04").status == 0
    assert snr(*today, "--tolerance", "engine.throttle=20%").status == 0
    assert snr(*today, "--tolerance", "engine.*=1e-3").status == 1


def elsewhere(run: Path) -> None:
    """Have a recorded run say that it was recorded under another Python, with another numpy."""
    trace = run / FILE_NAME
    trace_info, header, rest = trace.read_text().split("\n", 2)
    fields = json.loads(header)
    fields["python"], fields["packages"]["numpy"] = "3.10.0", "1.0"
    trace.write_text("\n".join([trace_info, json.dumps(fields), rest]))


def test_replay_under_other_python_names_it_before_the_handler(snr: Snr, recorded_mine: Path, mine: Mine) -> None:
    elsewhere(recorded_mine)
    assert "Recorded with something else" not in snr("replay", recorded_mine).err, "the same tasks all the same"
    path = mine((WIRED, '        return self.store_data_task("engine", {"throttle": 0.2 if now_s < 20.0 else 0.23})'))
    answer = snr("replay", recorded_mine, "--with", path)
    assert answer.status == 1
    expected = f"Recorded with something else: Python 3.10.0 then, {platform.python_version()} now; numpy 1.0 then, "
    assert expected in answer.err
    assert "Look there before you look at the code." in answer.err
    assert expected in snr("replay", recorded_mine, "--with", path, "--json").json["notes"][0]


def test_replay_with_other_file_warns_where_loop_opens(snr: Snr, recorded_mine: Path, mine: Mine) -> None:
    other = mine(("0.2", "0.5"), name="other.py")
    answer = snr("replay", recorded_mine, "--with", other, "--json")
    assert answer.status == 1
    assert "no longer answer your code" in answer.json["warning"]
    nan = mine(("0.2", "float('nan')"), name="nan.py")
    assert snr("replay", recorded_mine, "--with", nan, "--json").json["first_divergence"]["replayed"] == "nan"
    for wrong, expected in (("no.py", "There is no file 'no.py'"), ("optiml", "There is no controller 'optiml'")):
        answer = snr("replay", recorded_mine, "--with", wrong, "--json")
        assert (answer.status, expected in answer.json["error"]) == (2, True)


def test_check_names_nondeterministic_call_with_line(snr: Snr, here: Path, mine: Mine) -> None:
    path = mine((WIRED, f"        import time; time.time()  # asks\n{WIRED}"))
    recorded_run = snr("run", "lander_vertical", "--no-rrd", "--json", "--controller", path).json["run_dir"]
    number = path.read_text().splitlines().index("        import time; time.time()  # asks") + 1
    answer = snr("replay", recorded_run, "--check")
    assert answer.status == 0  # it made no difference, this time
    assert f"asks the outside: mine.py, line {number}: time.time() does not repeat; self.get_time_s()" in answer.out
    (call,) = snr("replay", recorded_run, "--check", "--json").json["outside_calls"]
    assert (call["file"], call["line"]) == ("mine.py", number)


@pytest.mark.slow
@pytest.mark.parametrize(
    "line",
    [
        "return self.store_data_task('names', list({'port', 'starboard', 'bow', 'stern', 'keel'}))",
        "return [self.store_data_task(name, 1) for name in {'port', 'starboard', 'bow', 'stern', 'keel'}]",
        "return [tasks.event('part', [name]) for name in {'port', 'starboard', 'bow', 'stern', 'keel'}]",
    ],
)
def test_replay_that_differs_by_set_order_hints_at_it(here: Path, mine: Mine, line: str) -> None:
    def snr_in(hash_seed: str, *words: str) -> subprocess.CompletedProcess[str]:
        environment = {**os.environ, "PYTHONHASHSEED": hash_seed}
        command = [sys.executable, "-m", "snr_sim", *words]
        return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)

    path = mine((WIRED, f"        {line}"))
    done = snr_in("1", "run", "lander_vertical", "--no-rrd", "--json", "--controller", str(path))
    folder = json.loads(done.stdout)["run_dir"]
    assert snr_in("1", "replay", folder).returncode == 0
    replayed = snr_in("2", "replay", folder)
    assert replayed.returncode == 1
    assert "The same values in another order: the order of a set of texts differs" in replayed.stdout
    assert "PYTHONHASHSEED was 1 then, and is 2 now." in replayed.stdout


def test_handler_output_is_not_part_of_json(snr: Snr, mine: Mine) -> None:
    path = mine((WIRED, f"        print('altitude', flush=True)\n{WIRED}"))
    recorded_run = snr("run", "lander_vertical", "--no-rrd", "--json", "--controller", path).json["run_dir"]
    assert snr("replay", recorded_run, "--json").json["identical"]
    assert "altitude" not in snr("replay", recorded_run).out


def test_unusable_trace_returns_status_2(snr: Snr, here: Path, recorded_run: Path) -> None:
    for verb in ("replay", "resim", "trace", "view"):
        answer = snr(verb, here / "gone")
        assert answer.status == 2
        assert "There is no run at" in answer.err
        assert "snr run" in answer.err or "newest run" in answer.err
    (here / "cut.jsonl").write_bytes((recorded_run / FILE_NAME).read_bytes()[:-3000])
    answer = snr("replay", "cut.jsonl")
    assert (answer.status, "cut short" in answer.err) == (0, True)
    (here / "other.jsonl").write_bytes((recorded_run / FILE_NAME).read_bytes().replace(b'"schema":3', b'"schema":9', 1))
    for verb in ("replay", "resim", "trace"):
        assert snr(verb, "other.jsonl", *(["--json"] if verb != "trace" else [])).status == 2


def test_edited_trace_is_reported(snr: Snr, recorded_run: Path) -> None:
    data = (recorded_run / FILE_NAME).read_bytes()
    (recorded_run / FILE_NAME).write_bytes(data.replace(b'"altitude_m":9', b'"altitude_m":8', 1))
    answer = snr("replay", recorded_run)
    assert "The trace was changed after the run" in answer.err
    assert answer.status in (0, 1)  # something to look at, but nothing to prove by
    checked = snr("replay", recorded_run, "--check", "--json")
    assert checked.status == 2
    assert "so it proves nothing: result.json says its digest is" in checked.json["error"]
    (recorded_run / FILE_NAME).write_bytes(data[: data.rindex(b"\n", 0, -1) + 1])  # its last record is gone
    assert snr("replay", recorded_run, "--check").status == 2
    (recorded_run / FILE_NAME).write_bytes(data)
    assert snr("replay", recorded_run).err == ""
    assert snr("replay", recorded_run, "--check").status == 0


@pytest.mark.slow
def test_program_without_scenario_replays_with_same_or_changed_file(snr: Snr, here: Path) -> None:
    program = """
import sys
from snr_sim import Config, TaskType, tasks
from snr_sim.scenario.program import record_program
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

ticks = []

def answer(task, task_id):
    ticks.append(task)
    return tasks.terminate("done") if len(ticks) == 20 else tasks.event("tock", [GAIN * len(ticks)])

config = Config(factories={"r": [
    FunctionLoopFactory(lambda loop: loop.schedule(tasks.event("tick")), rate_hz=500),
    FunctionEndpointFactory({(TaskType.event, "tick"): answer}),
]})
if __name__ == "__main__":
    print(record_program("r", config, __file__))
"""
    (here / "robot.py").write_text(program.replace("GAIN", "2"))
    done = subprocess.run([sys.executable, "robot.py"], capture_output=True, text=True, check=True)
    folder = done.stdout.strip()
    assert snr("replay", folder, "--check").status == 0
    assert snr("replay", folder, "--with", "robot.py").status == 0
    (here / "changed.py").write_text(program.replace("GAIN", "3"))
    first = snr("replay", folder, "--with", "changed.py", "--json").json["first_divergence"]
    assert (first["kind"], first["field"], first["recorded"], first["replayed"]) == ("value", "tock[0]", 2, 3)
    (here / "empty.py").write_text("")
    answer = snr("replay", folder, "--with", "empty.py")
    assert (answer.status, "has no `config`" in answer.err) == (2, True)
    (here / "robot.py").write_text(program.replace("GAIN", "3"))
    answer = snr("replay", folder)
    assert (answer.status, "Changed since the run: program/robot.py" in answer.err) == (0, True)
    assert snr("replay", folder, "--with", "robot.py").status == 1


@pytest.mark.slow
def test_roles_in_processes_are_recorded_and_replay_separately(snr: Snr, here: Path) -> None:
    program = """
from snr_sim import Config, Loop, LoopFactory, TaskType, tasks
from snr_sim.scenario.program import record_roles
from snr_sim.testing.function_components import FunctionEndpointFactory


def answer(task, task_id):
    value = task.val_list[0].data
    return tasks.terminate("done") if value == 5 else tasks.event("tock", [value])


class Eye(Loop):
    executor = "process"
    count = 0

    def loop(self):
        self.count += 1
        self.store_data("seen", self.count)


class EyeFactory(LoopFactory):
    def get(self, parent):
        return Eye(self, parent, "eye", 100)


config = Config(factories={
    role: [EyeFactory(), FunctionEndpointFactory({(TaskType.store_page, "seen"): answer})] for role in ("left", "right")
})
if __name__ == "__main__":
    print(record_roles(config, __file__))
"""
    (here / "robot.py").write_text(program)
    done = subprocess.run([sys.executable, "robot.py"], capture_output=True, text=True, check=True)
    for role in ("left", "right"):
        answer = snr("replay", Path(done.stdout.strip()) / role, "--check")
        assert answer.status == 0, answer.err


@pytest.mark.slow
def test_killed_role_and_its_restart_are_both_recorded_and_replay(snr: Snr, here: Path) -> None:
    program = """
import os, signal
from pathlib import Path
from snr_sim import Config, Loop, TaskType, tasks
from snr_sim.scenario.program import record_roles
from snr_sim.supervision import Child, Supervisor, Timeouts
from snr_sim.testing.function_components import FunctionEndpointFactory


def answer(task, task_id):
    return tasks.terminate("done") if task.val_list[0].data == 100 else tasks.event("tock")


class Eye(Loop):
    max_tick_rate_hz = 100.0
    count = 0

    def loop(self):
        self.count += 1
        self.store_data("seen", self.count)
        if self.count == 80 and not Path("killed").exists():
            Path("killed").touch()
            os.kill(os.getpid(), signal.SIGKILL)


config = Config(factories={
    "eye": [Eye.factory(name="eye"), FunctionEndpointFactory({(TaskType.store_page, "seen"): answer})]
})
if __name__ == "__main__":
    child = Child("eye", "on_failure", Timeouts(setup_s=60.0))
    print(record_roles(config, __file__, plan=Supervisor("root", [child])))
"""
    (here / "robot.py").write_text(program)
    done = subprocess.run([sys.executable, "robot.py"], capture_output=True, text=True, check=True)
    folder = Path(done.stdout.strip())
    assert sorted(path.name for path in folder.iterdir()) == ["eye", "eye.2", "health.json"]
    for role in ("eye", "eye.2"):
        answer = snr("replay", folder / role, "--json")
        assert (answer.status, answer.json["identical"]) == (0, True), answer.err
    assert snr("health", folder).status == 1


# view


@pytest.mark.slow
def test_picture_without_trace_or_body_reports_fix(snr: Snr, here: Path, recorded_run: Path) -> None:
    (recorded_run / "replayed.rrd").write_bytes(b"RRF2")
    answer = snr("view", recorded_run / "replayed.rrd", "--png", "a.png")
    assert (answer.status, "is for the rerun viewer; a picture is drawn from a trace" in answer.err) == (2, True)
    assert f"Try: snr view {recorded_run} --png a.png draws the recorded run" in answer.err
    (here / "alone").mkdir()
    (here / "alone" / "replayed.rrd").write_bytes(b"RRF2")
    answer = snr("view", "alone", "--png", "a.png")
    assert (answer.status, "alone holds replayed.rrd, but no trace.jsonl." in answer.err) == (2, True)
    assert "Try: snr view alone/replayed.rrd shows it." in answer.err
    (here / "prog.py").write_text(
        "from snr_sim import Config, SimClock, TimeoutLoopFactory\n"
        "from snr_sim.scenario.program import record_program\n"
        "config = Config(factories={'r': [TimeoutLoopFactory(seconds=0.1)]})\n"
        "if __name__ == '__main__':\n    print(record_program('r', config, __file__, clock=SimClock()))\n"
    )
    done = subprocess.run([sys.executable, "prog.py"], capture_output=True, text=True, check=True)
    answer = snr("view", done.stdout.strip(), "--png", "a.png")
    assert (answer.status, "contains no true states of a body to draw: only simulated" in answer.err) == (2, True)
    assert f"Try: snr view {done.stdout.strip()} shows its pages as plots." in answer.err
    assert not (here / "a.png").exists()


# resim


def test_resim_of_unchanged_code_has_same_digest(snr: Snr, recorded_run: Path) -> None:
    answer = snr("resim", recorded_run, "--no-rrd", "--json")
    assert answer.status == 0
    assert answer.json["identical"] is True
    assert answer.json["run_dir"] != str(recorded_run)
    words = snr("resim", recorded_run, "--no-rrd")
    assert f"the same digest as {recorded_run}" in words.out
    changed = snr("resim", recorded_run, "--no-rrd", "--json", "--with", "coast").json
    assert (changed["identical"], changed["outcome"]) == (False, "crashed")


def test_resim_under_other_python_compares_records_without_header(snr: Snr, recorded_run: Path) -> None:
    elsewhere(recorded_run)
    answer = snr("resim", recorded_run, "--no-rrd")
    assert f"the same records, with another header, as {recorded_run}" in answer.out
    assert "Recorded with something else: Python 3.10.0 then" in answer.err
    assert "another digest than" in snr("resim", recorded_run, "--no-rrd", "--with", "coast").out


@pytest.mark.parametrize("io", ["mcu:/dev/ttyUSB0", "maestro:/dev/ttyACM0", "pca9685:1:0x40", "sysfs", "pi"])
def test_resim_of_real_outputs_requires_io_option(snr: Snr, recorded_run: Path, here: Path, io: str) -> None:
    trace = recorded_run / FILE_NAME
    trace.write_text(trace.read_text().replace('"io":"sim"', f'"io":"{io}"', 1))
    before = sorted((here / "runs").iterdir())
    answer = snr("resim", recorded_run, "--no-rrd")
    assert answer.status == 2
    assert f"recorded with --io {io}" in answer.err
    assert "simulate it with --io sim" in answer.err
    assert sorted((here / "runs").iterdir()) == before
    assert snr("resim", recorded_run, "--no-rrd", "--json", "--io", "sim").json["outcome"] == "landed"


def test_resim_of_separate_roles_on_hardware_simulates_all_roles() -> None:
    asked = Request("urov_depth_hold", role="urov", io="pi")
    assert with_devices(asked, "sim") == Request("urov_depth_hold", io="sim")
    assert with_devices(asked, "pi") == asked
    apart = Request("urov_depth_hold", role="urov", io="sim")
    assert with_devices(apart, "") == with_devices(apart, "sim") == apart


# trace


def test_trace_filters_records_by_kind_name_and_node(snr: Snr, recorded_run: Path) -> None:
    lines = (recorded_run / FILE_NAME).read_text().splitlines()[2:]  # after opening and header
    assert len(snr("trace", recorded_run).out.splitlines()) == len(lines)
    whole = list(map(json.loads, snr("trace", recorded_run, "--json").out.splitlines()))
    assert [(one["kind"], one["seq"]) for one in whole] == [(one["kind"], one["seq"]) for one in map(json.loads, lines)]
    # Each says all of its task, where the file refers to the record that brought it.
    assert all(
        one.keys() >= {"t", "node", "type", "name", "values"} for one in whole if one["kind"] in ("task", "page")
    )
    inputs = snr("trace", recorded_run, "--kind", "input", "--json").out.splitlines()
    assert {json.loads(line)["kind"] for line in inputs} == {"input"}
    engine = snr("trace", recorded_run, "--name", "eng*", "--kind", "page", "--json").out.splitlines()
    assert {json.loads(line)["name"] for line in engine} == {"engine"}
    for node in ("lander", "lander_node"):
        of_node = snr("trace", recorded_run, "--node", node, "--json").out.splitlines()
        assert {json.loads(line)["node"] for line in of_node} == {"lander_node"}
    assert "radar_sensor -> store_page radar" in snr("trace", recorded_run, "--kind", "input").out
    assert len(snr("trace", recorded_run, "--kind", "end").out.splitlines()) == 1


def test_unknown_kind_or_node_suggests_nearest(snr: Snr, recorded_run: Path) -> None:
    answer = snr("trace", recorded_run, "--kind", "pages")
    assert (answer.status, "did you mean 'page'?" in answer.err) == (2, True)
    answer = snr("trace", recorded_run, "--node", "landr")
    assert (answer.status, "did you mean 'lander_node'?" in answer.err) == (2, True)


@pytest.mark.slow
def test_pipe_closed_early_is_not_an_error(here: Path, recorded_run: Path) -> None:
    command = f"{sys.executable} -m snr_sim trace {recorded_run} | head -n 1"
    done = subprocess.run(command, shell=True, capture_output=True, text=True)
    assert done.stderr == ""
    assert len(done.stdout.splitlines()) == 1


# list, new, doctor


def test_list_names_items_and_locations(snr: Snr, here: Path) -> None:
    rows = snr("list", "--json").json["found"]
    by_name = {(row["kind"], row["name"]): row for row in rows}
    assert "optimal" in by_name["robots", "lander"]["controllers"]
    assert by_name["scenarios", "lander_vertical"]["about"]
    assert by_name["robots", "urov"]["options"]["pilot"].startswith("scripted")
    assert "--option pilot=...  scripted" in snr("list", "robots").out
    assert by_name["scenarios", "lander_pad"]["engines"] == "pymunk, mujoco"  # the default first
    assert "engines: mujoco, pymunk\n" in snr("list", "scenarios").out
    assert {row["place"] for row in rows} == {"the kit"}
    assert snr("list", "scenarios").out.startswith("scenarios:\n  dora_corners ")
    answer = snr("list", "scenarois")
    assert (answer.status, "did you mean 'scenarios'?" in answer.err) == (2, True)
    (here / "scenarios").mkdir()
    (here / "scenarios" / "broken.py").write_text("def (")
    (here / "scenarios" / "odd.py").write_bytes(b"\xff\x00")
    (here / "scenarios" / "lazy.py").write_text("ENGINES = tuple(BODIES)")  # nothing is run to make a list
    assert "(does not parse)" in snr("list", "scenarios").out


def test_new_robot_and_new_scenario_run(snr: Snr, here: Path) -> None:
    assert snr("new", "robot", "moth").status == 0
    assert snr("new", "scenario", "moth_first", "--from", "lander_pad", "--robot", "moth").status == 0
    assert "snr_sim_robot_lander" not in (here / "scenarios" / "moth_first.py").read_text()
    fields = snr("run", "moth_first", "--json", "--no-rrd").json
    assert fields["scenario"] == "moth_first"
    header = read_trace(Path(fields["run_dir"]) / FILE_NAME).header
    assert header.robot == "moth"
    assert fields["outcome"] == "landed"
    assert {row["place"] for row in snr("list", "--json").json["found"] if "moth" in row["name"]} == {
        "the current folder"
    }


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (("robt", "x"), "did you mean 'robot'?"),
        (("robot", "My Robot"), "is not a valid robot name"),
        (("robot", "../x"), "is not a valid robot name"),
        (("robot", "x", "--from", "landr"), "did you mean 'lander'?"),
        (("robot", "x", "--robot", "lander"), "--robot does not apply to a robot"),
        (("scenario", "x", "--robot", "landr"), "did you mean 'lander'?"),
        (("scenario", "x", "--from", "lander_verticl"), "did you mean 'lander_vertical'?"),
    ],
)
def test_failed_new_writes_nothing(snr: Snr, here: Path, words: tuple[str, ...], found: str) -> None:
    answer = snr("new", *words)
    assert (answer.status, found in answer.err) == (2, True)
    assert list(here.iterdir()) == []


def test_new_never_overwrites(snr: Snr, here: Path) -> None:
    assert snr("new", "scenario", "first").status == 0
    before = (here / "scenarios" / "first.py").read_bytes()
    answer = snr("new", "scenario", "first", "--from", "lander_pad")
    assert (answer.status, "is there already" in answer.err) == (2, True)
    assert (here / "scenarios" / "first.py").read_bytes() == before


def test_doctor_lands_a_module(snr: Snr) -> None:
    answer = snr("doctor", "--json")
    findings = answer.json["findings"]
    assert any("lander_vertical, seed 0: landed" in finding["message"] for finding in findings)
    assert answer.status == (0 if all(finding["is_ok"] for finding in findings) else 1)
    assert os.listdir() == []


# Without the name of a run


def test_verbs_without_run_use_newest_and_print_it(snr: Snr, recorded_run: Path, here: Path) -> None:
    older = shutil.copytree(recorded_run, here / "runs" / "z_older")  # by its name it would be the newest
    os.utime(older / FILE_NAME, ns=(1, 1))
    newest = Path("runs") / recorded_run.name
    for words in (["trace", "--kind", "end"], ["replay"], ["resim"], ["view", "--png", "a.png"]):
        answer = snr(*words)
        assert answer.status == 0
        assert answer.err.startswith(f"the newest run: {newest}\n")
        if words == ["resim"]:
            shutil.rmtree(here / answer.out.partition("run folder: ")[2].split()[0])
    assert "byte for byte" in snr("compare").out
    assert f"the newest run but that: {newest}\n" in snr("compare", older).err


def test_compare_without_runs_takes_the_newest_of_one_robot(snr: Snr, recorded_run: Path, here: Path) -> None:
    older, other = (shutil.copytree(recorded_run, here / "runs" / name) for name in ("older", "other"))
    trace, robot = other / FILE_NAME, read_trace(other / FILE_NAME).header.robot
    trace.write_bytes(trace.read_bytes().replace(f'"robot":"{robot}"'.encode(), b'"robot":"another"', 1))
    os.utime(older / FILE_NAME, ns=(1, 1))
    os.utime(trace, ns=(2, 2))
    assert f"the newest run but that: {Path('runs') / 'older'}\n" in snr("compare").err
    shutil.rmtree(older)
    answer = snr("compare")
    assert answer.status == 2
    assert f"No run was named, and there is no other of the robot '{robot}' in runs/." in answer.err


def test_verbs_without_any_run_report_how_to_make_one(snr: Snr, here: Path) -> None:
    for verb in ("trace", "replay", "resim", "view", "compare"):
        answer = snr(verb)
        assert answer.status == 2
        assert answer.err == (
            "No run was named, and there is none in runs/.\n  Try: make one: snr run lander_vertical.\n"
        )


def test_list_truncates_nothing_and_aligns_columns(snr: Snr, here: Path) -> None:
    (here / "scenarios").mkdir()
    (here / "scenarios" / "a_name_of_more_than_eighteen_letters.py").write_text('"""One line\nand another.\n\nMore."""')
    lines = snr("list", "scenarios").out.splitlines()
    assert any("letters One line and another.  [" in line for line in lines)
    begins = {line.index("engines:") for line in lines if line.strip().startswith("engines:")}
    assert begins == {len("  a_name_of_more_than_eighteen_letters ")}


def test_crash_has_no_fuel_ratio(snr: Snr) -> None:
    answer = snr("run", "lander_vertical", "--controller", "coast")
    assert "fuel_ratio       not reached" in answer.out
