"""The roles of one scenario as processes of their own, in real time: joined over TCP, recorded, replayed."""

import json
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.records import PageRecord
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario.role_run import RoleRun
from snr_sim.scenario.simulation import Request, prepare, request_of

TIMEOUT_S = 60.0

# A dive of a few seconds: the pilot always pushes ahead, and the run ends after a push and then a while without motion.
DASH = '''
"""Ahead, until the vehicle no longer moves."""

from snr_sim_robot_urov.evaluation import TrackedUrov
from snr_sim_robot_urov.parameters import UrovParameters, vehicle

from snr_sim.plants.urov.dive import Dive
from snr_sim.plants.urov.pool import Pool
from snr_sim.plants.urov.propulsion import Propulsion
from snr_sim.prelude.scenario import Verdict
from snr_sim.teleop.scripted_pilot import Cue

ROBOT = "urov"
ENGINES, CONTROLLER, TIME_LIMIT_S = ("mujoco",), "holds", 60.0


class Dashing(TrackedUrov):
    pushed_s = None

    def step(self, dt_s):
        super().step(dt_s)
        if max(map(abs, self.thrusters.forces_n)) > 1.0:
            self.pushed_s = self.time_s


def parameters(seed):
    return UrovParameters(vehicle(), (Cue(1.5, is_armed=True, mode="manual", surge=0.5),))


def plant(seed, engine):
    return Dashing(vehicle(), Pool(), lambda seed: Dive(position_m=(-8.0, 0.0, -1.0)), Propulsion(8), seed)


def verdict(plant):
    is_over = plant.pushed_s is not None and plant.time_s > plant.pushed_s + 0.6
    return Verdict("still", True) if is_over else None


def metrics(plant, seed):
    return {"pushed_s": plant.pushed_s}
'''

Start = Callable[..., subprocess.Popen[str]]


@pytest.fixture
def start(here: Path) -> Iterator[Start]:
    """Start a role; whatever still runs at the end is killed."""
    (here / "dash.py").write_text(DASH)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    running: list[subprocess.Popen[str]] = []

    def start(role: str, *more: str, room: int | None = None) -> subprocess.Popen[str]:
        words = ["run", "./dash.py", "--role", role, "--option", f"port={port}", "--no-rrd", "--json", "--out", role]
        words += more
        command = [sys.executable, "-m", "snr_sim", *words]
        if room is not None:  # no file may be longer: what a full disk looks like from a program
            command = ["prlimit", f"--fsize={room}", *command]
        running.append(subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True))
        return running[-1]

    yield start
    for process in running:
        process.kill()
        process.communicate()


def wait_for_page(folder: Path, key: str, expected: str, process: subprocess.Popen[str]) -> None:
    """Wait until the newest page of a key that a role has recorded holds a text."""
    end_s = time.monotonic() + TIMEOUT_S
    read, rest, newest = 0, "", ""
    while time.monotonic() < end_s:
        assert process.poll() is None, process.communicate()
        for path in folder.glob("*/" + FILE_NAME):
            with path.open("rb") as file:  # only what is new: a busy computer would spend its time on the rest
                file.seek(read)
                more = file.read()
            read += len(more)
            *lines, rest = (rest + more.decode()).split("\n")
            newest = next((line for line in reversed(lines) if f'"key":"{key}"' in line), newest)
            if expected in newest:
                return
        time.sleep(0.02)
    raise AssertionError(f"{folder.name}: no page '{key}' with {expected} within {TIMEOUT_S} s")


def awake_s(trace: Trace, from_s: float, to_s: float) -> float:
    """How long of this a node ran: it does something fifty times a second, unless the computer is busy."""
    times_s = sorted({from_s, to_s, *(record.t for record in trace.records if from_s < record.t < to_s)})
    return sum(min(later - earlier, 0.04) for earlier, later in pairwise(times_s))


