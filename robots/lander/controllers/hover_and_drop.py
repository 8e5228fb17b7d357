"""Sinks, hovers for a while, sinks slowly and drops: what most people try first. It lands, and wastes propellant."""

from __future__ import annotations

from snr_sim_robot_lander.parameters import LanderParameters
from snr_sim_robot_lander.reckoning import Reckoning

from snr_sim import Endpoint, EndpointFactory, SomeTasks, Task, TaskId, TaskType
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.scenario import Robot
from snr_sim.prelude.signals import EngineCommand, RadarReading

FASTEST_MPS = 25.0
SINK_S = 6.0  # from afar the height over the hover shrinks by 63 % in this time
HOVER_M, HOVER_S = 15.0, 10.0
SLOW_MPS = 1.2
DROP_M = 0.7  # falling from here, 1.2 m/s becomes 1.9: the gear takes 3.05
RESPONSE_S = 0.6  # how fast an error in velocity is taken out


def factories(robot: Robot) -> list[EndpointFactory]:
    """Return what makes the controller's components."""
    return [HoverAndDropFactory(robot.parameters)]


class HoverAndDropFactory(EndpointFactory):
    """Makes the pilot. It keeps the lander's numbers, so that a reload loses none."""

    def __init__(self, parameters: LanderParameters) -> None:
        super().__init__()
        self.parameters = parameters

    def get(self, parent: NodeApi) -> Endpoint:
        """Return a new one."""
        return HoverAndDrop(self, parent, "hover_and_drop")


class HoverAndDrop(Endpoint):
    """Answers every radar reading with a throttle."""

    def __init__(self, factory: HoverAndDropFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.law = HoverAndDropLaw(factory.parameters)
        self.task_handlers = {(TaskType.process_data, "radar"): self.on_radar}

    def on_radar(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Pass the reading to the law, and its command to the engine."""
        command = self.law.update(RadarReading(**self.get_data("radar")), self.get_time_s())
        return self.store_data_task("engine", {"throttle": command.throttle})


class HoverAndDropLaw:
    """Sinks to a height, hovers, sinks slowly, and shuts the engine off.

    Args:
        parameters: of the lander.
    """

    def __init__(self, parameters: LanderParameters) -> None:
        self.reckoning = Reckoning(parameters)
        self.hovering_since_s: float | None = None

    def update(self, radar: RadarReading, now_s: float) -> EngineCommand:
        """Return the throttle that brings the velocity to its target."""
        here = self.reckoning.now(radar, now_s)
        if here.height_m < DROP_M:
            return EngineCommand(self.reckoning.told(0.0))
        error = self.wanted_mps(here.height_m, now_s) - here.velocity_mps
        return EngineCommand(self.reckoning.told(self.reckoning.throttle_for(error / RESPONSE_S)))

    def wanted_mps(self, height_m: float, now_s: float) -> float:
        """Return the target velocity at a height: fast from afar, none while hovering, slow at the end."""
        if height_m > HOVER_M + 1.0 and self.hovering_since_s is None:
            return -min(FASTEST_MPS, (height_m - HOVER_M) / SINK_S)
        if self.hovering_since_s is None:
            self.hovering_since_s = now_s
        if now_s - self.hovering_since_s < HOVER_S:
            return (HOVER_M - height_m) / SINK_S
        return -SLOW_MPS
