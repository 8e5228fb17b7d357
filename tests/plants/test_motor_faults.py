"""Motors of a rover that break, in both engines."""

from __future__ import annotations

from typing import Any

import pytest

from snr_sim.plants import MotorFault, RoverStart
from snr_sim.plants.ground.height_map import flat
from snr_sim.plants.ground.motor_faults import DRAG_NM
from snr_sim.plants.ground.rover import Rover
from snr_sim.plants.ground.rover_2d import Rover2D
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.ground_signals import DriveCommand, MotorReading
from tests.lanes import slow

from .test_rover import VEHICLE

ENGINES = [Rover2D, slow(Rover)]


def driving(engine: Any, *faults: MotorFault, until_s: float) -> Any:
    """A rover on level ground that is asked to drive with 5 rad/s."""
    rover = engine(VEHICLE, flat(), lambda seed: RoverStart(faults=faults))
    rover.write("drive", DriveCommand("speed", [5.0] * 6))
    advance(rover, until_s)
    return rover


def advance(rover: Any, until_s: float) -> None:
    while rover.time_s < until_s - 1e-9:
        rover.step(rover.step_s)


@pytest.mark.parametrize("engine", ENGINES)
def test_dead_motor_takes_no_current_and_its_wheel_turns_with_the_ground(engine: Any) -> None:
    rover = driving(engine, MotorFault(0.2, "LM"), until_s=0.1)
    assert rover.read("motor_LM").current_a != 0.0
    advance(rover, 1.5)
    reading: MotorReading = rover.read("motor_LM")
    assert reading.current_a == 0.0
    assert reading.speed_radps == pytest.approx(rover.read("motor_RM").speed_radps, rel=0.05)


@pytest.mark.parametrize("engine", ENGINES)
def test_jammed_gear_locks_its_wheel_while_the_motor_pushes_with_all_it_has(engine: Any) -> None:
    rover = driving(engine, MotorFault(0.2, "RB", "drags"), until_s=1.0)
    reading = rover.read("motor_RB")
    assert abs(reading.speed_radps) < 0.1
    assert reading.current_a == pytest.approx(VEHICLE.motor.limit_a)
    assert VEHICLE.motor.limit_a * VEHICLE.motor.nm_per_a < DRAG_NM
    assert rover.read("motor_LF").speed_radps > 4.0


@pytest.mark.parametrize("engine", ENGINES)
def test_silent_controller_gives_no_reading_and_the_others_do(engine: Any) -> None:
    rover = driving(engine, MotorFault(0.1, "LF", "silent"), until_s=0.098)
    assert isinstance(rover.read("motor_LF"), MotorReading)
    advance(rover, 0.1)
    assert isinstance(rover.read("motor_LF"), Stale)
    assert isinstance(rover.read("motor_LM"), MotorReading)


@pytest.mark.parametrize("engine", ENGINES)
def test_snapshots_before_a_failure_and_after_it_continue_alike(engine: Any) -> None:
    rover = driving(engine, MotorFault(0.25, "LM"), MotorFault(0.15, "RM", "drags"), until_s=0.2)
    kept = rover.snapshot()
    advance(rover, 0.4)
    after = rover.snapshot()
    for snapshot in (kept, after):
        rover.restore(snapshot)
        advance(rover, 0.4)
        assert rover.motors.faults.broken == {1: "dead", 4: "drags"}
        assert rover.snapshot() == after
    rover.reset(0)
    assert rover.motors.faults.broken == {}


def test_faults_change_nothing_before_they_happen() -> None:
    assert driving(Rover2D, MotorFault(0.5, "LM"), until_s=0.4).state == driving(Rover2D, until_s=0.4).state


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (lambda: MotorFault(-1.0, "LF"), "at_s"),
        (lambda: MotorFault(1.0, "LF", "ded"), "did you mean 'dead'"),  # type: ignore[arg-type]
        (
            lambda: driving(Rover2D, MotorFault(1.0, "LX"), until_s=0.0),
            "'LX' is to break, and there is no such one.*LF",
        ),
        (lambda: driving(Rover2D, MotorFault(1.0, 3), until_s=0.0), "3 is to break"),  # type: ignore[arg-type]
        (lambda: RoverStart(faults=["LF"]), "give a tuple of MotorFault"),  # type: ignore[arg-type]
    ],
)
def test_impossible_fault_is_refused(fault: Any, message: str) -> None:
    with pytest.raises(ParameterError, match=r"(?s)" + message):
        fault()
