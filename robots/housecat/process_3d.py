"""Process_3D: where on the floor the stones are that Process_2D sees. Stores page "heap_3d": x_m, y_m, stamp_s.

What measures distances is exchanged by naming other states: `PROCESS_3D["stereo"]` or `PROCESS_3D["lidar"]`.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from typing import Any

from snr_sim.behaviors.flow import wait
from snr_sim.behaviors.processes import ObserverState

from .parameters import DOZER, LIDAR, STEREO
from .process_2d import Idle
from .vision import distance_at, stereo_distances

NEAR_M = 0.9  # in front of the blade
WORK_S = 0.3  # for a picture, of the slow ones


class Range(ObserverState):
    """Measures the distance of the stones in each new picture."""

    key = "stereo"
    mount_m = STEREO.camera.mount_position_m
    stamp_s = -1.0

    def distances(self, data: dict[str, Any]) -> list[tuple[float, float]]:
        """Return bearings and distances from the sensor."""
        return stereo_distances(data["left"], data["right"], data["baseline_m"], data["field_of_view_rad"])

    def picture(self) -> dict[str, Any] | None:
        """Return a new picture, with what is known at this moment; None if there is none, or no stone was seen."""
        data, heap, pose = (self.get_data(key) for key in (self.key, "heap_2d", "pose"))
        if data is None or heap is None or pose is None or data["stamp_s"] <= max(self.stamp_s, self.entered_s):
            return None
        self.stamp_s = data["stamp_s"]
        return {"data": data, "bearing_rad": heap["bearing_rad"], **pose}

    def locate(self, picture: dict[str, Any]) -> None:
        """Store where the stones of a picture are, if it shows them."""
        bearing = picture["bearing_rad"]
        distance_m = distance_at(bearing, self.distances(picture["data"]))
        if distance_m is None:
            return
        (x, y), heading = picture["position_m"], picture["heading_rad"]
        x += self.mount_m[0] * math.cos(heading) + distance_m * math.cos(heading + bearing)
        y += self.mount_m[0] * math.sin(heading) + distance_m * math.sin(heading + bearing)
        self.store_data("heap_3d", {"x_m": x, "y_m": y, "stamp_s": picture["data"]["stamp_s"]}, process=False)
        self.report((x, y))

    def report(self, place_m: tuple[float, float]) -> None:
        """Send an event, if a place calls for one."""

    def run_state(self) -> Generator[object, None, None] | None:
        """See `ObserverState`."""
        picture = self.picture()
        if picture is not None:
            self.locate(picture)
        return None


class Near(Range):
    """Reports when the stones are near."""

    def report(self, place_m: tuple[float, float]) -> None:
        """Send the event, if it is so."""
        if math.dist(place_m, self.get_data("pose")["position_m"]) < 0.5 * DOZER.size_m[0] + NEAR_M:
            self.publish_event("NEAR")


class ByLidar:
    """The same, with the distances of a lidar."""

    key = "lidar"
    mount_m = LIDAR.mount_position_m

    def distances(self, data: dict[str, Any]) -> list[tuple[float, float]]:
        """Return bearings and distances from the lidar."""
        return list(zip(data["angles_rad"], data["ranges_m"], strict=True))


class Slow:
    """The same, but a picture takes 0.3 s of work, which cannot be given up."""

    def run_state(self: Any) -> Generator[object, None, None]:
        """See `ObserverState`."""
        picture = self.picture()
        if picture is None:
            return
        yield wait(WORK_S, uninterrupted=True)
        self.locate(picture)


class LidarRange(ByLidar, Range):
    """Measures with the lidar."""


class LidarNear(ByLidar, Near):
    """Reports what the lidar finds near."""


class SlowRange(Slow, Range):
    """Measures slowly."""


class SlowNear(Slow, Near):
    """Reports late what is near."""


def states(
    measure: type[ObserverState], near: type[ObserverState], rest: type[ObserverState] = Idle
) -> dict[str, type[ObserverState]]:
    """Return the states of a Process_3D; `rest` is for those in which the blade hides the stones."""
    return {"search": measure, "approach": near, "push": rest, "back_up": rest, "done": rest}


PROCESS_3D = {
    "stereo": states(Range, Near),
    "lidar": states(LidarRange, LidarNear),
    "slow": states(SlowRange, SlowNear, SlowRange),  # it works all the time, so the others wait for it
}
