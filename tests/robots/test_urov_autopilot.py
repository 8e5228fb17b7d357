"""How the vehicle takes controls that were long on their way."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest

from snr_sim import Page, SimRunner, library
from snr_sim.core.config import Config
from snr_sim.prelude.task import Task, TaskType
from snr_sim.testing.parts import TickerFactory

library.load_robot(library.find("robots", "urov"))

from snr_sim_robot_urov.autopilot import Autopilot, AutopilotFactory  # noqa: E402
from snr_sim_robot_urov.controls import Controls  # noqa: E402
from snr_sim_robot_urov.parameters import UrovParameters, vehicle  # noqa: E402


def told(age_s: float, **controls: Any) -> Autopilot:
    """The vehicle's mind after ten seconds of controls that are so old when they come."""
    number = 0

    def bring(loop: Any) -> None:
        nonlocal number
        number += 1
        data = msgspec.structs.asdict(Controls(number, **controls))
        page = Page("controls", data, "topside_node", loop.get_time_s() - age_s, True)
        loop.schedule(Task(TaskType.store_page, "controls", [page]))

    factories = [TickerFactory(bring, "bringer"), AutopilotFactory(UrovParameters(vehicle()))]
    runner = SimRunner(Config(factories={"urov": factories}), until_s=10.0, tells_notes=False)
    runner.run()
    autopilot = runner.nodes["urov"].components["autopilot"]
    assert isinstance(autopilot, Autopilot)
    return autopilot


@pytest.mark.parametrize(("age_s", "rules"), [(0.01, "pilot"), (0.2, "pilot"), (0.3, "idle"), (5.0, "idle")])
def test_controls_that_are_old_when_they_come_are_not_obeyed(age_s: float, rules: str) -> None:
    assert told(age_s, is_armed=True).guard.rules(10.0) == rules


def test_a_stop_is_obeyed_however_long_it_was_on_its_way() -> None:
    assert told(5.0, is_stop=True).guard.is_stopped


def test_age_counts_from_when_controls_were_made() -> None:
    guard = told(0.2, is_armed=True).guard
    assert guard.heard_s is not None
    assert guard.rules(guard.heard_s + 0.24) == "pilot"
    assert guard.rules(guard.heard_s + 0.26) == "neutral"
    assert guard.heard_s <= 9.8 + 1e-9
