"""Clears the yard: two processes look, one drives, and a reference machine changes the state of all three."""

from __future__ import annotations

from snr_sim_robot_housecat.driver import DRIVER
from snr_sim_robot_housecat.process_2d import PROCESS_2D
from snr_sim_robot_housecat.process_3d import PROCESS_3D
from snr_sim_robot_housecat.robot import ranging_of
from snr_sim_robot_housecat.states import PROCESSES, STATES

from snr_sim.behaviors.processes import ControlProcessFactory, reference_parts
from snr_sim.scenario import Factory, RobotInfo


def factories(robot: RobotInfo, ranging: str = "") -> list[Factory]:
    """Return the reference machine and its control processes; `ranging` names those of Process_3D."""
    process_3d = PROCESS_3D[ranging or ranging_of(robot.options)]
    return [
        *reference_parts(STATES, "search", observers=PROCESSES),
        ControlProcessFactory("process_2d", of="reference", states=PROCESS_2D, rate_hz=20.0),
        ControlProcessFactory("process_3d", of="reference", states=process_3d, rate_hz=20.0),
        ControlProcessFactory("driver", of="reference", states=DRIVER, rate_hz=20.0),
    ]
