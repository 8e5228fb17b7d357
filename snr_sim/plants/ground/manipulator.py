"""The arm of a rover: six joints with servos that hold an angle, under MuJoCo.

    base         turns about the vertical       0: ahead; positive to the left
    shoulder     lifts the upper arm            0: level; positive up
    elbow        lifts the forearm against it   0: straight; positive up
    wrist_pitch  lifts the hand against that    0: straight; positive up
    wrist_roll   turns the hand about its length
    grip         opens the finger               0: closed

Parts are thin rods. They touch nothing: neither ground nor rocks nor the rover itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

from snr_sim.plants.mujoco_engine import MujocoWorld
from snr_sim.plants.parameter_limits import GRAMS, IS_ABOVE, MILLIMETRES, Limit, Record, check_valid
from snr_sim.prelude.errors import PlantError
from snr_sim.prelude.ground_signals import ARM_JOINTS, ArmCommand, ArmReading

PLACE_M = Limit(-2.0, 2.0, "m", "it is on the rover", MILLIMETRES)
LENGTH_M = Limit(0.01, 2.0, "m", "an arm of a rover reaches a metre", MILLIMETRES)
ROD_KG = Limit(0.0, 50.0, "kg", "an arm of a rover has 5", GRAMS, IS_ABOVE)
TORQUE_NM = Limit(0.0, 1000.0, "N m", "a shoulder has 60", {}, IS_ABOVE)
ANGLE_RAD = Limit(-2.0 * math.pi, 2.0 * math.pi, "rad", "a joint turns once at most", {"degrees": math.pi / 180.0})
RATE_RADPS = Limit(0.0, 20.0, "rad/s", "joints of an arm turn with 0.5 to 2", {}, IS_ABOVE)
Six = tuple[float, float, float, float, float, float]
STIFF_RAD, DAMP_S = 0.01, 0.05  # a servo has its whole torque at this error, and the same at its change in this time
ARMATURE_KGM2 = 0.02  # of a rotor behind its gear


class Rod(NamedTuple):
    """A part of the arm, from the joint that moves it along x."""

    name: str
    joint: str
    axis: str
    length_m: float
    mass_kg: float
    begins_m: float  # where it begins on the part that carries it


@dataclass(frozen=True)
class Manipulator(Record, who="The arm's "):
    """An arm. All numbers are our own choice, of an arm as competitions' rovers have.

    Args:
        mount_m: where base and shoulder are, on the chassis.
        lengths_m, masses_kg: of upper arm, forearm and hand.
        torques_nm: the largest of each joint's servo.
        lows_rad, highs_rad: of each joint.
        rest_rad: at the start.
        rate_radps: of all servos.
    """

    mount_m: Annotated[tuple[float, float, float], PLACE_M, ("x", "y", "z")] = (0.3, 0.0, 0.55)
    lengths_m: Annotated[tuple[float, float, float], LENGTH_M, ("upper", "fore", "hand")] = (0.45, 0.40, 0.15)
    masses_kg: Annotated[tuple[float, float, float], ROD_KG, ("upper", "fore", "hand")] = (1.8, 1.2, 0.6)
    torques_nm: Annotated[Six, TORQUE_NM, ARM_JOINTS] = (40.0, 60.0, 40.0, 10.0, 5.0, 2.0)
    lows_rad: Annotated[Six, ANGLE_RAD, ARM_JOINTS] = (-2.8, -0.6, -2.6, -2.0, -3.0, 0.0)
    highs_rad: Annotated[Six, ANGLE_RAD, ARM_JOINTS] = (2.8, 2.4, 0.0, 2.0, 3.0, 0.8)
    rest_rad: Annotated[Six, ANGLE_RAD, ARM_JOINTS] = (0.0, 1.9, -2.4, 0.5, 0.0, 0.0)
    rate_radps: Annotated[float, RATE_RADPS] = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        limits = zip(self.lows_rad, self.rest_rad, self.highs_rad, strict=True)
        is_in_order = all(low <= rest <= high and low < high for low, rest, high in limits)
        check_valid(is_in_order, "The arm's rest_rad", self.rest_rad, "give angles from lows_rad to highs_rad.")

    @property
    def rods(self) -> tuple[Rod, ...]:
        """Return all parts, from the chassis on; base and wrist are short ones that carry the next joint."""
        (upper, fore, hand), (upper_kg, fore_kg, hand_kg) = self.lengths_m, self.masses_kg
        return (
            Rod("arm_base", "base", "0 0 1", 0.01, 0.1, 0.0),
            Rod("arm_upper", "shoulder", "0 -1 0", upper, upper_kg, 0.0),
            Rod("arm_fore", "elbow", "0 -1 0", fore, fore_kg, upper),
            Rod("arm_wrist", "wrist_pitch", "0 -1 0", 0.01, 0.1, fore),
            Rod("arm_hand", "wrist_roll", "1 0 0", hand, hand_kg, 0.0),
            Rod("arm_finger", "grip", "0 0 1", 0.5 * hand, 0.1, 0.5 * hand),
        )

    @property
    def mass_kg(self) -> float:
        """Mass of all."""
        return math.fsum(rod.mass_kg for rod in self.rods)


class MujocoManipulator:
    """The arm of a rover in MuJoCo: joints and servos are named after the joint, as "arm_elbow"."""

    def __init__(self, arm: Manipulator, world: MujocoWorld) -> None:
        model, data = world.model, world.data
        joints = [model.joint(f"arm_{name}") for name in ARM_JOINTS]
        self._arm, self._data = arm, data
        self._angles, self._dofs = ([int(one.qposadr[0]) for one in joints], [int(one.dofadr[0]) for one in joints])
        first = int(model.actuator(f"arm_{ARM_JOINTS[0]}").id)
        self._controls = data.ctrl[first : first + len(ARM_JOINTS)]
        self._torques = data.actuator_force[first : first + len(ARM_JOINTS)]

    def reset(self) -> None:
        """Put all joints at rest."""
        self._data.qpos[self._angles] = self._controls[:] = self._arm.rest_rad
        self.goals_rad: tuple[float, ...] = self._arm.rest_rad

    def order(self, command: ArmCommand, time_s: float) -> None:
        """Set the angles to go to, clamped to the joints' limits; one without any has all servos hold what they do.

        Raises:
            PlantError: the values are not one finite number for each joint.
        """
        angles = command.angles_rad or self._controls.tolist()
        if len(angles) != len(ARM_JOINTS) or not all(map(math.isfinite, angles)):
            raise PlantError(
                f"At {time_s:g} s the command of the arm is {angles}.",
                fix=f"send {len(ARM_JOINTS)} finite numbers: {', '.join(ARM_JOINTS)}.",
            )
        limits = zip(angles, self._arm.lows_rad, self._arm.highs_rad, strict=True)
        self.goals_rad = tuple(min(high, max(low, angle)) for angle, low, high in limits)

    def advance(self, step_s: float) -> float:
        """Move what the servos hold towards the goals for a step; return the power they took in the last one [W].

        What comes back when gravity drives a joint is lost, as in the wheels' controllers.
        """
        way_rad, power_w = self._arm.rate_radps * step_s, 0.0
        held = self._controls.tolist()
        if tuple(held) != self.goals_rad:
            pairs = zip(held, self.goals_rad, strict=True)
            self._controls[:] = [min(now + way_rad, max(now - way_rad, goal)) for now, goal in pairs]
        for torque, rate in zip(self._torques.tolist(), self._data.qvel[self._dofs].tolist(), strict=True):
            power_w += max(0.0, torque * rate)
        return power_w

    def reading(self, time_s: float) -> ArmReading:
        """Return angles, rates and the torques of the last step."""
        data = self._data
        return ArmReading(
            data.qpos[self._angles].tolist(), data.qvel[self._dofs].tolist(), self._torques.tolist(), time_s
        )
