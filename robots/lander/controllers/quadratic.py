"""Apollo's quadratic guidance: arrive at a gate at a set time with a set speed, and sink the rest slowly."""

from __future__ import annotations

from snr_sim_robot_lander.parameters import LanderParameters
from snr_sim_robot_lander.reckoning import Reckoning

from snr_sim import Endpoint, EndpointFactory, SomeTasks, Task, TaskId, TaskType
from snr_sim.plants.lander.descent import free_fall
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.scenario import Robot
from snr_sim.prelude.signals import EngineCommand, RadarReading

PATIENCE = 1.55  # time of the flight in units of a free fall; less needs more thrust, more burns more
GATE_M, GATE_MPS = 1.5, -1.0
LAST_S = 1.5  # from here on the law would divide by too little: hold the speed instead
RESPONSE_S = 0.5  # how fast it is held


def factories(robot: Robot) -> list[EndpointFactory]:
    """Return what makes the controller's components."""
    return [QuadraticFactory(robot.parameters)]


class QuadraticFactory(EndpointFactory):
    """Makes the pilot. It keeps the lander's numbers, so that a reload loses none."""

    def __init__(self, parameters: LanderParameters) -> None:
        super().__init__()
        self.parameters = parameters

    def get(self, parent: NodeApi) -> Endpoint:
        """Return a new one."""
        return Quadratic(self, parent, "quadratic")


class Quadratic(Endpoint):
    """Answers every radar reading with a throttle."""

    def __init__(self, factory: QuadraticFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.law = QuadraticLaw(factory.parameters)
        self.task_handlers = {(TaskType.process_data, "radar"): self.on_radar}

    def on_radar(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Pass the reading to the law, and its command to the engine."""
        command = self.law.update(RadarReading(**self.get_data("radar")), self.get_time_s())
        return self.store_data_task("engine", {"throttle": command.throttle})


class QuadraticLaw:
    """Plans a parabola of acceleration to a gate over the ground, again at every reading, and sinks through the gate.

    Args:
        parameters: of the lander.
    """

    def __init__(self, parameters: LanderParameters) -> None:
        self.reckoning = Reckoning(parameters)
        self.arrival_s: float | None = None

    def update(self, radar: RadarReading, now_s: float) -> EngineCommand:
        """Return the throttle for the acceleration that guidance wants now."""
        here = self.reckoning.now(radar, now_s)
        if self.arrival_s is None:
            fall_s, _ = free_fall(max(0.0, here.height_m), here.velocity_mps, self.reckoning.engine.gravity_mps2)
            self.arrival_s = now_s + PATIENCE * fall_s
        to_go_s = self.arrival_s - now_s
        if to_go_s > LAST_S:
            wanted = quadratic_guidance(here.height_m - GATE_M, here.velocity_mps, GATE_MPS, to_go_s)
        else:
            wanted = (GATE_MPS - here.velocity_mps) / RESPONSE_S
        return EngineCommand(self.reckoning.told(self.reckoning.throttle_for(wanted)))


def quadratic_guidance(height_m: float, velocity_mps: float, final_mps: float, to_go_s: float) -> float:
    """Return the acceleration [m/s2] now that leads to height 0 at `final_mps`, unaccelerated, in `to_go_s`.

    Source: the lunar module's approach guidance, Klumpp, "Apollo lunar-descent guidance", Automatica 10 (1974).
    """
    return -12.0 * height_m / to_go_s**2 - 6.0 * (final_mps + velocity_mps) / to_go_s
