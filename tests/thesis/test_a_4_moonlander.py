"""Listing A.4: a lunar module whose pilot asks a Q function what to do; on the course's own plant, so that it flies.

    snr run lander_vertical --controller tests/thesis/test_a_4_moonlander.py

What was wrong. The program could not start: its endpoint lacked begin, halt and terminate, its factory had no place
for the Q function, names were not imported, and a handler asserted that one value was an int and a float. Its text
speaks of `TaskType.store_data` and `tasks.store_data`, which never existed, and calls `self.get_page` in a ThreadLoop,
which had none. Its engine is too weak for any pilot to land.

What we changed. Of the listing only what runs in no library, each reported with its line: the Q function that is not
given, the handler's assertion, and `tasks.store_data`. `Falling` and `Throttle`, below, use its names and calls as
they are. For a flight on the course's plant the factory takes the Q function, which is any function of (state,
action), or a table of values. The pilot answers each radar page with the action of the highest value. Endpoints need
begin, halt and terminate only if they have something to do there; loops have get_page. Sensor and engine come from the
robot `lander`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TypeAlias

import pytest

from snr_sim import (
    AbstractNode,
    Config,
    Endpoint,
    EndpointFactory,
    LoopFactory,
    Node,
    Page,
    SimClock,
    SomeTasks,
    Task,
    TaskHandler,
    TaskId,
    TaskType,
    ThreadLoop,
    WallClock,
    tasks,
)
from snr_sim.prelude.errors import ComponentFailedError, ConfigError
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import RunResult, SimulationRun
from snr_sim.testing.function_components import FunctionEndpointFactory

ACTIONS = (0.0, 0.15, 0.3, 0.45, 0.6, 1.0)  # throttle
State: TypeAlias = tuple[float, float]  # altitude_m, velocity_mps
Cell: TypeAlias = tuple[int, int]
QFunction: TypeAlias = Callable[[State, float], float]


class MoonLanderFactory(EndpointFactory):
    """Makes the pilot, and keeps what it has learnt."""

    def __init__(self, q_function: QFunction, actions: Sequence[float] = ACTIONS) -> None:
        super().__init__()
        self.q_function = q_function
        self.actions = tuple(actions)

    def get(self, parent: Node) -> Endpoint:
        return MoonLander(self, parent, "moon_lander")


class MoonLander(Endpoint):
    """Takes the best action at each reading of the radar."""

    factory: MoonLanderFactory

    def __init__(self, factory: MoonLanderFactory, parent: Node, name: str) -> None:
        super().__init__(factory, parent, name)
        self.task_handlers = {(TaskType.process_data, "radar"): self.act}

    def act(self, task: Task, task_id: TaskId) -> SomeTasks:
        radar = self.get_data("radar")
        state = (radar["altitude_m"], radar["velocity_mps"])
        best = max(self.factory.actions, key=lambda action: self.factory.q_function(state, action))
        return self.store_data_task("engine", {"throttle": best})


def braking_q(state: State, action: float) -> float:
    """The nearer an action brings the velocity to one that fits the height, the better it is."""
    altitude_m, velocity_mps = state
    target_mps = -min(1.0 + 0.06 * altitude_m, 30.0)
    acceleration_mps2 = action * 45_040.0 / 7_900.0 - 1.62
    return -abs(velocity_mps + acceleration_mps2 * 0.5 - target_mps)


def cell_of(state: State) -> Cell:
    """The cell of a table that a state lies in: 2 m and 0.5 m/s wide near the ground, where it matters."""
    altitude_m, velocity_mps = state
    return int(altitude_m / 2.0 if altitude_m < 100.0 else 40.0 + altitude_m / 10.0), round(velocity_mps * 2.0)


def from_table(table: Mapping[Cell, Mapping[float, float]]) -> QFunction:
    """A Q function that looks its values up; what was never visited is worth nothing."""
    return lambda state, action: table.get(cell_of(state), {}).get(action, 0.0)


def learnt_table() -> dict[Cell, dict[float, float]]:
    """A table as learning would leave it: the values of `braking_q` in the middle of each cell."""
    table: dict[Cell, dict[float, float]] = {}
    for row in range(160):
        altitude_m = row * 2.0 + 1.0 if row < 50 else (row - 40) * 10.0 + 5.0
        for column in range(-80, 21):
            state = (altitude_m, column / 2.0)
            table[cell_of(state)] = {action: braking_q(state, action) for action in ACTIONS}
    return table


class Falling(ThreadLoop):
    """A stone with an engine, one step a second: the listing's plant, with its names."""

    def __init__(self, factory: LoopFactory, parent: AbstractNode, altitude: float, thrust: float) -> None:
        super().__init__(factory, parent, "radar_sensor", max_tick_rate_hz=1)
        self.altitude = altitude
        self.velocity = 0.0
        self.thrust = thrust

    def setup(self) -> None:
        self.store_data("thruster_data", 0)

    def loop(self) -> None:
        page = self.get_page("thruster_data")
        assert isinstance(page, Page)
        self.velocity += -9.8 + page.data * self.thrust
        self.altitude += self.velocity
        if self.altitude <= 0:
            if self.velocity < -5.0:
                raise RuntimeError("too fast")
            self.schedule(tasks.terminate("landed"))
            self.set_terminate_flag()
        self.store_data("radar_data", (self.altitude, self.velocity))

    def halt(self) -> None: ...

    def terminate(self) -> None: ...


