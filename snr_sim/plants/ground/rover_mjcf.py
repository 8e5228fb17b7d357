"""MJCF text of a rover: its bodies, a plane under each wheel, motors at its axles.

A wheel touches the ground through a plane of its own, which is laid at the ground's nearest point before each step: it
has always one contact, and does not feel the grid of a height field. Contacts are soft, as tyres are: rigid ones hop
when a rover turns on the spot, and how fast it then turns depends on the step. A wheel's shape is a sphere, which
touches a plane as a wheel does; its edge would add contacts and change nothing. What soft contacts cost: wheels that
are locked and slide at more than about 1 m/s hop, as MuJoCo then asks for more friction than there is, and the last
0.4 m/s of a stop fade away within some hundredths of a second.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from snr_sim.plants.ground.manipulator import ARMATURE_KGM2, DAMP_S, STIFF_RAD, Rod
from snr_sim.plants.ground.rocks import Obstacle
from snr_sim.plants.ground.rover_arms import SIDES, Arm, Place, arms_of, wheel_inertia_kgm2
from snr_sim.plants.ground.rover_vehicle import NO_MOTOR, OWN_MOTOR, RoverVehicle, Wheel
from snr_sim.plants.ground.traction import GRAVITY_MPS2

SOFT_S, SOFT_M, SOFT_RADIUS_M = 0.1, 0.01, 0.13  # of tyres: a wheel of 0.13 m gives by 9 mm, others by the same share
STIFF = 'solreffriction="0.02 1" solimpfriction="0.999 0.999 0.001"'  # of brakes: with MuJoCo's own they creep
CHAIN = 'solimp="0.999 0.999 0.001"'  # of wheels on one motor
IMPRATIO = 30  # friction is so much stiffer than pressure: on a slope of 20 degrees a locked rover creeps at 0.6 mm/s
SLICK = 'friction="0 0 0"'  # of wheels and chassis: MuJoCo takes the larger friction of two, and that is the obstacle's


def rover_mjcf(vehicle: RoverVehicle, obstacles: Sequence[Obstacle] = ()) -> str:
    """Return the text of a world with the rover at the origin, level ground under it.

    The geoms of planes come first, in the order of the wheels, then the belly's, then those of obstacles.
    """
    wheels = vehicle.wheels
    hung = "".join(_side(vehicle, side) for side in SIDES) if vehicle.suspension else ""
    fixed = "".join(_wheel(vehicle, wheel, (0.0, 0.0, 0.0)) for wheel in wheels if wheel.hangs_on == "chassis")
    equalities = "".join(
        f'<joint joint1="wheel_{wheel.name}" joint2="wheel_{wheel.motor}" {CHAIN}/>'
        for wheel in wheels
        if wheel.motor not in (OWN_MOTOR, NO_MOTOR)
    )
    if vehicle.suspension:
        equalities += '<joint joint1="rocker_left" joint2="rocker_right" polycoef="0 -1 0 0 0"/>'
    planes = "".join(
        f'<body name="ground_{wheel.name}" mocap="true" pos="{wheel.position_m[0]} {wheel.position_m[1]} 0">'
        f'<geom name="ground_{wheel.name}" type="plane" size="1 1 1" contype="0" conaffinity="0"/></body>'
        for wheel in wheels
    )
    pairs = "".join(
        f'<pair geom1="ground_{wheel.name}" geom2="wheel_{wheel.name}" condim="3" friction="0.8 0.8 0 0 0"'
        f" {_soft(wheel)}/>"
        for wheel in wheels
    )
    motors = "".join(
        f'<general name="{wheel.name}" joint="wheel_{wheel.name}" gainprm="0" biastype="affine" biasprm="0 0 0"'
        ' forcelimited="true" forcerange="-1 1"/>'
        for wheel in vehicle.motor_wheels
    )
    arm = ""
    if vehicle.arm:
        motors += "".join(map(_servo, vehicle.arm.rods, vehicle.arm.torques_nm))
        for rod, low, high in reversed(
            list(zip(vehicle.arm.rods, vehicle.arm.lows_rad, vehicle.arm.highs_rad, strict=True))
        ):
            place = vehicle.arm.mount_m if rod.joint == "base" else (rod.begins_m, 0.0, 0.0)
            arm = _rod(rod, place, low, high, arm)
    rocks = "".join(
        one.geom(f"obstacle_{i}") + ' condim="3" contype="4" conaffinity="2"/>' for i, one in enumerate(obstacles)
    )
    sensors = "".join(
        f'<{kind} objtype="xbody" objname="wheel_{wheel.name}"/>'
        for kind in ("framelinvel", "frameyaxis")
        for wheel in wheels
    )
    return f"""
