"""Smooth ground: a height for each place, and a slope that is continuous.

Heights are a quadratic B-spline over a square grid of control values (de Boor, A Practical Guide to Splines, 2001,
chapter IX): of all functions with a continuous slope it needs the fewest control values for a point, nine. Wheels roll
over it without a jolt where cells meet. World frame: x east, y north, z up; metres. Beyond the grid the ground is level
at the height of its edge.

    z(x, y) = sum of control values * B2(x / spacing - column) * B2(y / spacing - row)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

from snr_sim.plants.parameter_limits import IS_ABOVE, MILLIMETRES, Limit, check_number, check_vector
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.rng import rng_for

if TYPE_CHECKING:
    from numpy.typing import NDArray

SPACING_M = Limit(0.05, 10.0, "m", "wheels have 0.02 to 1 m, and bend around nothing smaller", MILLIMETRES)
GROUND_M = Limit(-100.0, 100.0, "m", "a competition's ground rises by some metres", MILLIMETRES)
PLACE_M = Limit(-1e4, 1e4, "m", "no field is larger", MILLIMETRES)
RELIEF_M = Limit(0.0, 20.0, "m", "hills that a rover climbs are lower", MILLIMETRES)
HILL_M = Limit(0.0, 1e3, "m", "it is the length of a hill and a valley", MILLIMETRES, IS_ABOVE)
Plane: TypeAlias = tuple[float, float, float, float, float, float]  # a point of it, and its normal, which points up
LEVEL: Plane = (0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
MAX_CONTROL_VALUES = 1_000_000
MIN_CURVE = 1.5  # least radius of curvature, in radii of the wheel: see `check_rolls`


class HeightMap:
    """The ground.

    Args:
        rows: control values [m], one row for each y, from south to north; in a row one for each x, from west to east.
        spacing_m: between control values.
        corner_m: x and y of the first one.

    Raises:
        ParameterError: a number is out of range, the rows differ in length, or there are fewer than 3 by 3 values.
    """

    def __init__(
        self, rows: Sequence[Sequence[float]], spacing_m: float, corner_m: Sequence[float] = (0.0, 0.0)
    ) -> None:
        check_number("The ground's spacing_m", spacing_m, SPACING_M)
        check_vector("The ground's corner_m", corner_m, PLACE_M, ("x", "y"))
        widths = {len(row) for row in rows}
        if len(widths) != 1 or len(rows) < 3 or min(widths) < 3:
            raise ParameterError(
                f"The ground has {len(rows)} rows of {', '.join(map(str, sorted(widths))) or 'no'} values.",
                fix="give at least 3 rows, each of the same number of values, at least 3.",
            )
        columns = widths.pop()
        if len(rows) * columns > MAX_CONTROL_VALUES:
            raise ParameterError(
                f"The ground has {len(rows)} x {columns} values.",
                fix=f"give at most {MAX_CONTROL_VALUES}: a larger spacing_m, or a smaller field.",
            )
        for i, row in enumerate(rows):
            for j, value in enumerate(row):
                check_number(f"The ground's height in row {i}, column {j}", value, GROUND_M)
        self.spacing_m: float = float(spacing_m)
        self.corner_m: tuple[float, float] = (float(corner_m[0]), float(corner_m[1]))
        self.columns: int = columns
        self.rows: int = len(rows)
        self._rows = [[float(value) for value in row] for row in rows]
        self._per_m = 1.0 / self.spacing_m
        # Rows as triples of neighbours, and in units of the spacing how far the ground goes: from half a cell inside,
        # since each point needs a neighbour on both sides. One tuple, since `at` runs some times in each step.
        triples = [list(zip(row, row[1:], row[2:], strict=False)) for row in self._rows]
        self._grid = (*self.corner_m, self._per_m, columns - 1.5 - 1e-9, len(rows) - 1.5 - 1e-9, triples)

    def at(self, x_m: float, y_m: float) -> tuple[float, float, float]:
        """Return the height [m] at a place, and its slopes towards x and y.

        >>> [round(value, 9) for value in ramp((0.1, -0.2), 12.0).at(3.0, 1.0)]
        [0.1, 0.1, -0.2]
        """
        first_x, first_y, per_m, max_u, max_v, triples = self._grid
        u, v = (x_m - first_x) * per_m, (y_m - first_y) * per_m
        is_in_x, is_in_y = 0.5 <= u <= max_u, 0.5 <= v <= max_v
        if not is_in_x:
            u = 0.5 if u < 0.5 else max_u
        if not is_in_y:
            v = 0.5 if v < 0.5 else max_v
        i, j = int(u + 0.5), int(v + 0.5)
        s, t = u - i, v - j  # -0.5 to 0.5, from the middle control value
        da, dc = s - 0.5, s + 0.5
        a, c = 0.5 * da * da, 0.5 * dc * dc
        b = 1.0 - a - c
        db = -2.0 * s
        i -= 1
        p, q, r = triples[j - 1][i]
        low, low_x = a * p + b * q + c * r, da * p + db * q + dc * r
        p, q, r = triples[j][i]
        mid, mid_x = a * p + b * q + c * r, da * p + db * q + dc * r
        p, q, r = triples[j + 1][i]
        high, high_x = a * p + b * q + c * r, da * p + db * q + dc * r
        dt_low, dt_high = t - 0.5, t + 0.5
        a, c = 0.5 * dt_low * dt_low, 0.5 * dt_high * dt_high
        b = 1.0 - a - c
        slope_x = (a * low_x + b * mid_x + c * high_x) * per_m if is_in_x else 0.0
        slope_y = (dt_low * low - 2.0 * t * mid + dt_high * high) * per_m if is_in_y else 0.0
        return a * low + b * mid + c * high, slope_x, slope_y

    def planes_under(self, places_m: Sequence[Sequence[float]], last: Sequence[Plane]) -> list[Plane]:
        """Return the planes that touch the ground where it is nearest to places above it.

        Args:
            places_m: such as wheels' centres.
            last: the plane that was found for each a moment ago; from any other the result is near the nearest point,
                and from `LEVEL` it is the point below.
        """
        at, sqrt, planes = self.at, math.sqrt, []
        for (x, y, z), (px, py, pz, nx, ny, nz) in zip(places_m, last, strict=True):
            above_m = (x - px) * nx + (y - py) * ny + (z - pz) * nz
            x_m, y_m = x - above_m * nx, y - above_m * ny
            height, slope_x, slope_y = at(x_m, y_m)
            up = 1.0 / sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
            planes.append((x_m, y_m, height, -slope_x * up, -slope_y * up, up))
        return planes

    def plane_at(self, x_m: float, y_m: float) -> Plane:
        """Return the plane that touches the ground at a place."""
        (plane,) = self.planes_under([(x_m, y_m, 0.0)], [LEVEL])
        return plane

    def min_radius_m(self) -> float:
        """Return the least radius of curvature of a hollow along x or y [m]; infinity where there is none.

        A quadratic spline has one second derivative in each cell: that of three neighbours in a row.
        """
        import numpy as np

        grid = self.control_values()
        bends = [np.diff(grid, 2, axis=axis).max(initial=0.0) for axis in (0, 1)]
        bend = max(bends) * self._per_m * self._per_m
        return 1.0 / float(bend) if bend > 0.0 else math.inf

    def check_rolls(self, radius_m: float, wheel: str) -> None:
        """Raise a ParameterError unless a wheel rolls through each hollow and touches it in one place only."""
        found_m = self.min_radius_m()
        if found_m < MIN_CURVE * radius_m:
            raise ParameterError(
                f"The ground has a hollow with a radius of {found_m:.2g} m, and {wheel} a radius of {radius_m:g} m.",
                fix=f"make it smoother than {MIN_CURVE * radius_m:.2g} m, or use a rock or a ledge.",
            )

    def control_values(self) -> NDArray[Any]:
        """Return the control values [m], shape (rows, columns)."""
        import numpy as np

        return np.array(self._rows)


def flat(size_m: float = 100.0) -> HeightMap:
    """Return level ground at z = 0, around the origin.

    >>> flat().at(3.0, -70.0)
    (0.0, 0.0, 0.0)
    """
    return ramp((0.0, 0.0), size_m)


def ramp(slopes: Sequence[float], size_m: float = 100.0) -> HeightMap:
    """Return ground that rises evenly: `slopes` are dz/dx and dz/dy. The origin has z = 0."""
    check_vector("The ramp's slopes", slopes, Limit(-2.0, 2.0, "", "no vehicle climbs a slope of 2"), ("x", "y"))
    spacing_m = min(10.0, max(0.05, 0.25 * size_m))
    count = max(3, math.ceil(size_m / spacing_m) + 2)
    first = -0.5 * spacing_m * (count - 1)
    along = [first + spacing_m * i for i in range(count)]
    rows = [[slopes[0] * x + slopes[1] * y for x in along] for y in along]
    return HeightMap(rows, spacing_m, (first, first))


def make_hills(
    seed: int, relief_m: float = 1.0, length_m: float = 8.0, size_m: float = 60.0, spacing_m: float = 0.5
) -> HeightMap:
    """Return hills around the origin, which lies level at z = 0 for a start.

    Args:
        seed: of their places; the same seed gives the same hills.
        relief_m: standard deviation of the height.
        length_m: from hill to hill, about; the shortest wave is half as long.
        size_m: of the square field.
        spacing_m: of the control values.
    """
    for what, value, limit in (
        ("relief_m", relief_m, RELIEF_M),
        ("length_m", length_m, HILL_M),
        ("size_m", size_m, HILL_M),
        ("spacing_m", spacing_m, SPACING_M),
    ):
        check_number(f"The hills' {what}", value, limit)
    rng = rng_for(seed, "hills")
    waves = 12
    count = math.ceil(size_m / spacing_m) + 2
    first = -0.5 * spacing_m * (count - 1)
    along = [first + spacing_m * i for i in range(count)]
    each_m = relief_m * math.sqrt(2.0 / waves)
    made = []
    for _ in range(waves):
        number = 2.0 * math.pi / (length_m * float(rng.uniform(0.5, 2.0)))
        heading, phase = (float(rng.uniform(0.0, 2.0 * math.pi)) for _ in range(2))
        made.append((number * math.cos(heading), number * math.sin(heading), phase))

    def height(x: float, y: float) -> float:
        total = 0.0
        for kx, ky, phase in made:
            total += math.sin(kx * x + ky * y + phase)
        level = math.hypot(x, y) / 3.0  # level within some metres around the start
        return each_m * total * (level * level / (1.0 + level * level)) if level else 0.0

    return HeightMap([[height(x, y) for x in along] for y in along], spacing_m, (first, first))
