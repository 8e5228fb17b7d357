"""Sinks, hovers for a while, sinks slowly and drops: what most people try first. It lands, and wastes propellant."""

from __future__ import annotations

from typing import Any

from snr_sim_robot_lander.parameters import LanderParameters
from snr_sim_robot_lander.state_predictor import StatePredictor

from snr_sim import Endpoint, EndpointFactory, SomeTasks, handles
from snr_sim.scenario import NodeApi, RobotInfo
from snr_sim.signals import EngineCommand, RadarReading

FASTEST_MPS = 25.0
SINK_S = 6.0  # from afar the height over the hover shrinks by 63 % in this time
HOVER_M, HOVER_S = 15.0, 10.0
SLOW_MPS = 1.2
DROP_M = 0.7  # falling from here, 1.2 m/s becomes 1.9: the gear takes 3.05
RESPONSE_S = 0.6  # how fast an error in velocity is taken out


def factories(robot: RobotInfo) -> list[EndpointFactory]:
    """Return what makes the controller's components."""
    return [HoverAndDrop.factory(parameters=robot.parameters)]


class HoverAndDrop(Endpoint):
    """Answers every radar reading with a throttle."""

    parameters: LanderParameters

    def __init__(self, factory: EndpointFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.law = HoverAndDropLaw(self.parameters)

    @handles("radar")
    def on_radar(self, radar: dict[str, Any]) -> SomeTasks:
        """Pass the reading to the law, and its command to the engine."""
        command = self.law.update(RadarReading(**radar), self.get_time_s())
        return self.store_data_task("engine", {"throttle": command.throttle})


class HoverAndDropLaw:
    """Sinks to a height, hovers, sinks slowly, and shuts the engine off."""

    def __init__(self, parameters: LanderParameters) -> None:
        self.predictor = StatePredictor(parameters)
        self.hovering_since_s: float | None = None

    def update(self, radar: RadarReading, now_s: float) -> EngineCommand:
        """Return the throttle that brings the velocity to its target."""
        here = self.predictor.predict(radar, now_s)
        if here.height_m < DROP_M:
            return EngineCommand(self.predictor.set_throttle(0.0))
        error = self.target_speed_mps(here.height_m, now_s) - here.velocity_mps
        return EngineCommand(self.predictor.set_throttle(self.predictor.throttle_for(error / RESPONSE_S)))

    def target_speed_mps(self, height_m: float, now_s: float) -> float:
        """Return the target velocity at a height: fast from afar, none while hovering, slow at the end."""
        if height_m > HOVER_M + 1.0 and self.hovering_since_s is None:
            return -min(FASTEST_MPS, (height_m - HOVER_M) / SINK_S)
        if self.hovering_since_s is None:
            self.hovering_since_s = now_s
        if now_s - self.hovering_since_s < HOVER_S:
            return (HOVER_M - height_m) / SINK_S
        return -SLOW_MPS
