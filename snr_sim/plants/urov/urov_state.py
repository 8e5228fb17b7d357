"""Parts and state of the underwater vehicle: its models of motion, its inputs, and its full state."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import msgspec

from snr_sim.plants.attitude import Quaternion
from snr_sim.plants.mujoco_body import MujocoBody
from snr_sim.plants.urov.dive import Dive
from snr_sim.plants.urov.hydrodynamics import AT_REST
from snr_sim.plants.urov.pool_2d import Pool2D
from snr_sim.plants.urov.vehicle import Six, Vector

Body: TypeAlias = MujocoBody | Pool2D  # in space, and in the plane


class Mover(ABC):
    """What moves the vehicle: in space (`space_mover.py`) or in the plane (`urov_2d.py`)."""

    acceleration: Six = AT_REST  # of the velocity through the water, body frame, without contacts
    guess: Six = AT_REST  # what it will be in the next step
    contact_n: Vector | None = None  # what contacts pushed in the last step, world frame; None: nothing touched
    pressed_n: float = 0.0  # the same in the last part of it, as a size

    @abstractmethod
    def advance(self, wrench: Sequence[float]) -> None:
        """Advance by one step under a wrench."""

    @abstractmethod
    def engine_state(self) -> Any:
        """Return all of the engine's state."""

    @abstractmethod
    def invalidate(self) -> None:
        """Invalidate what depends on the pose: the vehicle was moved."""


class WrenchCommand(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A force and a moment on the vehicle, in its own frame: what a test asks for instead of pulses.

    Args:
        force_n: along x, y, z.
        moment_nm: about x, y, z.
    """

    force_n: list[float] = msgspec.field(default_factory=lambda: [0.0] * 3)
    moment_nm: list[float] = msgspec.field(default_factory=lambda: [0.0] * 3)


class UrovState(NamedTuple):
    """All of the plant: attributes of its parts, which say what they are. Without defaults: a start."""

    dive: Dive
    position: Vector
    attitude: Quaternion
    velocity: Vector
    rate: Vector
    mujoco: Any = None
    thrusters: Any = None
    steps: int = 0
    event_count: int = 0  # how many moments of the dive have passed
    acceleration: Six = AT_REST
    guess: Six = AT_REST
    acceleration_world: Vector = (0.0, 0.0, 0.0)
    wet: float = 1.0
    entrained_fraction: float = 1.0
    water_l: float = 0.0
    wrench: Six = AT_REST
    pulses: Sequence[float | None] = ()
    until_s: float = math.inf
    contact_n: Vector | None = None
    pressed_n: float = 0.0
    tether_n: Vector = (0.0, 0.0, 0.0)