def trace_in(folder: Path) -> Trace:
    (path,) = folder.glob("*/" + FILE_NAME)
    return read_trace(path)


def pages(trace: Trace, key: str) -> list[tuple[float, Any]]:
    """When each page of a key was stored, and its data."""
    found = [record for record in trace.records if isinstance(record, PageRecord) and record.name == key]
    return [(record.t, json.loads(bytes(record.values))[0]["data"]) for record in found]


def test_start_lines_name_link_address_and_awaited_role(here: Path) -> None:
    (here / "dash.py").write_text(DASH)
    output = [
        RoleRun(prepare(Request("./dash.py", role=role, options={"port": "9555"}))).start_lines()
        for role in ("urov", "topside")
    ]
    waits = f"127.0.0.1:9555 and waits for the role {{}} (snr run {here}/dash.py --role {{}})"
    assert output[0] == ["urov: link_tether listens at " + waits.format("topside", "topside")]
    assert output[1] == ["topside: link_tether connects to " + waits.format("urov", "urov")]


@pytest.mark.slow
@pytest.mark.parametrize("more", [[], ["--role", "topside"]])
def test_pilot_without_terminal_logs_missing_input(here: Path, more: list[str]) -> None:
    words = ["run", "urov_teleop", "--speed", "real", "--option", "pilot=manual", *more]
    command = [sys.executable, "-m", "snr_sim", *words]
    with subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        assert any("no manual input" in line for line in process.stderr)
        process.terminate()
        process.communicate(timeout=TIMEOUT_S)


@pytest.mark.wall_clock
@pytest.mark.unmeasured
def test_vehicle_with_full_disk_continues_and_surface_reports_it(here: Path, start: Start) -> None:
    topside, urov = start("topside"), start("urov", room=300_000)  # with less it is not armed
    wait_for_page(here / "topside", "vehicle", '"is_armed":true', topside)
    wait_for_page(here / "topside", "recording", "File too large", topside)
    time.sleep(1.0)  # the display has its own rate
    urov.terminate()
    out, stderr = urov.communicate(timeout=TIMEOUT_S)
    fields = json.loads(out)
    assert (fields["outcome"], fields["signal"]) == ("interrupted", "SIGTERM"), stderr
    assert "error" not in fields
    (note,) = [note for note in fields["notes"] if "recording" in note.lower()]
    assert re.match(r"The recording stops at t = [0-9.]+ s: File too large\. The trace is whole up to there; \d+", note)
    trace = trace_in(here / "urov")
    assert (trace.is_truncated, trace.is_ended, trace.digest) == (False, False, fields["trace_digest"])
    topside.terminate()
    _, output = topside.communicate(timeout=TIMEOUT_S)
    assert re.search(r" recording lost at urov_node since its t = [0-9.]+ s: File too large;", output), output
    replayed = subprocess.run([sys.executable, "-m", "snr_sim", "replay", trace.path], capture_output=True)
    assert replayed.returncode == 0, replayed.stdout


@pytest.mark.wall_clock
def test_killed_topside_leaves_thrust_neutral_within_half_a_second(here: Path, start: Start) -> None:
    topside, urov = start("topside"), start("urov")  # in this order: either may be first
    wait_for_page(here / "urov", "vehicle", '"control_state":"pilot"', urov)
    wait_for_page(here / "urov", "pwm", "17", urov)  # such as 1712.3: it turns
    topside.send_signal(signal.SIGKILL)
    out, stderr = urov.communicate(timeout=TIMEOUT_S)
    fields = json.loads(out)
    assert (fields["outcome"], urov.returncode) == ("still", 0), stderr
    trace = trace_in(here / "urov")
    last_s = pages(trace, "controls")[-1][0]
    turning = [t for t, data in pages(trace, "pwm") if any(abs(pulse - 1500.0) > 1.0 for pulse in data["pulses_us"])]
    assert turning
    assert 0.0 < awake_s(trace, last_s, turning[-1]) < 0.5
    # Both clocks are the wall's, so the trace of either replays by itself; that of the killed one up to its last line.
    for role in ("topside", "urov"):
        trace = trace_in(here / role)
        assert trace.header.clock == "wall"
        assert trace.header.roles == [role]
        replayed = replay_node(trace, role, prepare(request_of(trace.trace_info, trace.header)).config(None))
        assert replayed.is_identical, replayed.divergences[0]
        assert replayed.executed > 50


