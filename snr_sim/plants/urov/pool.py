"""Pool of a vehicle: still surface at z = 0, a level floor, four walls, and gates.

It writes the world as MJCF, in which MuJoCo detects contacts. `simple="false"` at the vehicle's body matters:
without it MuJoCo keeps only the diagonal of a mass matrix that is diagonal, and with the added mass of a tilted vehicle
it is not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from html import escape
from typing import Annotated

from snr_sim.plants.parameter_limits import LIMITS, check_record, format_value
from snr_sim.plants.urov.vehicle import Vector, Vehicle
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.water import FRESH_KGM3, GRAVITY_MPS2

WALLS_RISE_M = 0.4  # above the water  # plain: metaphor-name
POST_M = 0.025  # radius of a gate's posts; an estimate, as of plastic pipe of 50 mm
FRICTION = 0.5  # of a plastic frame on tiles: our estimate, as is that what touches does not rebound
# Contacts give way by tenths of a millimetre before they are hard: with MuJoCo's own, a vehicle that slides over the
# floor rattles, its force anywhere from 0 to three times its mean. The ratio keeps what sticks from creeping.
CONTACT = 'solimp="0.1 0.95 0.003"'
FRICTION_RATIO = 100
BODY = "vehicle"
PARTS = ("floor", "surface", "rim")  # names of the pool's parts in the viewer


@dataclass(frozen=True)
class Gate:
    """Gate of two posts and two bars, upright, to pass through along its heading.

    Args:
        position_m: of its middle.
        heading_rad: of a vehicle that passes through: 0 is along x.
        width_m, height_m: between the posts, and between the bars.
    """

    name: str
    position_m: Annotated[Vector, LIMITS["position_m"]]
    heading_rad: Annotated[float, LIMITS["angle_rad"]] = 0.0
    width_m: Annotated[float, LIMITS["gate_m"]] = 1.5
    height_m: Annotated[float, LIMITS["gate_m"]] = 1.0

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.strip() or self.name in PARTS:
            fix = f"give it a name of its own, other than {', '.join(PARTS)}."
            raise ParameterError(f"A gate is named {format_value(self.name)}.", fix=fix)
        check_record(self, f"Gate '{self.name}': ")

    def corners_m(self) -> list[Vector]:
        """Return the four corners, in order around it."""
        x, y, z = self.position_m
        across = -math.sin(self.heading_rad), math.cos(self.heading_rad)
        half, up = 0.5 * self.width_m, 0.5 * self.height_m
        return [
            (x + side * half * across[0], y + side * half * across[1], z + level * up)
            for side, level in ((1, 1), (1, -1), (-1, -1), (-1, 1))
        ]


@dataclass(frozen=True)
class Pool:
    """A basin whose middle is at x = y = 0.

    Args:
        length_m, width_m, depth_m: along x, along y, and from the surface down to the floor.
        density_kgm3: of the water: 1000 fresh, 1026 in the sea.

    Raises:
        ParameterError: a number is out of range, a gate is outside, or two gates have one name.
    """

    length_m: Annotated[float, LIMITS["basin_m"]] = 25.0
    width_m: Annotated[float, LIMITS["basin_m"]] = 12.5
    depth_m: Annotated[float, LIMITS["basin_m"]] = 4.0
    gates: Annotated[tuple[Gate, ...], "Gate(...)"] = ()
    density_kgm3: Annotated[float, LIMITS["water_kgm3"]] = FRESH_KGM3
    gravity_mps2: Annotated[float, LIMITS["gravity_mps2"]] = GRAVITY_MPS2
    temperature_c: Annotated[float, LIMITS["temperature_c"]] = 18.0

    def __post_init__(self) -> None:
        check_record(self, "The pool's ")
        for gate in self.gates:
            x, y, z = gate.position_m
            if abs(x) > 0.5 * self.length_m or abs(y) > 0.5 * self.width_m or not -self.depth_m <= z <= WALLS_RISE_M:
                raise ParameterError(
                    f"Gate '{gate.name}' is at {gate.position_m} m, which is not in the pool.", fix=self.extent()
                )
        names = [gate.name for gate in self.gates]
        if len(set(names)) < len(names):
            raise ParameterError(f"Two gates have one name: {', '.join(names)}.", fix="give each its own.")

    def extent(self) -> str:
        """Return a description of where the water is."""
        size = f"{self.length_m:g} x {self.width_m:g} m around 0, 0 and {self.depth_m:g} m deep"
        return f"the pool is {size}; under water z is negative."

    def clearance_m(self, position: Vector) -> float:
        """Return the minimum distance from a point in the water to floor, walls and gates."""
        x, y, z = position
        clearances = [z + self.depth_m, 0.5 * self.length_m - abs(x), 0.5 * self.width_m - abs(y)]
        clearances += [
            math.dist(position, gate.position_m) - 0.5 * math.hypot(gate.width_m, gate.height_m) - POST_M
            for gate in self.gates
        ]
        return min(clearances)

    def mjcf(self, vehicle: Vehicle) -> str:
        """Return the world with this vehicle in it, as MJCF."""
        half = 0.5 * self.length_m, 0.5 * self.width_m
        surface = f'friction="{FRICTION} 0.005 0.0001"'
        walls = [  # plain: metaphor-name
            ("wall_east", f"{half[0]} 0 0", "0 -1 0 0 0 1"),
            ("wall_west", f"{-half[0]} 0 0", "0 1 0 0 0 1"),
            ("wall_north", f"0 {half[1]} 0", "1 0 0 0 0 1"),
            ("wall_south", f"0 {-half[1]} 0", "-1 0 0 0 0 1"),
        ]
        # A plane's normal is its z axis: x cross y of the two axes given.
        lines = [f'<geom name="floor" type="plane" pos="0 0 {-self.depth_m}" size="{half[0]} {half[1]} 1" {surface}/>']
        lines += [
            f'<geom name="{name}" type="plane" pos="{position}" xyaxes="{axes}" size="1 1 1" {surface}/>'
            for name, position, axes in walls
        ]
        for gate in self.gates:
            corners = gate.corners_m()
            for i, (start, end) in enumerate(zip(corners, [*corners[1:], corners[0]], strict=True)):
                ends = " ".join(f"{value:.9g}" for value in (*start, *end))
                name = escape(f"{gate.name}_{i}")
                lines.append(f'<geom name="{name}" type="capsule" fromto="{ends}" size="{POST_M}" {surface}/>')
        xx, yy, zz, xy, xz, yz = (
            float(vehicle.inertia_kgm2[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
        )
        box = " ".join(repr(0.5 * side) for side in vehicle.size_m)
        position = " ".join(repr(value) for value in vehicle.centre_of_mass_m)
        return f"""<mujoco model="pool">
  <option gravity="0 0 {-self.gravity_mps2!r}" integrator="Euler" cone="elliptic" impratio="{FRICTION_RATIO}"/>
  <default><geom {CONTACT}/></default>
  <worldbody>
    {chr(10).join("    " + line for line in lines).strip()}
    <body name="{BODY}" simple="false">
      <freejoint name="{BODY}"/>
      <inertial pos="{position}" mass="{vehicle.mass_kg!r}" fullinertia="{xx!r} {yy!r} {zz!r} {xy!r} {xz!r} {yz!r}"/>
      <geom name="frame" type="box" size="{box}" {surface}/>
    </body>
  </worldbody>
</mujoco>"""
