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
from snr_sim.scenario.role_run import World
from snr_sim.scenario.simulation import Request, prepare, request_of

PATIENCE_S = 60.0

# A dive of a few seconds: the pilot always pushes ahead, and the run ends after a push and then a while without motion.
DASH = '''
"""Ahead, until nobody is there any more."""

from snr_sim_robot_urov.judging import WatchedUrov
from snr_sim_robot_urov.parameters import UrovParameters, vehicle

from snr_sim.plants.urov.dive import Dive
from snr_sim.plants.urov.pool import Pool
from snr_sim.plants.urov.propulsion import Propulsion
from snr_sim.prelude.scenario import Verdict
from snr_sim.teleop.scripted_pilot import Cue

ROBOT = "urov"
ENGINES, CONTROLLER, TIME_LIMIT_S = ("mujoco",), "holds", 60.0


class Dashing(WatchedUrov):
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


def wait_for_page(folder: Path, key: str, says: str, process: subprocess.Popen[str]) -> None:
    """Wait until the newest page of a key that a role has recorded holds a text."""
    end_s = time.monotonic() + PATIENCE_S
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
            if says in newest:
                return
        time.sleep(0.02)
    raise AssertionError(f"{folder.name}: no page '{key}' with {says} within {PATIENCE_S} s")


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


def test_a_role_says_where_its_link_is_and_which_role_it_waits_for(here: Path) -> None:
    (here / "dash.py").write_text(DASH)
    said = [
        World(prepare(Request("./dash.py", role=role, options={"port": "9555"}))).start_lines()
        for role in ("urov", "topside")
    ]
    waits = f"127.0.0.1:9555 and waits for the role {{}} (snr run {here}/dash.py --role {{}})"
    assert said[0] == ["urov: link_tether listens at " + waits.format("topside", "topside")]
    assert said[1] == ["topside: link_tether connects to " + waits.format("urov", "urov")]


@pytest.mark.slow
@pytest.mark.parametrize("more", [[], ["--role", "topside"]])
def test_a_pilot_without_terminal_is_told_that_nobody_can_steer(here: Path, more: list[str]) -> None:
    words = ["run", "urov_teleop", "--speed", "real", "--option", "pilot=hands", *more]
    command = [sys.executable, "-m", "snr_sim", *words]
    with subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        assert any("nobody can steer" in line for line in process.stderr)
        process.terminate()
        process.communicate(timeout=PATIENCE_S)


@pytest.mark.wall_clock
def test_a_vehicle_whose_disk_is_full_goes_on_and_the_surface_is_told(here: Path, start: Start) -> None:
    topside, urov = start("topside"), start("urov", room=300_000)  # with less it is not armed
    wait_for_page(here / "topside", "vehicle", '"is_armed":true', topside)
    wait_for_page(here / "topside", "recording", "File too large", topside)
    time.sleep(1.0)  # the display has its own rate
    urov.terminate()
    out, complaints = urov.communicate(timeout=PATIENCE_S)
    fields = json.loads(out)
    assert (fields["outcome"], fields["signal"]) == ("interrupted", "SIGTERM"), complaints
    assert "error" not in fields
    (note,) = [note for note in fields["notes"] if "recording" in note.lower()]
    assert re.match(r"The recording stops at t = [0-9.]+ s: File too large\. The trace is whole up to there; \d+", note)
    trace = trace_in(here / "urov")
    assert (trace.is_cut, trace.is_ended, trace.digest) == (False, False, fields["trace_digest"])
    topside.terminate()
    _, told = topside.communicate(timeout=PATIENCE_S)
    assert re.search(r" recording lost at urov_node since its t = [0-9.]+ s: File too large;", told), told
    replayed = subprocess.run([sys.executable, "-m", "snr_sim", "replay", trace.path], capture_output=True)
    assert replayed.returncode == 0, replayed.stdout


@pytest.mark.wall_clock
def test_a_topside_that_is_killed_leaves_thrust_at_neutral_within_half_a_second(here: Path, start: Start) -> None:
    topside, urov = start("topside"), start("urov")  # in this order: either may be first
    wait_for_page(here / "urov", "vehicle", '"rules":"pilot"', urov)
    wait_for_page(here / "urov", "pwm", "17", urov)  # such as 1712.3: it turns
    topside.send_signal(signal.SIGKILL)
    out, complaints = urov.communicate(timeout=PATIENCE_S)
    fields = json.loads(out)
    assert (fields["outcome"], urov.returncode) == ("still", 0), complaints
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
        replayed = replay_node(trace, role, prepare(request_of(trace.opening, trace.header)).config(None))
        assert replayed.is_identical, replayed.divergences[0]
        assert replayed.executed > 50


@pytest.mark.wall_clock
@pytest.mark.parametrize("blow", [signal.SIGKILL, signal.SIGSTOP])  # gone, or there and not moving
def test_a_vehicle_that_falls_silent_is_missed_at_the_surface_within_a_second(
    here: Path, start: Start, blow: signal.Signals
) -> None:
    urov, topside = start("urov"), start("topside")
    wait_for_page(here / "topside", "vehicle", '"rules":"pilot"', topside)
    urov.send_signal(blow)
    wait_for_page(here / "topside", "link_tether", '"up":false', topside)
    topside.send_signal(signal.SIGINT)
    out, complaints = topside.communicate(timeout=PATIENCE_S)
    assert (json.loads(out)["outcome"], topside.returncode) == ("ended", 0), complaints
    assert "link_tether is down" in complaints
    trace = trace_in(here / "topside")
    missed_s = next(t for t, data in pages(trace, "link_tether")[::-1] if not data["up"])
    heard_s = pages(trace, "vehicle")[-1][0]
    assert awake_s(trace, heard_s, missed_s) < 1.0


@pytest.mark.slow
def test_the_surface_shows_what_it_hears_and_ends_when_the_vehicles_role_has_finished(here: Path, start: Start) -> None:
    urov, topside = start("urov"), start("topside")
    wait_for_page(here / "topside", "vehicle", '"rules":"pilot"', topside)
    urov.send_signal(signal.SIGINT)
    out, said = topside.communicate(timeout=PATIENCE_S)
    assert (json.loads(out)["outcome"], topside.returncode) == ("ended", 0), said
    assert "note: ended: the vehicle's role has finished: 'urov_node' left: node 'urov_node' ended: SIGINT." in said
    # "silent" and "last heard" where the computer was busy.
    heard = r"vehicle (heard|silent) .*; state (last heard: )?\w+, manual, obeys: \w+; depth (last heard: )?[01]\.\d"
    assert re.search(heard, said), said


def with_secret(here: Path, name: str, secret: str) -> tuple[str, str]:
    (here / name).write_text(secret + "\n")
    return "--option", f"secret={name}"


@pytest.mark.slow
def test_two_ends_with_one_secret_meet_and_the_run_replays_without_it(here: Path, start: Start) -> None:
    urov = start("urov", *with_secret(here, "below.txt", "known to both of these ends"))
    topside = start("topside", *with_secret(here, "above.txt", "known to both of these ends"))
    wait_for_page(here / "urov", "vehicle", '"rules":"pilot"', urov)
    topside.send_signal(signal.SIGINT)
    out, complaints = urov.communicate(timeout=PATIENCE_S)
    assert json.loads(out)["outcome"] in ("still", "ended"), complaints
    (here / "below.txt").unlink()
    trace = trace_in(here / "urov")
    replayed = replay_node(trace, "urov", prepare(request_of(trace.opening, trace.header)).config(None))
    assert replayed.is_identical


@pytest.mark.slow
def test_two_ends_with_different_secrets_both_say_so_and_what_to_type(here: Path, start: Start) -> None:
    urov = start("urov", *with_secret(here, "below.txt", "known to the vehicle alone"))
    topside = start("topside", *with_secret(here, "above.txt", "known to the surface alone"))
    for role, process in (("urov", urov), ("topside", topside)):
        wait_for_page(here / role, "link_tether", "secrets of the two ends differ", process)
    for process in (urov, topside):
        process.send_signal(signal.SIGINT)
        complaints = process.communicate(timeout=PATIENCE_S)[1]
        assert "the secrets of the two ends differ" in complaints
        assert "Try: --option secret=FILE at both ends" in complaints


@pytest.mark.parametrize(
    ("option", "says", "fix"),
    [
        ("host=192.168.2.2", "could be steered by anybody", "add --option secret=secret.txt at both ends"),
        ("host=127.0.0.1:9120", "has an option of its own", "--option host=127.0.0.1 --option port=9120"),
        ("host=the boat", "no name of a computer", "host=192.168.2.2"),
        ("port=0", "no port at which two ends can meet", "from 1 to 65535"),
        ("port=\u0669\u0661\u0662\u0660", "no port", "port=9120"),
        ("secret=nowhere.txt", "nowhere.txt", "one line of text that both ends have"),
        ("allow=somebody", "allow=somebody", "allow=192.168.2.1"),
        ("power=bord", "power=bord", "did you mean 'board'?"),
        ("power=board", "--io mcu:PORT", "leave it out"),
        ("deadman=yes", "who holds no trigger", "--option pilot=hands"),
    ],
)
def test_an_option_that_cannot_be_meant_is_told_with_what_to_type(
    snr: Any, here: Path, option: str, says: str, fix: str
) -> None:
    answer = snr("run", "urov_teleop", "--role", "urov", "--option", option)
    assert answer.status == 2
    assert says in answer.err
    assert fix in answer.err
    assert list(here.iterdir()) == []


def test_the_surface_may_call_a_vehicle_elsewhere_without_a_secret(here: Path) -> None:
    simulation = prepare(Request("urov_teleop", role="topside", options={"host": "192.0.2.2"}))
    World(simulation)  # that the vehicle takes it, is for the vehicle to say: allow=


def test_an_option_that_is_given_twice_is_told_with_both_values(snr: Any, here: Path) -> None:
    answer = snr("run", "urov_teleop", "--option", "port=9120", "--option", "port=9121")
    assert answer.status == 2
    assert "port=9120 and port=9121" in answer.err
    assert list(here.iterdir()) == []


@pytest.mark.slow
def test_a_person_flies_in_real_time_also_without_asking_for_it(snr: Any, here: Path) -> None:
    ends = DASH.replace(
        "is_over = plant.pushed_s is not None and plant.time_s > plant.pushed_s + 0.6", "is_over = plant.time_s > 0.5"
    )
    (here / "dash.py").write_text(ends)
    answer = snr("run", "./dash.py", "--option", "pilot=hands", "--no-rrd", "--json")
    assert "A person steers, so this run takes as long as it says" in answer.err
    assert answer.json["outcome"] == "still"
    assert answer.json["wall_time_s"] > 0.4
    answer = snr("run", "./dash.py", "--no-rrd", "--json")
    assert "A person steers" not in answer.err


def test_a_role_by_itself_runs_at_no_other_speed_than_the_clocks(snr: Any) -> None:
    answer = snr("run", "urov_teleop", "--role", "topside", "--speed", "4")
    assert answer.status == 2
    assert "on the wall clock" in answer.err


@pytest.mark.parametrize("port", ["abc", "-1", "70000"])
def test_a_port_that_is_none_is_refused(snr: Any, port: str) -> None:
    answer = snr("run", "urov_teleop", "--option", f"port={port}")
    assert answer.status == 2
    assert "port" in answer.err


@pytest.mark.slow
@pytest.mark.parametrize("words", [("--role", "urov", "--option", "port={}"), ("--console", "{}")])
def test_a_port_that_is_taken_is_told_before_there_is_a_run(snr: Any, here: Path, words: tuple[str, ...]) -> None:
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
def test_a_run_that_comes_to_nothing_lets_go_of_its_port(snr: Any, here: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    (here / "file").write_text("no folder")
    assert snr("run", "urov_teleop", "--role", "urov", "--option", f"port={port}", "--out", "file").status == 2
    socket.create_server(("127.0.0.1", port)).close()


def test_roles_that_share_a_plant_do_not_run_apart(snr: Any, here: Path) -> None:
    answer = snr("run", "urov_gate", "--role", "topside")  # its pilot sees the vehicle
    assert answer.status == 2
    assert "only one plant" in answer.err
    assert "without --role" in answer.err
    assert not (here / "runs").exists()


def test_a_pilot_who_does_not_exist_is_told_with_those_who_do(snr: Any) -> None:
    answer = snr("run", "urov_teleop", "--option", "pilot=hand")
    assert answer.status == 2
    assert "did you mean 'hands'?" in answer.err
