"""Housecat's controller: a reference machine, two processes that look, and one that drives."""

from process_2d import PROCESS_2D
from snr_sim_robot_housecat.driver import DRIVER
from snr_sim_robot_housecat.process_3d import PROCESS_3D
from snr_sim_robot_housecat.states import STATES

from snr_sim.behaviors.processes import ControlProcessFactory, reference_parts


def factories(robot):
    """Return the reference machine and the control processes that follow it."""
    return [
        *reference_parts(STATES, "search", observers=["process_2d", "process_3d", "driver"], step_hz=20.0),
        ControlProcessFactory("process_2d", of="reference", states=PROCESS_2D, rate_hz=20.0),
        ControlProcessFactory("process_3d", of="reference", states=PROCESS_3D["stereo"], rate_hz=20.0),
        ControlProcessFactory("driver", of="reference", states=DRIVER, rate_hz=20.0),
    ]
