"""What the underwater vehicle is made of and what it remembers: thrusters, a body in an engine, all of its state."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import msgspec

from snr_sim.plants.attitude import Quaternion
from snr_sim.plants.urov.dive import Dive
from snr_sim.plants.urov.hydrodynamics import AT_REST
from snr_sim.plants.urov.vehicle import Matrix, Six, Vector


class Thrusters(Protocol):
    """What the plant asks of its thrusters; `Propulsion` is it."""

    count: int
    voltage_v: float

    @property
    def forces_n(self) -> list[float]:
        """Of each thruster along its own axis."""
        ...

    @property
    def mean_forces_n(self) -> list[float]:
        """The same, on average over the last step."""
        ...

    @property
    def current_a(self) -> float:
        """All that is drawn from the supply."""
        ...

    @property
    def charge(self) -> float:
        """What is left in the supply, 0 to 1."""
        ...

    def reset(self) -> None:
        """Puts everything back to the start."""
        ...

    def step(self, dt_s: float, pulses_us: list[float | None]) -> None:
        """Moves on."""
        ...

    def mixed(self, matrix: Matrix) -> list[float]:
        """Returns a matrix of n columns times `mean_forces_n`."""
        ...

    def fail(self, thruster: int, fault: str, share: float = 0.5) -> None:
        """Breaks a thruster."""
        ...

    def snapshot(self) -> Any:
        """Returns all of the state."""
        ...

    def restore(self, snapshot: Any) -> None:
        """Puts back what `snapshot` returned."""
        ...


class Body(Protocol):
    """What both engines' bodies tell and take: MuJoCo's in space, and pymunk's in the plane."""

    engine: str
    rigid: Matrix
    gravity_mps2: float

    def clear(self) -> None:
        """Puts the whole world back to its start."""
        ...

    def put(self, pose: Sequence[float], velocity: Sequence[float]) -> None:
        """Puts the body somewhere: see `MujocoBody.put`."""
        ...

    def height_over_ground_m(self, place: Sequence[float]) -> float:
        """Returns how far it is straight down from a place to anything but the body; negative if there is nothing."""
        ...

    def deepest(self) -> tuple[str, float]:
        """Returns in what the body is deepest, and how deep [m]; 0 if it is in nothing."""
        ...

    def snapshot(self) -> Any:
        """Returns all of the state."""
        ...

    def restore(self, snapshot: Any) -> None:
        """Puts back what `snapshot` returned."""
        ...


class WrenchCommand(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A force and a moment on the vehicle, in its own frame: what a test asks for instead of pulses.

    Args:
        force_n: along x, y, z.
        moment_nm: about x, y, z.
    """

    force_n: list[float] = msgspec.field(default_factory=lambda: [0.0] * 3)
    moment_nm: list[float] = msgspec.field(default_factory=lambda: [0.0] * 3)


class State(NamedTuple):
    """All of the plant. Without defaults: a start."""

    dive: Dive
    place: Vector
    attitude: Quaternion
    velocity: Vector  # world frame
    rate: Vector  # body frame
    mujoco: Any = None
    thrusters: Any = None
    steps: int = 0
    happened: int = 0  # how many moments of the dive have passed
    acceleration: Six = AT_REST  # of the velocity through the water, body frame, without contacts
    guess: Six = AT_REST  # what it will be in the next step
    gained: Vector = (0.0, 0.0, 0.0)  # acceleration of the last step, world frame
    wet: float = 1.0  # share of the volume in the middle of the last step
    taken: float = 1.0  # the share whose water has been brought to the vehicle's speed
    water_l: float = 0.0  # leaked and weighed
    wrench: Six = AT_REST
    pulses: tuple[float | None, ...] = ()
    pulses_until_s: float = math.inf
    contact_n: Vector | None = None  # None: nothing touched
    pressed_n: float = 0.0  # what contacts pushed in the last part of the last step
    tether_n: Vector = (0.0, 0.0, 0.0)
