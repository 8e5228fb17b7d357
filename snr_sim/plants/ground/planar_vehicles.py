"""Explorer and dozer, which have plants seen from above, as vehicles of the rover's plant: with wheels, on any ground.

Their numbers stay where they are. What a plant seen from above does not know is estimated: heights, wheels' masses,
and motors as fast and as strong as it says, with a
battery of this voltage. Its lag is not taken over: what limits acceleration here is the motors' pull.
"""

from __future__ import annotations

from collections.abc import Sequence

from snr_sim.plants.battery import BatteryPack
from snr_sim.plants.ground.dc_motor import DcMotor
from snr_sim.plants.ground.dozer import Dozer
from snr_sim.plants.ground.explorer import Explorer
from snr_sim.plants.ground.rover_vehicle import NO_MOTOR, OWN_MOTOR, RoverVehicle, Wheel
from snr_sim.plants.ground.traction import GRAVITY_MPS2
from snr_sim.prelude.sums import ordered_sum

NOMINAL_CELL_V = 3.7
WHEEL_SHARE = 0.02  # of the mass, for each wheel
ROLLERS = 4  # of a track
DROP = 0.1  # share of the full speed that is lost at the largest torque; of the voltage, that windings take then
ROTOR_S = 0.001  # inertia of the rotor over the gain of its speed loop: a lighter one shakes the wheels on its chain


def explorer_rover(explorer: Explorer, battery: BatteryPack) -> RoverVehicle:
    """Return an explorer: wheels L and R with motors, and a caster C as large as they are, without friction."""
    radius_m, half_m = explorer.wheel_radius_m, 0.5 * explorer.track_m
    places = (("L", explorer.axle_m, half_m), ("R", explorer.axle_m, -half_m), ("C", explorer.caster_m, 0.0))
    wheels = [
        Wheel(
            name,
            (x, y, radius_m),
            radius_m,
            explorer.size_m[1] - explorer.track_m,
            WHEEL_SHARE * explorer.mass_kg,
            friction_scale=0.0 if name == "C" else 1.0,
            motor=NO_MOTOR if name == "C" else OWN_MOTOR,
        )
        for name, x, y in places
    ]
    # A wheel cannot bring more to the ground than friction under the whole weight.
    return _vehicle(explorer, wheels, explorer.grip * explorer.mass_kg * GRAVITY_MPS2, battery)


def dozer_rover(dozer: Dozer, battery: BatteryPack) -> RoverVehicle:
    """Return a dozer: each track is four wheels side by side, L1 to L4 and R1 to R4, on one motor, that of L1 or R1.

    Wheels have one friction in all directions, that of the ground; a track that slides sideways more easily is not
    represented, and nor is the blade.
    """
    radius_m = 0.5 * dozer.track_length_m / ROLLERS
    wheels = [
        Wheel(
            f"{side}{i + 1}",
            ((ROLLERS - 1 - 2 * i) * radius_m, y, radius_m),
            radius_m,
            dozer.size_m[1] - dozer.track_m,
            WHEEL_SHARE * dozer.mass_kg,
            motor=f"{side}1" if i else OWN_MOTOR,
        )
        for side, y in (("L", 0.5 * dozer.track_m), ("R", -0.5 * dozer.track_m))
        for i in range(ROLLERS)
    ]
    return _vehicle(dozer, wheels, dozer.max_pull_n, battery)


def _vehicle(planar: Explorer | Dozer, wheels: Sequence[Wheel], pull_n: float, battery: BatteryPack) -> RoverVehicle:
    """Return a vehicle with the mass, the inertia and the centre of mass of a planar one, half as high as its body.

    Args:
        wheels: with their masses, which are taken from that of the whole.
        pull_n: of a motor, at the rim of its wheels.
    """
    (length_m, width_m), height_m, radius_m = planar.size_m, planar.height_m, wheels[0].radius_m
    wheels_kg = ordered_sum(wheel.mass_kg for wheel in wheels)
    chassis_kg = planar.mass_kg - wheels_kg
    x_m = -ordered_sum(wheel.mass_kg * wheel.position_m[0] for wheel in wheels) / chassis_kg
    z_m = (0.5 * height_m * planar.mass_kg - wheels_kg * radius_m) / chassis_kg
    of_wheels = ordered_sum(
        wheel.mass_kg * (x * x + y * y + radius_m * radius_m / 4.0 + wheel.width_m * wheel.width_m / 12.0)
        for wheel in wheels
        for x, y, _ in (wheel.position_m,)
    )
    per_kg = height_m * height_m / 12.0
    inertia = (
        chassis_kg * (per_kg + width_m * width_m / 12.0),
        chassis_kg * (per_kg + length_m * length_m / 12.0),
        planar.inertia_kgm2 - of_wheels - chassis_kg * x_m * x_m,
    )
    return RoverVehicle(
        chassis_kg,
        (x_m, 0.0, z_m),
        inertia,
        (length_m, width_m, height_m),
        (0.0, 0.0, radius_m + 0.5 * height_m),
        tuple(wheels),
        _motor(planar, radius_m, pull_n, NOMINAL_CELL_V * battery.cells),
        battery,
        electronics_a=0.0,
    )


def _motor(planar: Explorer | Dozer, radius_m: float, pull_n: float, supply_v: float) -> DcMotor:
    """Return a motor without gear and losses, with a speed and a pull at the rim of its wheels."""
    kv = planar.full_speed_mps / (radius_m * supply_v)
    limit_a = pull_n * radius_m * kv
    gain_nms = pull_n * radius_m * radius_m / (DROP * planar.full_speed_mps)
    return DcMotor(
        kv_radps_per_v=kv,
        resistance_ohm=DROP * supply_v / limit_a,
        rotor_kgm2=gain_nms * ROTOR_S,
        friction_nm=0.0,
        gear=1.0,
        efficiency=1.0,
        limit_a=limit_a,
        gain_nms=gain_nms,
    )
