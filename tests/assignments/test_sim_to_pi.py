"""The lab "sim to Pi": what its pages tell a student to type works, and its reference holds and is safe."""

import math
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from typer.main import get_command

from snr_sim import Config, Endpoint, EndpointFactory, Loop, LoopFactory, SimRunner, TaskType
from snr_sim.cli.main import app
from snr_sim.library import load_controller
from snr_sim.prelude.scenario import Robot

ROOT = Path(__file__).parents[2]
LAB = ROOT / "assignments" / "08_sim_to_pi"
REFERENCE = Path(__file__).parent / "sim_to_pi" / "reference" / "depth_hold.py"
DISARMED = {"number": 1, "is_armed": False, "is_stop": False, "clears_stop": False, "depth_m": None}
ARMED = {**DISARMED, "is_armed": True, "depth_m": 3.0}
IMU = {"roll_rad": 0.0, "pitch_rad": 0.0, "yaw_rad": 0.0}


def commands(page: str) -> list[tuple[str, str]]:
    """The lines of a page's shell blocks, each with its remark."""
    lines = [line for block in re.findall(r"```sh\n(.*?)```", page, flags=re.DOTALL) for line in block.splitlines()]
    return [(command.strip(), remark) for command, _, remark in (line.partition("  #") for line in lines)]


def test_all_commands_of_the_lab_do_what_it_says_and_the_reference_holds(tmp_path: Path, emulators: None) -> None:
    (tmp_path / "assignments").symlink_to(ROOT / "assignments")
    (tmp_path / "bin").mkdir()
    snr = tmp_path / "bin" / "snr"
    snr.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m snr_sim "$@"\n')
    snr.chmod(0o755)
    path = f"{snr.parent}{os.pathsep}{os.environ['PATH']}"
    for command, remark in commands((LAB / "README.md").read_text()):
        line = re.sub(r"^snr run (?!.*--no-rrd)", "snr run --no-rrd ", command)  # a view for each would take long
        done = subprocess.run(
            line, shell=True, cwd=tmp_path, env={**os.environ, "PATH": path}, capture_output=True, text=True
        )
        assert done.returncode == (1 if "exit status 1" in remark else 0), (command, done.stdout, done.stderr)
        if "depth_lab/first" in command and command.startswith("snr run"):
            assert "settled never after the step" in done.stderr
            shutil.copy(REFERENCE, tmp_path / "depth_lab" / "depth_hold.py")  # the student has done the work
        if command.endswith("emulated/*"):
            assert re.search(r"0 \| 20 ms *\n? *after the command", done.stdout)
    assert (tmp_path / "depth_lab" / "both.png").read_bytes()[:4] == b"\x89PNG"


def test_every_command_and_picture_that_the_pages_name_is_there() -> None:
    verbs: dict[str, Any] = get_command(app).commands  # type: ignore[attr-defined]
    for page in ("README.md", "bench.md"):
        text = (LAB / page).read_text()
        for picture in re.findall(r"\]\(((?:pictures/|\.\./)[^)]*|bench\.md)\)", text):
            assert (LAB / picture).exists(), picture
        for verb, rest in re.findall(r"^ *snr (\w+)(.*)$", text, flags=re.MULTILINE):
            known = {option for parameter in verbs[verb].params for option in parameter.opts}
            assert set(re.findall(r" (--[a-z-]+)", rest.partition("  #")[0])) <= known, rest


class PagesFactory(LoopFactory):
    """Stores what a table says, at its times: {key: (rate, what to store at a time, or nothing)}."""

    def __init__(self, key: str, rate_hz: float, data_at: Any) -> None:
        super().__init__()
        self.key, self.rate_hz, self.data_at = key, rate_hz, data_at

    def get(self, parent: Any) -> Loop:
        return Pages(self, parent, f"{self.key}_sensor", self.rate_hz)


