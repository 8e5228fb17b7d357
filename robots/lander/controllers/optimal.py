"""Falls as long as possible, then burns: the descent of least propellant, planned by closed forms at every reading."""

from __future__ import annotations

from typing import Any

from snr_sim_robot_lander.parameters import LanderParameters
from snr_sim_robot_lander.state_predictor import StatePredictor

from snr_sim import Endpoint, EndpointFactory, SomeTasks, handles
from snr_sim.plants import Engine, Motion, propagate, stop_height
from snr_sim.plants.lander.descent import find_root
from snr_sim.scenario import NodeApi, RobotInfo
from snr_sim.signals import EngineCommand, RadarReading

PLANNED_THRUST = 0.96  # fraction of the thrust that the plan uses: the rest is a margin for noise and model errors
STOP_M = -0.02  # aim just under the ground: the module touches down at half a metre a second instead of hanging over it
EARLY = 0.7  # if less throttle is needed than this, braking is too early: coast for a moment
SOFT_MPS = 0.6  # a touchdown that costs nothing: the gear takes 3.05


def factories(robot: RobotInfo) -> list[EndpointFactory]:
    """Return what makes the controller's components."""
    return [Optimal.factory(parameters=robot.parameters)]


class Optimal(Endpoint):
    """Answers every radar reading with a throttle."""

    parameters: LanderParameters

    def __init__(self, factory: EndpointFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.law = OptimalLaw(self.parameters)

    @handles("radar")
    def on_radar(self, radar: dict[str, Any]) -> SomeTasks:
        """Pass the reading to the law, and its command to the engine."""
        command = self.law.update(RadarReading(**radar), self.get_time_s())
        return self.store_data_task("engine", {"throttle": command.throttle})


class OptimalLaw:
    """Waits as long as it may, then brakes so that it would stand still just under the ground."""

    def __init__(self, parameters: LanderParameters) -> None:
        self.predictor = StatePredictor(parameters)
        self.period_s = 1.0 / parameters.radar.rate_hz
        self.is_burning = False

    def update(self, radar: RadarReading, now_s: float) -> EngineCommand:
        """Return zero throttle before ignition, then the one that stops in time, planned again each time."""
        here = self.predictor.predict(radar, now_s)
        if self.is_burning:
            throttle = self.braking_throttle(here)
        else:
            throttle = self.ignition_throttle(here)
            self.is_burning = throttle > 0.0
        return EngineCommand(self.predictor.set_throttle(throttle))

    def ignition_throttle(self, here: Motion) -> float:
        """Return 0 as long as the next reading is time enough.

        If ignition is due before it, returns the fraction of full thrust that does in a whole period what a burn from
        the right moment to its end would do: so there is no need to begin early.
        """
        thrust, exhaust, gravity = self.predictor.engine
        engine = Engine(PLANNED_THRUST * thrust, exhaust, gravity)

        def spare_m(coast_s: float) -> float:
            return stop_height(propagate(here, 0.0, exhaust, gravity, coast_s), engine) - STOP_M

        if spare_m(self.period_s) > 0.0:
            return 0.0
        coast_s = find_root(spare_m, 0.0, self.period_s) if spare_m(0.0) > 0.0 else 0.0
        return PLANNED_THRUST * (1.0 - coast_s / self.period_s)

    def braking_throttle(self, here: Motion) -> float:
        """Return the throttle that, kept, stops the fall at `STOP_M`: two guesses, and the line through them."""
        thrust, exhaust, gravity = self.predictor.engine
        if here.velocity_mps**2 + 2.0 * gravity * here.height_m < SOFT_MPS**2:
            return 0.0  # falling the rest is soft enough
        if here.height_m <= STOP_M:
            return 1.0
        # With constant mass; the true answer is a little lower, as the module gets lighter.
        first = self.predictor.throttle_for(here.velocity_mps**2 / (2.0 * (here.height_m - STOP_M)))
        if here.velocity_mps >= 0.0 or first < EARLY:
            return 0.0
        second = 0.99 * first
        misses = [stop_height(here, Engine(u * thrust, exhaust, gravity)) - STOP_M for u in (first, second)]
        if misses[0] == misses[1]:
            return first
        return second - misses[1] * (first - second) / (misses[0] - misses[1])