@pytest.mark.wall_clock
@pytest.mark.parametrize("blow", [signal.SIGKILL, signal.SIGSTOP])  # gone, or there and not moving
def test_silent_vehicle_is_detected_at_surface_within_a_second(here: Path, start: Start, blow: signal.Signals) -> None:
    urov, topside = start("urov"), start("topside")
    wait_for_page(here / "topside", "vehicle", '"control_state":"pilot"', topside)
    urov.send_signal(blow)
    wait_for_page(here / "topside", "link_tether", '"up":false', topside)
    topside.send_signal(signal.SIGINT)
    out, stderr = topside.communicate(timeout=TIMEOUT_S)
    assert (json.loads(out)["outcome"], topside.returncode) == ("ended", 0), stderr
    assert "link_tether is down" in stderr
    trace = trace_in(here / "topside")
    missed_s = next(t for t, data in pages(trace, "link_tether")[::-1] if not data["up"])
    last_page_s = pages(trace, "vehicle")[-1][0]
    assert awake_s(trace, last_page_s, missed_s) < 1.0


@pytest.mark.slow
def test_surface_shows_status_and_ends_after_vehicle(here: Path, start: Start) -> None:
    urov, topside = start("urov"), start("topside")
    wait_for_page(here / "topside", "vehicle", '"control_state":"pilot"', topside)
    urov.send_signal(signal.SIGINT)
    out, output = topside.communicate(timeout=TIMEOUT_S)
    assert (json.loads(out)["outcome"], topside.returncode) == ("ended", 0), output
    assert "note: ended: the vehicle's role has finished: 'urov_node' left: node 'urov_node' ended: SIGINT." in output
    # "silent" and "last received" where the computer was busy.
    last = "(last received: )?"
    pattern = rf"vehicle (received|silent) .*; state {last}\w+, manual, control: \w+; depth {last}[01]\.\d"
    assert re.search(pattern, output), output


def with_secret(here: Path, name: str, secret: str) -> tuple[str, str]:
    (here / name).write_text(secret + "\n")
    return "--option", f"secret={name}"


@pytest.mark.slow
def test_ends_with_equal_secret_connect_and_run_replays_without_it(here: Path, start: Start) -> None:
    urov = start("urov", *with_secret(here, "below.txt", "known to both of these ends"))
    topside = start("topside", *with_secret(here, "above.txt", "known to both of these ends"))
    wait_for_page(here / "urov", "vehicle", '"control_state":"pilot"', urov)
    topside.send_signal(signal.SIGINT)
    out, stderr = urov.communicate(timeout=TIMEOUT_S)
    assert json.loads(out)["outcome"] in ("still", "ended"), stderr
    (here / "below.txt").unlink()
    trace = trace_in(here / "urov")
    replayed = replay_node(trace, "urov", prepare(request_of(trace.trace_info, trace.header)).config(None))
    assert replayed.is_identical


@pytest.mark.slow
def test_ends_with_different_secrets_both_report_fix(here: Path, start: Start) -> None:
    urov = start("urov", *with_secret(here, "below.txt", "known to the vehicle alone"))
    topside = start("topside", *with_secret(here, "above.txt", "known to the surface alone"))
    for role, process in (("urov", urov), ("topside", topside)):
        wait_for_page(here / role, "link_tether", "secrets of the two ends differ", process)
    for process in (urov, topside):
        process.send_signal(signal.SIGINT)
        stderr = process.communicate(timeout=TIMEOUT_S)[1]
        assert "the secrets of the two ends differ" in stderr
        assert "Try: --option secret=FILE at both ends" in stderr


