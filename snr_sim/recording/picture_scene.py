"""Draws the scene of a picture: the bodies at several moments of their way through the world, in the right order."""

from __future__ import annotations

import numpy as np

from snr_sim.recording.picture_bodies import FLAME, JET, draw_flame, draw_shapes, length_of, turned
from snr_sim.recording.picture_canvas import Canvas, Rgb
from snr_sim.recording.picture_flight import Flight, from_above, is_in_water, wants_map
from snr_sim.recording.picture_layout import BODY_SHARE, SCENE, Camera, Place, feet_and_size, moments_of
from snr_sim.recording.picture_plots import FAINT, PALE
from snr_sim.recording.picture_world import (
    SKY,
    THIN_M,
    draw_current,
    draw_ground,
    draw_lines,
    draw_scales,
    draw_water,
    lines_of,
)
from snr_sim.recording.records import Header

PATH: Rgb = (110, 190, 250)
SURFACE_SHOWN_M = 4.0  # a way that comes as near to the surface is shown together with it
NO_PUSH = ("current", "tether")  # arrows that are no thrust
ENLARGED_IN_WATER = 2.0


def draw_scene(canvas: Canvas, header: Header, flight: Flight) -> None:
    """Draws all of the scene."""
    main = next(iter(flight.poses))
    in_water = is_in_water(header)
    is_above = in_water and wants_map(flight.poses[main])
    if is_above:
        header, flight = from_above(header, flight)
    bodies = header.scene["bodies"]
    feet_m, size_m = feet_and_size(bodies)
    feet_m = 0.0 if in_water else feet_m  # what swims stands on nothing
    poses = flight.poses[main]
    feet = np.array([turned(pose, [0.0, 0.0, feet_m]) for pose in poses])
    is_time = np.ptp(feet[:, 0]) < 0.02 * np.ptp(feet[:, 2])
    along, heights = (flight.times_s if is_time else feet[:, 0]), feet[:, 2]
    shown = [*heights, 0.0] if in_water and not is_above and heights.max() > -SURFACE_SHOWN_M else heights
    camera = Camera(along, np.array(shown), size_m, is_time)
    if is_above:
        camera.low_z = float(heights.min() + heights.max()) / 2 - 0.5 * (SCENE[3] - SCENE[1]) / camera.z_scale
    canvas.rectangle(*SCENE, fill=SKY)
    if in_water:
        draw_water(canvas, camera, is_above)
    lines = lines_of(header, is_above) if in_water and not is_time else {}
    draw_lines(canvas, camera, [shape for shape in lines.values() if shape.get("radius_m", 0.1) < THIN_M])
    way = [camera.at(a, z) for a, z in zip(along, heights, strict=True)]
    canvas.line(way[:: max(1, len(way) // 800)] + way[-1:], PATH, 1.2)
    enlarged = max(1.0, BODY_SHARE * (SCENE[3] - SCENE[1]) / (size_m * camera.z_scale))
    enlarged = min(enlarged, ENLARGED_IN_WATER) if in_water else enlarged  # or it would not fit through its gates
    forces = [arrow for arrows in flight.arrows for name, arrow in arrows.items() if name not in NO_PUSH]
    strongest = max(map(length_of, forces), default=0.0) or 1.0
    size = size_m * camera.z_scale * enlarged
    moments = moments_of(np.array(way), 1.25 * size)
    places = [Place(way[i], feet[i], camera.z_scale * enlarged) for i in moments]
    for i, place in zip(moments, places, strict=True):
        for name, arrow in flight.arrows[i].items():
            if name not in NO_PUSH:
                draw_flame(canvas, place, arrow, 0.8 * size / strongest, JET if in_water else FLAME)
    draw_ground(canvas, camera, header.scene.get("statics", {}), is_time)  # over flames, under feet
    for i, place in zip(moments, places, strict=True):
        shapes = [(shape, flight.poses[body][i]) for body in flight.poses for shape in bodies[body]]
        draw_shapes(canvas, place, shapes)
        beside = (way[i][0] + 0.62 * size, way[i][1] - 0.5 * size)
        canvas.text(beside, f"{flight.times_s[i]:.0f} s", 10.5, PALE, "lm")
    draw_lines(canvas, camera, [shape for shape in lines.values() if shape.get("radius_m", 0.1) >= THIN_M])
    draw_scales(canvas, camera, is_time)
    if in_water:
        draw_current(canvas, flight.arrows[-1].get("current"))
        canvas.text((SCENE[0] + 8, SCENE[1] + 8), "from above" if is_above else "from the south", 10.0, FAINT, "la")
    if enlarged > 1.5:
        canvas.text((SCENE[2] - 8, SCENE[1] + 8), f"{main} drawn {enlarged:.0f} times its size", 10.0, FAINT, "ra")
