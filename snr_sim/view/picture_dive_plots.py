"""The plots of a dive: its motion and the setpoints, in metres, degrees and metres per second."""

from __future__ import annotations

import numpy as np

from snr_sim.recording.columns import Batch, Floats, Series
from snr_sim.view.picture_bodies import NO_PUSH
from snr_sim.view.picture_flight import Flight
from snr_sim.view.picture_moments import broken
from snr_sim.view.picture_plots import Plot

WANTED = ("vehicle", "controls")  # keys of pages with setpoints; the first one that exists is used
GAP_S = 1.0  # a number that was not stored for this long no longer holds
DEPTH_M, ANGLE_DEG, SPEED_MPS, PLACE_M = 0.5, 10.0, 0.1, 0.5  # minimum spans, so that noise does not fill a plot


def dive_plots(flight: Flight, batch: Batch, is_planar: bool = False) -> list[Plot]:
    """Return plots of depth, heading, speeds and a special quantity; for planar motion, pitch instead of heading."""
    values, times_s = flight.values, flight.times_s
    truth = {name: np.array([one.get(name, np.nan) for one in values], float) for name in values[0]}
    main = next(iter(flight.poses.values()))
    told = [one for node, one in batch.page_values() if not batch.is_copy(node, one.path[0])]
    ways = ("surge", "heave") if is_planar else ("surge", "sway", "heave")
    plots = [
        Plot("[m]", [("depth", times_s, -main[:, 2]), *_wanted(told, "depth_m")], DEPTH_M, is_down=True),
        _pitch(truth, times_s) if is_planar else _heading(truth, times_s, told),
        Plot("[m/s]", [(way, times_s, truth[f"{way}_mps"]) for way in ways if f"{way}_mps" in truth], SPEED_MPS),
        _special(flight, truth, (main - main[0])[:, : 1 if is_planar else 2]),
    ]
    return [plot for plot in plots if plot.lines]


def _heading(truth: dict[str, Floats], times_s: Floats, told: list[Series]) -> Plot:
    heading = np.unwrap(truth.get("yaw_rad", np.zeros(len(times_s))))
    wanted = [
        (name, when_s, np.degrees(_beside(angles, np.interp(when_s, times_s, heading))))
        for name, when_s, angles in _wanted(told, "heading_rad")
    ]
    return Plot("[°]", [("heading", times_s, np.degrees(heading)), *wanted], ANGLE_DEG)


def _pitch(truth: dict[str, Floats], times_s: Floats) -> Plot:
    lines = [("pitch", times_s, np.degrees(np.unwrap(truth["pitch_rad"])))] if "pitch_rad" in truth else []
    return Plot("[°]", lines, ANGLE_DEG)


def _special(flight: Flight, truth: dict[str, Floats], gone: Floats) -> Plot:
    """Return the plot of the quantity that is special in this dive; by default, of the distance travelled."""
    times_s = flight.times_s
    if "water_l" in truth:
        return Plot("[l]", [("water in the hull", times_s, truth["water_l"])], PLACE_M)
    names = broken(flight.values[-1])
    if names:
        pushes = [(f"push of {name}", times_s, _mean_push(flight, [name], True)) for name in names]
        return Plot("[N]", [*pushes, ("mean of the others", times_s, _mean_push(flight, names, False))], 1.0)
    ways = zip(("to the east", "to the north"), gone.T, strict=False)
    return Plot("[m]", [(name, times_s, way) for name, way in ways], PLACE_M)


def _mean_push(flight: Flight, names: list[str], are_meant: bool) -> Floats:
    """Return the mean magnitude [N] of the thrusts with these names, or of all the others."""
    means = []
    for arrows in flight.arrows:
        chosen = [name for name in arrows if name not in NO_PUSH and (name in names) == are_meant]
        means.append(sum(float(np.linalg.norm(arrows[name][3:])) for name in chosen) / max(1, len(chosen)))
    return np.array(means)


def _wanted(told: list[Series], name: str) -> list[tuple[str, Floats, Floats]]:
    """Return the line of the setpoint, with a gap where there was none."""
    for key in WANTED:
        for series in told:
            if series.path == (key, name):
                times_s, values = series.when.t_s, series.values
                holes = np.flatnonzero(np.diff(times_s) > GAP_S) + 1
                return [("wanted", np.insert(times_s, holes, times_s[holes]), np.insert(values, holes, np.nan))]
    return []


def _beside(angles: Floats, others: Floats) -> Floats:
    """Return angles [rad] shifted by whole turns to be as near as possible to others."""
    turns = np.round((others - angles) / (2.0 * np.pi))
    beside: Floats = angles + 2.0 * np.pi * turns
    return beside
