"""Apollo's quadratic guidance: arrive at a gate at a set time with a set speed, and sink the rest slowly."""

from __future__ import annotations

from typing import Any

from snr_sim_robot_lander.parameters import LanderParameters
from snr_sim_robot_lander.state_predictor import StatePredictor

from snr_sim import Endpoint, EndpointFactory, SomeTasks, handles
from snr_sim.plants import free_fall
from snr_sim.scenario import NodeApi, RobotInfo
from snr_sim.signals import EngineCommand, RadarReading

DESCENT_TIME_FACTOR = 1.55  # time of the flight in units of a free fall; less needs more thrust, more burns more
GATE_M, GATE_MPS = 1.5, -1.0
LAST_S = 1.5  # from here on the law would divide by too little: hold the speed instead
RESPONSE_S = 0.5  # how fast it is held


def factories(robot: RobotInfo) -> list[EndpointFactory]:
    """Return what makes the controller's components."""
    return [Quadratic.factory(parameters=robot.parameters)]


class Quadratic(Endpoint):
    """Answers every radar reading with a throttle."""

    parameters: LanderParameters

    def __init__(self, factory: EndpointFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.law = QuadraticLaw(self.parameters)

    @handles("radar")
    def on_radar(self, radar: dict[str, Any]) -> SomeTasks:
        """Pass the reading to the law, and its command to the engine."""
        command = self.law.update(RadarReading(**radar), self.get_time_s())
        return self.store_data_task("engine", {"throttle": command.throttle})


class QuadraticLaw:
    """Plans a parabola of acceleration to a gate over the ground at every reading, and sinks through the gate."""

    def __init__(self, parameters: LanderParameters) -> None:
        self.predictor = StatePredictor(parameters)
        self.arrival_s: float | None = None

    def update(self, radar: RadarReading, now_s: float) -> EngineCommand:
        """Return the throttle for the acceleration that guidance commands."""
        here = self.predictor.predict(radar, now_s)
        if self.arrival_s is None:
            fall_s, _ = free_fall(max(0.0, here.height_m), here.velocity_mps, self.predictor.engine.gravity_mps2)
            self.arrival_s = now_s + DESCENT_TIME_FACTOR * fall_s
        to_go_s = self.arrival_s - now_s
        if to_go_s > LAST_S:
            target_mps2 = quadratic_guidance(here.height_m - GATE_M, here.velocity_mps, GATE_MPS, to_go_s)
        else:
            target_mps2 = (GATE_MPS - here.velocity_mps) / RESPONSE_S
        return EngineCommand(self.predictor.set_throttle(self.predictor.throttle_for(target_mps2)))


def quadratic_guidance(height_m: float, velocity_mps: float, final_mps: float, to_go_s: float) -> float:
    """Return the acceleration [m/s2] now that leads to height 0 at `final_mps`, unaccelerated, in `to_go_s`.

    Source: the lunar module's approach guidance, Klumpp, "Apollo lunar-descent guidance", Automatica 10 (1974).
    """
    return -12.0 * height_m / to_go_s**2 - 6.0 * (final_mps + velocity_mps) / to_go_s
