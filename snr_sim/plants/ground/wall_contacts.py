"""What walls, furniture and people do to a body that moves among them."""

from __future__ import annotations

from snr_sim.plants.ground.body_space import BodySpace
from snr_sim.plants.impulses_2d import resolve_contacts

Speeds = tuple[float, float, float]  # of the centre of mass along x and y, world frame [m/s], and of turning [rad/s]


class WallContacts:
    """Impulses at contacts of a body, and when the next is possible.

    `fastest_mps` is the largest speed at which a part of it and a person can approach each other.
    """

    def __init__(self, mass_kg: float, inertia_kgm2: float, friction: float, fastest_mps: float, step_s: float) -> None:
        self._mobility = ((1.0 / mass_kg, 0.0, 0.0), (0.0, 1.0 / mass_kg, 0.0), (0.0, 0.0, 1.0 / inertia_kgm2))
        self._friction, self._step_s, self._way_m = friction, step_s, fastest_mps * step_s
        self._free_steps = 0  # for so many steps nothing can be touched

    def restart(self) -> None:
        """Forget how far the walls were."""
        self._free_steps = 0

    @property
    def is_clear(self) -> bool:
        """Whether body and bars cannot touch anything where they are."""
        return self._free_steps > 0

    def is_due(self) -> bool:
        """Count a step; return whether something may be touched in it."""
        self._free_steps -= 1
        return self._free_steps <= 0

    def resolve(self, space: BodySpace, speeds: Speeds) -> tuple[Speeds, float]:
        """Return the speeds after all contacts, and the largest speed of a part towards what it met [m/s]."""
        clearance_m = space.clearance_m()
        if clearance_m > 0.0:
            self._free_steps = int(clearance_m / self._way_m)
            return speeds, 0.0
        contacts = space.contacts()
        if not contacts:
            return speeds, 0.0
        vx, vy, turn = speeds
        hit_mps = max(-(one.out_x * (vx - turn * one.arm_z) + one.out_z * (vy + turn * one.arm_x)) for one in contacts)
        # `impulses_2d` counts turns from x to z, the axis of the other plane, the other way.
        (vx, vy, turn), _ = resolve_contacts((vx, vy, -turn), contacts, self._mobility, self._friction, self._step_s)
        return (vx, vy, -turn), hit_mps