class FallingFactory(LoopFactory):
    """Makes the stone; the listing's engine is a tenth of a unit of thrust, and lands nothing."""

    def __init__(self, thrust: float = 0.1) -> None:
        super().__init__()
        self.thrust = thrust

    def get(self, parent: AbstractNode) -> Falling:
        return Falling(self, parent, 50.0, self.thrust)


class Throttle(Endpoint):
    """Asks the Q function of each radar page, while that is stored."""

    def __init__(self, factory: EndpointFactory, parent: AbstractNode, q_function: QFunction) -> None:
        super().__init__(factory, parent, "q_learning_controller")
        self.task_handlers = {(TaskType.store_data, "radar_data"): self.set_throttle}
        self.q_function = q_function

    def set_throttle(self, task: Task, key: TaskId) -> SomeTasks:
        state = task.val_list[0].data
        value = max((0, 1, 2, 3), key=lambda action: self.q_function(state, action))
        return self.store_data_task("thruster_data", value)


class ThrottleFactory(EndpointFactory):
    """Makes the endpoint, and forgets the Q function if it is given none, as the listing does."""

    def __init__(self, *q_function: QFunction) -> None:
        super().__init__()
        self.q_function = q_function

    def get(self, parent: AbstractNode) -> Throttle:
        return Throttle(self, parent, *self.q_function)


def falling(*factories: EndpointFactory | LoopFactory, clock: type[SimClock | WallClock] = SimClock) -> Node:
    node = Node("lunar_module", Config(factories={"lunar_module": factories}), clock=clock())
    node.loop()
    return node


@pytest.mark.parametrize("clock", [SimClock, pytest.param(WallClock, marks=pytest.mark.slow)])
def test_the_listings_plant_and_pilot_run_by_their_names_and_fall(clock: type[SimClock | WallClock]) -> None:
    with pytest.raises(ComponentFailedError, match=r"(?s)raise RuntimeError.*too fast") as caught:
        falling(FallingFactory(), ThrottleFactory(lambda state, action: action), clock=clock)
    assert caught.value.component == "radar_sensor"


def measure_the_page(task: Task, key: TaskId) -> None:
    """The first part of the listing's assertion."""
    assert len(task.val_list[0]) == 2


def assert_two_types(task: Task, key: TaskId) -> None:
    """The second part, of the page's data."""
    altitude = task.val_list[0].data[0]
    assert isinstance(altitude, int)
    assert isinstance(altitude, float)


def store_by_a_function(task: Task, key: TaskId) -> SomeTasks:
    """The listing's answer."""
    return tasks.store_data("thruster_data", 0)


@pytest.mark.parametrize(
    ("handler", "message"),
    [
        (measure_the_page, r"line \d+: assert len\(.*'Page' has no len.*Try: a page has its data in data"),
        (assert_two_types, r"line \d+: assert isinstance\(altitude, int\)\n  AssertionError"),
        (store_by_a_function, r"line \d+: return tasks\.store_data\(.*Try: self\.store_data_task\(key, data\)"),
    ],
)
def test_line_that_runs_in_no_library_is_reported(handler: TaskHandler, message: str) -> None:
    pilot = FunctionEndpointFactory({(TaskType.store_data, "radar_data"): handler}, "q_learning_controller")
    with pytest.raises(ComponentFailedError, match=f"(?s){message}"):
        falling(FallingFactory(), pilot)


def test_with_a_stronger_engine_they_land() -> None:
    def q_function(state: State, action: float) -> float:
        altitude, velocity = state
        return -abs(velocity - 9.8 + action * 6.0 - max(-10.0, min(-2.0, -altitude / 4.0)))

    node = falling(FallingFactory(thrust=6.0), ThrottleFactory(q_function))
    assert node.exit_reason == "landed"
    assert node.get_data("radar_data")[0] <= 0.0


def test_factory_without_q_function_reports_line() -> None:
    with pytest.raises(
        ConfigError, match=r"(?s)return Throttle\(self, parent.*'q_function'.*Try: give them: Throttle\("
    ):
        falling(FallingFactory(), ThrottleFactory())


def factories(robot: object) -> list[EndpointFactory]:
    """What `snr run --controller` asks for."""
    return [MoonLanderFactory(braking_q)]


def run_with(q_function: QFunction) -> RunResult:
    simulation = prepare(Request("lander_vertical", controller=str(Path(__file__))))
    plant = simulation.plant()
    config = simulation.config(plant)
    for role in config.factories.values():
        role[:] = [MoonLanderFactory(q_function) if type(one).__name__ == "MoonLanderFactory" else one for one in role]
    return SimulationRun(simulation, plant, config).run()


def test_unchanged_program_lands() -> None:
    simulation = prepare(Request("lander_vertical", controller=str(Path(__file__))))
    plant = simulation.plant()
    result = SimulationRun(simulation, plant, simulation.config(plant)).run()
    assert result.success, result


def test_a_table_that_was_learnt_lands_too() -> None:
    assert run_with(from_table(learnt_table())).success


def test_empty_table_crashes() -> None:
    result = run_with(from_table({}))
    assert not result.success
    assert abs(result.metrics["touchdown"]["vertical_mps"]) > 50.0  # free fall from 1000 m on the moon: 57