@pytest.mark.parametrize(
    ("option", "expected", "fix"),
    [
        ("host=192.168.2.2", "accepts commands from any host", "add --option secret=secret.txt at both ends"),
        ("host=127.0.0.1:9120", "has an option of its own", "--option host=127.0.0.1 --option port=9120"),
        ("host=the boat", "not a valid host name", "host=192.168.2.2"),
        ("port=0", "not a valid port", "from 1 to 65535"),
        ("port=abc", "not a valid port", ""),
        ("port=-1", "not a valid port", ""),
        ("port=70000", "not a valid port", ""),
        ("port=\u0669\u0661\u0662\u0660", "not a valid port", "port=9120"),
        ("secret=nowhere.txt", "nowhere.txt", "one line of text that both ends have"),
        ("allow=somebody", "allow=somebody", "allow=192.168.2.1"),
        ("power=bord", "power=bord", "did you mean 'board'?"),
        ("power=board", "--io mcu:PORT", "leave it out"),
        ("deadman=yes", "requires pilot=manual", "--option pilot=manual"),
        ("pilot=manua", "did you mean 'manual'?", ""),
    ],
)
def test_invalid_option_is_rejected_with_fix(snr: Any, here: Path, option: str, expected: str, fix: str) -> None:
    answer = snr("run", "urov_teleop", "--role", "urov", "--option", option)
    assert answer.status == 2
    assert expected in answer.err
    assert fix in answer.err
    assert list(here.iterdir()) == []


def test_surface_connects_to_remote_vehicle_without_secret(here: Path) -> None:
    simulation = prepare(Request("urov_teleop", role="topside", options={"host": "192.0.2.2"}))
    RoleRun(simulation)  # that the vehicle takes it, is for the vehicle to say: allow=


@pytest.mark.slow
def test_manual_pilot_runs_in_real_time_by_default(snr: Any, here: Path) -> None:
    ends = DASH.replace(
        "is_over = plant.pushed_s is not None and plant.time_s > plant.pushed_s + 0.6", "is_over = plant.time_s > 0.5"
    )
    (here / "dash.py").write_text(ends)
    answer = snr("run", "./dash.py", "--option", "pilot=manual", "--no-rrd", "--json")
    assert "A person steers, so this run takes as long as it says" in answer.err
    assert answer.json["outcome"] == "still"
    assert answer.json["wall_time_s"] > 0.4
    answer = snr("run", "./dash.py", "--no-rrd", "--json")
    assert "A person steers" not in answer.err


@pytest.mark.slow
@pytest.mark.parametrize("words", [("--role", "urov", "--option", "port={}"), ("--console", "{}")])
def test_port_in_use_is_reported_before_the_run(snr: Any, here: Path, words: tuple[str, ...]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        answer = snr("run", "urov_teleop", *(word.format(port) for word in words))
    assert answer.status == 2
    assert f"cannot listen on 127.0.0.1 port {port}" in answer.err
    assert f"`ss -tlnp | grep {port}` names it" in answer.err
    assert ("--option port=..., the same at both ends" in answer.err) == ("--role" in words)
    assert "note:" not in answer.err
    assert list(here.iterdir()) == []


@pytest.mark.slow
def test_failed_run_releases_its_port(snr: Any, here: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    (here / "file").write_text("no folder")
    assert snr("run", "urov_teleop", "--role", "urov", "--option", f"port={port}", "--out", "file").status == 2
    socket.create_server(("127.0.0.1", port)).close()


def test_roles_that_share_a_plant_are_rejected_as_processes(snr: Any, here: Path) -> None:
    answer = snr("run", "urov_gate", "--role", "topside")  # its pilot sees the vehicle
    assert answer.status == 2
    assert "only one plant" in answer.err
    assert "without --role" in answer.err
    assert not (here / "runs").exists()