<mujoco model="rover">
  <compiler angle="radian" inertiafromgeom="false" balanceinertia="false"/>
  <option timestep="0.002" integrator="implicitfast" cone="elliptic" impratio="{IMPRATIO}"
    gravity="0 0 {-GRAVITY_MPS2}"/>
  <worldbody>
    {planes}
    <body name="ground_belly" mocap="true" pos="0 0 -100">
      <geom name="ground_belly" type="plane" size="1 1 1" contype="0" conaffinity="0"/></body>
    <body name="obstacles">{rocks}</body>
    <body name="chassis">
      <freejoint name="chassis"/>
      {_inertial(vehicle.center_of_mass_m, vehicle.chassis_kg, vehicle.inertia_kgm2)}
      <site name="inertial_unit"/>
      <geom name="chassis" type="box" pos="{_text(vehicle.center_m)}" size="{_text([0.5 * x for x in vehicle.size_m])}"
        {SLICK} contype="2" conaffinity="4"/>
      {hung}{fixed}{arm}
    </body>
  </worldbody>
  <contact>{pairs}<pair geom1="ground_belly" geom2="chassis" condim="3" friction="0.5 0.5 0 0 0"/></contact>
  <equality>{equalities}</equality>
  <actuator>{motors}</actuator>
  <sensor>{sensors}<gyro name="rate" site="inertial_unit"/><accelerometer site="inertial_unit"/></sensor>
</mujoco>"""


def _side(vehicle: RoverVehicle, side: str) -> str:
    """Return the rocker of a side, with its bogie and their wheels."""
    rocker, bogie = arms_of(vehicle, side)
    assert vehicle.suspension is not None
    limit_rad = vehicle.suspension.limit_rad
    return _arm(vehicle, rocker, (0.0, 0.0, 0.0), limit_rad, _arm(vehicle, bogie, rocker.pivot_m, limit_rad))


def _arm(vehicle: RoverVehicle, arm: Arm, parent: Place, limit_rad: float, carried: str = "") -> str:
    """Return an arm with its wheels, and with what else it carries, on the part whose pivot is `parent`."""
    name = f"{arm.kind}_{arm.side}"
    return f"""
      <body name="{name}" pos="{_text(_from(parent, arm.pivot_m))}">
        <joint name="{name}" type="hinge" axis="0 1 0" limited="true" range="{-limit_rad} {limit_rad}"/>
        {_inertial(arm.middle_m(), arm.mass_kg, arm.inertia_kgm2())}
        {"".join(_wheel(vehicle, wheel, arm.pivot_m) for wheel in arm.wheels)}{carried}
      </body>"""


def _wheel(vehicle: RoverVehicle, wheel: Wheel, parent: Place) -> str:
    """Return a wheel on the part whose origin is `parent`, with the inertia of its own rotor."""
    rotor_kgm2, friction_nm = 0.0, 0.0
    if wheel.motor == OWN_MOTOR:
        rotor_kgm2, friction_nm = vehicle.motor.wheel_kgm2, vehicle.motor.friction_nm
    return f"""
      <body name="wheel_{wheel.name}" pos="{_text(_from(parent, wheel.position_m))}">
        <joint name="wheel_{wheel.name}" type="hinge" axis="0 1 0" armature="{rotor_kgm2}"
          frictionloss="{max(1e-9, friction_nm)}" {STIFF}/>
        {_inertial((0.0, 0.0, 0.0), wheel.mass_kg, wheel_inertia_kgm2(wheel))}
        <geom name="wheel_{wheel.name}" type="sphere" size="{wheel.radius_m}" {SLICK} contype="2" conaffinity="4"/>
      </body>"""


def _rod(rod: Rod, place: Place, low_rad: float, high_rad: float, carried: str) -> str:
    """Return a part of the arm, with what it carries."""
    across = rod.mass_kg * rod.length_m**2 / 12.0 + 1e-4 * rod.mass_kg
    return f"""
      <body name="{rod.name}" pos="{_text(place)}">
        <joint name="arm_{rod.joint}" type="hinge" axis="{rod.axis}" armature="{ARMATURE_KGM2}"
          limited="true" range="{low_rad} {high_rad}"/>
        {_inertial((0.5 * rod.length_m, 0.0, 0.0), rod.mass_kg, (1e-4 * rod.mass_kg, across, across))}{carried}
      </body>"""


def _servo(rod: Rod, limit_nm: float) -> str:
    """Return a servo: a torque that falls with the error of the angle and with its rate, integrated implicitly."""
    gain = limit_nm / STIFF_RAD
    return (
        f'<general name="arm_{rod.joint}" joint="arm_{rod.joint}" gainprm="{gain}" biastype="affine"'
        f' biasprm="0 {-gain} {-gain * DAMP_S}" forcelimited="true" forcerange="{-limit_nm} {limit_nm}"/>'
    )


def _soft(wheel: Wheel) -> str:
    """Return the softness of a tyre; the time constant is that of a mass on a spring."""
    share = wheel.radius_m / SOFT_RADIUS_M
    return f'solref="{SOFT_S * math.sqrt(share)} 1" solimp="0 0.95 {SOFT_M * share}"'


def _inertial(center: Iterable[float], mass_kg: float, inertia: Iterable[float]) -> str:
    return f'<inertial pos="{_text(center)}" mass="{mass_kg}" diaginertia="{_text(inertia)}"/>'


def _from(origin: tuple[float, ...], place: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(b - a for a, b in zip(origin, place, strict=True))


def _text(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