class Pages(Loop):
    factory: PagesFactory

    def loop(self) -> None:
        data = self.factory.data_at(self.get_time_s())
        if data is not None:
            self.store_data(self.factory.key, data)


class WatchFactory(EndpointFactory):
    def __init__(self) -> None:
        super().__init__()
        self.pulses: list[tuple[float, list[float]]] = []

    def get(self, parent: Any) -> Endpoint:
        return Watch(self, parent, "watch")


class Watch(Endpoint):
    factory: WatchFactory

    def __init__(self, factory: WatchFactory, parent: Any, name: str) -> None:
        super().__init__(factory, parent, name)
        self.task_handlers = {TaskType.store_page: self.on_page}

    def on_page(self, task: Any, task_id: Any) -> None:
        if task.name == "pwm":
            self.factory.pulses.append((self.get_time_s(), self.get_data("pwm")["pulses_us"]))


def pushed_at(tmp_path: Path, controls_at: Any, depth_until_s: float = math.inf) -> list[float]:
    """When, within six seconds, the reference pushed."""
    shutil.copy(LAB / "starter" / "telling.py", tmp_path)
    shutil.copy(REFERENCE, tmp_path)
    robot = Robot("urov", "urov", "urov_depth_hold", "mujoco", None, {})
    found: Any = type("Found", (), {"path": tmp_path, "name": "urov"})()
    controller = load_controller(found, str(tmp_path / "depth_hold.py"))
    watch = WatchFactory()

    def depth_at(t: float) -> Any:
        return {"depth_m": 1.0, "stamp_s": t} if t < depth_until_s else None

    loops = [
        PagesFactory("controls", 20.0, controls_at),
        PagesFactory("depth", 20.0, depth_at),
        PagesFactory("imu", 50.0, lambda t: IMU),
    ]
    SimRunner(Config(factories={"urov": [*loops, *controller.factories(robot), watch]}), until_s=6.0).run()
    assert all(1100.0 <= pulse <= 1900.0 for _, pulses in watch.pulses for pulse in pulses)
    return [t for t, pulses in watch.pulses if pulses != [1500.0] * 8]


def test_the_reference_pushes_while_it_is_armed_and_only_then(tmp_path: Path) -> None:
    times = pushed_at(tmp_path, lambda t: ARMED if 2.0 <= t < 4.0 else DISARMED)
    assert 2.0 <= times[0] < 2.2
    assert 3.9 < times[-1] < 4.05


def test_the_reference_stops_within_a_third_of_a_second_of_the_last_controls_and_of_the_last_depth(
    tmp_path: Path,
) -> None:
    assert 3.0 < pushed_at(tmp_path, lambda t: ARMED if t < 3.0 else None)[-1] < 3.33
    assert 3.0 < pushed_at(tmp_path, lambda t: ARMED, depth_until_s=3.0)[-1] < 3.33


def test_the_reference_holds_where_it_was_armed_if_nobody_asks_for_a_depth(tmp_path: Path) -> None:
    def controls_at(t: float) -> Any:
        if t < 2.0:
            return ARMED if t < 1.0 else DISARMED  # asks for 3 m, and is disarmed: that is forgotten
        return {**ARMED, "depth_m": None}

    times = pushed_at(tmp_path, controls_at)
    assert times
    assert max(times) < 1.05  # the depth is as it was: nothing is to be done


def test_a_stop_of_the_reference_stays_until_it_is_cleared_disarmed(tmp_path: Path) -> None:
    def controls_at(t: float) -> Any:
        if 2.0 <= t < 2.1:
            return {**ARMED, "is_stop": True}
        if 4.0 <= t < 4.1:
            return {**ARMED, "clears_stop": True}
        return {**DISARMED, "clears_stop": True} if 5.0 <= t < 5.1 else ARMED

    times = pushed_at(tmp_path, controls_at)
    assert max(t for t in times if t < 4.5) < 2.05
    assert 5.0 < min(t for t in times if t > 4.5) < 5.2
