"""The controller of stereo.py with two slow processes: 0.3 s of work in 3-D, and 0.2 s in 2-D."""

from process_2d import PROCESS_2D
from snr_sim_robot_housecat.driver import DRIVER
from snr_sim_robot_housecat.process_3d import PROCESS_3D
from snr_sim_robot_housecat.states import STATES

from snr_sim.behaviors.flow import wait
from snr_sim.behaviors.processes import ControlProcessFactory, reference_parts

LOOK_S = 0.2


def slowed(state):
    """Return a state that works for LOOK_S after each `run_state`. Such work cannot be given up half-way."""

    def run_state(self):
        yield from state.run_state(self) or ()
        yield wait(LOOK_S, uninterrupted=True)

    return type("Slow", (state,), {"run_state": run_state})


SLOW_2D = {name: slowed(state) for name, state in PROCESS_2D.items()}


def factories(robot):
    """Return the reference machine and the control processes that follow it."""
    return [
        *reference_parts(STATES, "search", observers=["process_2d", "process_3d", "driver"], step_hz=20.0),
        ControlProcessFactory("process_2d", of="reference", states=SLOW_2D, rate_hz=20.0),
        ControlProcessFactory("process_3d", of="reference", states=PROCESS_3D["slow"], rate_hz=20.0),
        ControlProcessFactory("driver", of="reference", states=DRIVER, rate_hz=20.0),
    ]
