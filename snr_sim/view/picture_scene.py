"""Draws the scene of a flight: the bodies at several moments of their way over the ground, in the right order."""

from __future__ import annotations

import math

import numpy as np

from snr_sim.recording.records import Header
from snr_sim.recording.scene import turned
from snr_sim.view.picture_bodies import FLAME, draw_flames, draw_shapes, strongest_of
from snr_sim.view.picture_canvas import Canvas, Rgb
from snr_sim.view.picture_flight import Flight
from snr_sim.view.picture_layout import SCENE, Camera, Stage, feet_and_size
from snr_sim.view.picture_plots import FAINT, PALE
from snr_sim.view.picture_world import SKY, draw_ground, draw_scales

PATH: Rgb = (110, 190, 250)


def draw_scene(canvas: Canvas, header: Header, flight: Flight) -> None:
    """Draws all of the scene."""
    main = next(iter(flight.poses))
    bodies = header.scene["bodies"]
    feet_m, size_m = feet_and_size(bodies)
    feet = np.array([turned(pose, [0.0, 0.0, feet_m]) for pose in flight.poses[main]])
    is_time = bool(np.ptp(feet[:, 0]) < 0.02 * np.ptp(feet[:, 2]))
    along = flight.times_s if is_time else feet[:, 0]
    camera = Camera(along, feet[:, 2], size_m, is_time)
    stage = Stage(camera, along, feet, size_m, math.inf)
    canvas.rectangle(*SCENE, fill=SKY)
    canvas.line(stage.thinned(), PATH, 1.2)
    points_per_newton = 0.8 * stage.size / strongest_of(flight.arrows)
    for i, place in zip(stage.moments, stage.places, strict=True):
        draw_flames(canvas, place, flight.arrows[i], points_per_newton, FLAME)
    draw_ground(canvas, camera, header.scene.get("statics", {}), is_time)  # over flames, under feet
    for i, place in zip(stage.moments, stage.places, strict=True):
        draw_shapes(canvas, place, [(shape, flight.poses[body][i]) for body in flight.poses for shape in bodies[body]])
        beside = (stage.way[i][0] + 0.62 * stage.size, stage.way[i][1] - 0.5 * stage.size)
        canvas.text(beside, f"{flight.times_s[i]:.0f} s", 10.5, PALE, "lm")
    draw_scales(canvas, camera, "s" if is_time else "m")
    if stage.enlarged > 1.5:
        words = f"{main} drawn {stage.enlarged:.0f} times its size"
        canvas.text((SCENE[2] - 8, SCENE[1] + 8), words, 10.0, FAINT, "ra")
