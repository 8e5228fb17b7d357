"""Does nothing, and so shows what the ground is for: the module crashes. The smallest controller there is."""

from __future__ import annotations

from typing import Any

from snr_sim import Endpoint, EndpointFactory, SomeTasks, handles
from snr_sim.scenario import RobotInfo


def factories(robot: RobotInfo) -> list[EndpointFactory]:
    """Return what makes the controller's components."""
    return [Coast.factory()]


class Coast(Endpoint):
    """Answers every radar reading with the engine off."""

    @handles("radar")
    def on_radar(self, radar: dict[str, Any]) -> SomeTasks:
        """Leave the engine off."""
        return self.store_data_task("engine", {"throttle": 0.0})
