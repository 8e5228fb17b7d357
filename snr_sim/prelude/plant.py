"""The promise of every simulated body: it starts from a seed, moves only when stepped, and can be put back.

A plant knows nothing of nodes, devices or clocks. Actuators reach it through named inputs, sensors through named
outputs, and whatever steps it owns the time. Same seed, same inputs, same steps: same bits.

Frames: world x east, y north, z up; body x forward, y left, z up. Metres, kilograms, seconds, radians.
"""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable


@runtime_checkable
class Plant(Protocol):
    """A body and its surroundings, under physics."""

    @property
    def engine(self) -> str:
        """Name of the physics behind it, such as 'pymunk', with its version: goes into the trace's header."""
        ...

    @property
    def step_s(self) -> float | None:
        """The one step it is integrated with, or None if any step is exact."""
        ...

    @property
    def time_s(self) -> float:
        """Simulated time since the last reset."""
        ...

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names that `write` takes."""
        ...

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names that `read` takes."""
        ...

    def reset(self, seed: int) -> None:
        """Put everything back to the start that belongs to this seed; nothing of the run before survives."""
        ...

    def step(self, dt_s: float) -> None:
        """Move on by `dt_s`, which is `step_s` unless that is None.

        Raises:
            PlantError: a state is no longer finite.
        """
        ...

    def write(self, name: str, command: Any) -> None:
        """Set an input, which holds until it is set again. The plant clamps it to what the body can do."""
        ...

    def read(self, name: str) -> Any:
        """Return an output: the true value, without noise. A msgspec Struct with units in its field names."""
        ...

    def snapshot(self) -> Any:
        """Return all of the state, so that `restore` and the same steps give the same bits."""
        ...

    def restore(self, snapshot: Any) -> None:
        """Put back what `snapshot` returned."""
        ...

    def scene(self) -> dict[str, Any]:
        """Return what does not move, and the shapes of what does, as JSON for the viewer.

        {"statics": {name: shape}, "bodies": {name: [shape, ...]}} where a shape is one of

            {"kind": "polyline", "points_m": [[x, y, z], ...], "rgb": [r, g, b], "radius_m": 0.1}
            {"kind": "mesh", "vertices_m": [[x, y, z], ...], "triangles": [[i, j, k], ...], "rgb": [r, g, b]}
            {"kind": "box", "half_size_m": [x, y, z], "center_m": [x, y, z], "rgb": [r, g, b]}

        of which one that does not move may have a "label" to be read beside it. There may be

            "tethers": {name: {"anchor_m": [x, y, z], "body": name, "place_m": [x, y, z], "length_m": 35.0}}

        from a fixed place to one in a body's frame; the arrow of the same name is what it pulls with. And of a plant
        that moves in the x-z plane alone, "is_planar": true.
        """
        ...

    def truth(self) -> dict[str, Any]:
        """Return the true state as plain JSON, for the recorder alone: no node can read it.

        {"poses": {body: [x, y, z, qx, qy, qz, qw]},          world frame [m], quaternion
         "arrows": {name: [ox, oy, oz, vx, vy, vz]},          origin [m] and vector (forces in N), world frame
         "values": {name_with_unit: number}}              broken_<arrow> is 1 from when what makes this arrow is broken
        """
        ...
