"""Interface of all simulated bodies: start from a seed, move only in steps, restore an earlier state.

A plant does not depend on nodes, devices or clocks. Actuators write its named inputs, sensors read its named
outputs, and the code that steps it controls the time. Same seed, same inputs, same steps: same bits.

Frames: world x east, y north, z up; body x forward, y left, z up. Metres, kilograms, seconds, radians.
"""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable


@runtime_checkable
class Plant(Protocol):
    """A body and its surroundings, under physics."""

    @property
    def engine(self) -> str:
        """Name and version of its physics engine, such as 'pymunk': goes into the trace's header."""

    @property
    def step_s(self) -> float | None:
        """The fixed integration step, or None if any step is exact."""

    @property
    def time_s(self) -> float:
        """Simulated time since the last reset."""

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names that `write` accepts."""

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names that `read` accepts."""

    def reset(self, seed: int) -> None:
        """Set the initial state of this seed; no state of an earlier run survives."""

    def step(self, dt_s: float) -> None:
        """Advance by `dt_s`, which is `step_s` unless that is None.

        Raises:
            PlantError: a state is no longer finite.
        """

    def write(self, name: str, command: Any) -> None:
        """Set an input, which holds until it is set again. The plant clamps it to the body's limits."""

    def read(self, name: str) -> Any:
        """Return an output: the true value, without noise. A msgspec Struct with units in its field names."""

    def snapshot(self) -> Any:
        """Return the complete state, so that `restore` and the same steps give the same bits."""

    def restore(self, snapshot: Any) -> None:
        """Restore a state that `snapshot` returned."""

    def scene(self) -> dict[str, Any]:
        """Return the static shapes, and those of moving bodies, as JSON for the viewer.

        {"statics": {name: shape}, "bodies": {name: [shape, ...]}} where a shape is one of

            {"kind": "polyline", "points_m": [[x, y, z], ...], "rgb": [r, g, b], "radius_m": 0.1}
            {"kind": "mesh", "vertices_m": [[x, y, z], ...], "triangles": [[i, j, k], ...], "rgb": [r, g, b]}
            {"kind": "box", "half_size_m": [x, y, z], "center_m": [x, y, z], "rgb": [r, g, b]}
            {"kind": "heightfield", "corner_m": [x, y], "spacing_m": [x, y], "shape": [rows, columns],
             "heights_m": [z, ...], "rgb": [r, g, b]}    heights from west to east, row by row from south to north

        A static shape may have a "label", which is shown next to it. There may be

            "tethers": {name: {"anchor_m": [x, y, z], "body": name, "place_m": [x, y, z], "length_m": 35.0}}

        from a fixed point to one in a body's frame; the arrow of the same name is its pull. A plant that moves only in
        the x-z plane has "is_planar": true.
        """

    def truth(self) -> dict[str, Any]:
        """Return the true state as plain JSON, for the recorder alone: nodes cannot read it.

        {"poses": {body: [x, y, z, qx, qy, qz, qw]},          world frame [m], quaternion
         "vectors": {name: [ox, oy, oz, vx, vy, vz]},          origin [m] and vector (forces in N), world frame
         "values": {name_with_unit: number}}              broken_<arrow> is 1 once the source of this arrow is broken
        """
