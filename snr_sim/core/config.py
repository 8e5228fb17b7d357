"""Config: which factories make up each role of a robot. The whole wiring of a system stands in this one place."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from enum import StrEnum
from typing import TYPE_CHECKING, Any, TypeAlias

from snr_sim.core.profiler import Profiler
from snr_sim.prelude.component import RoleName
from snr_sim.prelude.errors import ConfigError, UnknownName, nearest

if TYPE_CHECKING:
    from snr_sim.core.endpoint import EndpointFactory
    from snr_sim.core.loop import LoopFactory

AnyFactory: TypeAlias = "EndpointFactory | LoopFactory"
ComponentsByRole: TypeAlias = Mapping[RoleName, Sequence["AnyFactory"]]


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

    Raises:
        ConfigError: there is no role, or a role is no list.
    """

    def __init__(self, mode: Mode = Mode.DEPLOYED, factories: ComponentsByRole | None = None) -> None:
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
        self.mode = mode
        self.factories = {role: list(components) for role, components in factories.items()}

    def get(self, role: RoleName) -> list[AnyFactory]:
        """Returns the factories of a role.

        Raises:
            UnknownName: there is no such role.
        """
        if role not in self.factories:
            raise UnknownName(f"This Config has no role '{role}'.", fix=nearest(role, self.factories))
        return self.factories[role]

    def get_profiler(self) -> Profiler | None:
        """Returns a profiler for a node, or None if the mode wants none."""
        return Profiler() if self.mode is Mode.DEBUG else None
