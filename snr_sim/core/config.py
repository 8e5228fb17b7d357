"""Config: the factories of each role of a robot. It is the complete wiring of a system."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from enum import StrEnum
from typing import TYPE_CHECKING, Any, TypeAlias

from snr_sim.core.profiler import Profiler
from snr_sim.prelude.component import RoleName
from snr_sim.prelude.errors import ConfigError, UnknownNameError, suggest

if TYPE_CHECKING:
    from snr_sim.core.endpoint import EndpointFactory
    from snr_sim.core.loop import LoopFactory

AnyFactory: TypeAlias = "EndpointFactory | LoopFactory"
ComponentsByRole: TypeAlias = Mapping[RoleName, Sequence["AnyFactory"]]

MAX_TASKS_PER_MOMENT = 100_000


class Mode(StrEnum):
    """DEBUG profiles, DEPLOYED is for robots, TEST for tests."""

    DEBUG = "debug"
    DEPLOYED = "deployed"
    TEST = "test"


class Config:
    """Factories by role, and the mode.

    Args:
        mode: DEBUG switches the profiler on.
        factories: for each role the factories of its components, in the order they begin and handle tasks.
        max_tasks_per_moment: maximum number of tasks per node at one instant of virtual time; above it the run ends
            with an error that names the tasks that schedule each other. On the wall clock there is no such limit.
        stall_limit_s: wall time for which a component may block a run; then it is interrupted and the run ends. A
            message is printed after two seconds in any case. If it cannot be interrupted (the run is not in the main
            thread, or on Windows), or it swallows the interrupts, loops are halted and the process is ended.

    Raises:
        ConfigError: the mode is unknown, there are no roles, a role is not a list, or a limit is not valid.
    """

    def __init__(
        self,
        mode: Mode = Mode.DEPLOYED,
        factories: ComponentsByRole | None = None,
        *,
        max_tasks_per_moment: int = MAX_TASKS_PER_MOMENT,
        stall_limit_s: float = float("inf"),
    ) -> None:
        if isinstance(mode, Mapping):
            raise ConfigError(
                "The first argument of this Config is a dict, where its mode belongs.", fix="Config(factories={...})."
            )
        if mode not in list(Mode):
            raise ConfigError(
                f"A Config with the mode {mode!r}.", fix=suggest(str(mode), [*Mode], "Mode.DEBUG, DEPLOYED or TEST")
            )
        if factories is not None and not isinstance(factories, Mapping):
            raise ConfigError(
                f"A Config whose factories are a {type(factories).__name__}.",
                fix="a dict with a list of factories for each role: Config(factories={'my_robot': [MyFactory()]}).",
            )
        if not factories:
            raise ConfigError(
                "This Config has no roles.", fix="Config(factories={'my_robot': [MyEndpointFactory(), ...]})."
            )
        components: Any
        for role, components in factories.items():
            if isinstance(components, str) or not isinstance(components, Iterable):
                raise ConfigError(
                    f"The role '{role}' has {components!r} where its factories belong.",
                    fix=f"a list: Config(factories={{'{role}': [MyFactory()]}}).",
                )
        if type(max_tasks_per_moment) is not int or max_tasks_per_moment < 1:
            raise ConfigError(
                f"A Config with max_tasks_per_moment={max_tasks_per_moment!r}.",
                fix=f"a whole number, such as {MAX_TASKS_PER_MOMENT}.",
            )
        if not (type(stall_limit_s) in (int, float) and stall_limit_s > 0):
            raise ConfigError(f"A Config with stall_limit_s={stall_limit_s!r}.", fix="seconds, such as 60.0.")
        self.mode: Mode = Mode(mode)
        self.max_tasks_per_moment: int = max_tasks_per_moment
        self.stall_limit_s: float = stall_limit_s
        self.factories: dict[RoleName, list[AnyFactory]] = {
            role: list(components) for role, components in factories.items()
        }

    @property
    def bounds(self) -> dict[str, Any]:
        """The limits of a run by their argument names in `Config`, for another config of the same robot."""
        return {"max_tasks_per_moment": self.max_tasks_per_moment, "stall_limit_s": self.stall_limit_s}

    def get(self, role: RoleName) -> list[AnyFactory]:
        """Return the factories of a role; raise an UnknownNameError if there is none of that name."""
        if not isinstance(role, str):
            raise UnknownNameError(f"{role!r} is not the name of a role.", fix=f"one of {', '.join(self.factories)}.")
        if role not in self.factories:
            raise UnknownNameError(f"This Config has no role '{role}'.", fix=suggest(role, self.factories))
        return self.factories[role]

    def get_profiler(self) -> Profiler | None:
        """Return a profiler for a node in DEBUG mode, else None."""
        return Profiler() if self.mode is Mode.DEBUG else None
