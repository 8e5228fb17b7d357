"""Calls of the functions in students' files: a controller's factories, a scenario's verdict at each new instant.

Errors in them are reported with the student's line first.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any

from snr_sim.core.component import NodeComponent
from snr_sim.core.config import AnyFactory
from snr_sim.core.endpoint import EndpointFactory
from snr_sim.core.factory import FactoryOfClass
from snr_sim.core.loop import LoopFactory
from snr_sim.core.node import Node
from snr_sim.core.source_location import describe_error, location_of, prepend_location, short_path, without_addresses
from snr_sim.prelude import tasks
from snr_sim.prelude.errors import ConfigError, SnrError
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.scenario import RobotInfo, Verdict
from snr_sim.recording.trace import TraceWriter

_TRUTH_PERIOD_S = 0.0499  # 20 Hz, with a margin for rounding


def factories_of(controller: ModuleType, robot: RobotInfo) -> list[AnyFactory]:
    """Return what a controller's `factories(robot)` returns, checked.

    Raises:
        ConfigError: it raised, or returned a value that is not a list of factories.
    """
    made = call_student(controller.factories, "factories(robot)", robot)
    place: object = location_of(controller.factories) or short_path(str(controller.__file__))
    if not isinstance(made, (list, tuple)):
        raise ConfigError(
            f"{place}\n  factories(robot) returned {_shown(made)}, which is not a list.",
            fix="return [MyEndpointFactory()].",
        )
    for factory in made:
        if not isinstance(factory, (EndpointFactory, LoopFactory)):
            name = type(factory).__name__
            if callable(getattr(factory, "get", None)) and not isinstance(factory, type):
                raise ConfigError(
                    f"{location_of(factory.get) or place}\n  {name} has a get() and is not a factory.",
                    fix=f"name what it builds on: class {name}(EndpointFactory).",
                )
            component = factory if isinstance(factory, type) else getattr(factory, "component_class", None)
            if isinstance(component, type) and issubclass(component, NodeComponent):
                fix = f"[{component.__name__}.factory()], with the brackets."
            else:
                fix = "list instances of your EndpointFactory classes: [MyEndpointFactory()], with the brackets."
            raise ConfigError(
                f"{place}\n  factories(robot) returned a list with {_shown(factory)}, which is not a factory.", fix=fix
            )
    return list(made)


def _shown(value: object) -> str:
    """Return a value as in its author's code."""
    if isinstance(value, FactoryOfClass):
        return f"{value.component_class.__name__}.factory"
    return f"the class {value.__name__}" if isinstance(value, type) else without_addresses(repr(value))


def call_student(function: Callable[..., Any], name: str, *args: Any) -> Any:
    """Call a function of a student's file; an error in it is reported with the student's line first.

    Raises:
        ConfigError: it raised.
    """
    try:
        return function(*args)
    except SnrError as error:
        prepend_location(error)
        raise
    except (Exception, SystemExit) as error:
        if isinstance(error, TypeError):
            _check_arity(function, name, args)
        raise ConfigError(describe_error(error, f"while {name} was called")) from error


def _check_arity(function: Callable[..., Any], name: str, args: Sequence[Any]) -> None:
    """Raise a ConfigError if a call failed because the function has other parameters."""
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        return  # some callables written in C have no signature
    try:
        signature.bind(*args)
    except TypeError:
        place, takes = location_of(function), f"{name.partition('(')[0]}({', '.join(signature.parameters)})"
        where = f"{place}\n  " if place is not None else ""
        raise ConfigError(
            f"{where}{takes} is called with {len(args)} argument(s): {name}.", fix=f"def {name}:"
        ) from None


class Referee:
    """Referee that checks the plant at each new instant, and ends every node once there is a verdict."""

    def __init__(self, scenario: Any, plant: Plant, nodes: Sequence[Node], truth: TruthLog | None) -> None:
        self._judge = scenario.verdict
        self._place = short_path(str(scenario.__file__))
        self._plant = plant
        self._nodes = nodes
        self._truth = truth
        self.verdict: Verdict | None = None

    def check(self, time_s: float) -> None:
        """Ask the scenario for its verdict."""
        if self.verdict is None:
            verdict = call_student(self._judge, "verdict(plant)", self._plant)
            if verdict is not None:
                if not isinstance(verdict, Verdict):
                    raise ConfigError(
                        f"{self._place}: verdict(plant) returned {verdict!r}, which is not a Verdict.",
                        fix="return Verdict('landed', True), or None while the run continues.",
                    )
                self.verdict = verdict
                if self._truth is not None:
                    self._truth.record(time_s)  # the evaluated state, before the nodes' last records
                for node in self._nodes:
                    node.enqueue_input(tasks.terminate(self.verdict.outcome), "referee")


class TruthLog:
    """Recorder of the plant's true state, at a limited rate.

    It follows the clock and schedules nothing on it: a run must be the same whether it is recorded or not, and an
    additional instant would split a closed-form step in two.
    """

    def __init__(self, plant: Plant, recorder: TraceWriter) -> None:
        self._plant = plant
        self._recorder = recorder
        self._due_s = 0.0

    def record_if_due(self, time_s: float) -> None:
        """Record the state if the period has passed."""
        if time_s >= self._due_s:
            self.record(time_s)

    def record(self, time_s: float) -> None:
        """Record the state now."""
        self._due_s = time_s + _TRUTH_PERIOD_S
        self._recorder.truth(time_s, self._plant.truth())
