"""The plots of a dive: its motion and the setpoints, in metres, degrees and metres per second."""

from __future__ import annotations

import numpy as np

from snr_sim.recording.columns import Batch, Floats, Series
from snr_sim.view.picture_bodies import NO_PUSH
from snr_sim.view.picture_plots import Plot
from snr_sim.view.picture_tracks import BodyTracks
from snr_sim.view.run_events import broken

SETPOINT_KEYS = ("vehicle", "controls")  # keys of pages with setpoints; the first one that exists is used
GAP_S = 1.0  # a number that was not stored for this long no longer holds
DEPTH_M, ANGLE_DEG, SPEED_MPS, POSITION_M = 0.5, 10.0, 0.1, 0.5  # minimum spans, so that noise does not fill a plot


def dive_plots(tracks: BodyTracks, batch: Batch, is_planar: bool = False) -> list[Plot]:
    """Return plots of depth, heading, speeds and a special quantity; for planar motion, pitch instead of heading."""
    values, times_s = tracks.values, tracks.times_s
    truth = {name: np.array([one.get(name, np.nan) for one in values], float) for name in values[0]}
    main = next(iter(tracks.poses.values()))
    page_series = [one for node, one in batch.page_values() if not batch.is_copy(node, one.path[0])]
    axes = ("surge", "heave") if is_planar else ("surge", "sway", "heave")
    pitch = [("pitch", times_s, np.degrees(np.unwrap(truth["pitch_rad"])))] if "pitch_rad" in truth else []
    plots = [
        Plot("[m]", [("depth", times_s, -main[:, 2]), *_setpoint_line(page_series, "depth_m")], DEPTH_M, is_down=True),
        Plot("[°]", pitch, ANGLE_DEG) if is_planar else _heading(truth, times_s, page_series),
        Plot("[m/s]", [(axis, times_s, truth[f"{axis}_mps"]) for axis in axes if f"{axis}_mps" in truth], SPEED_MPS),
        _special(tracks, truth, (main - main[0])[:, : 1 if is_planar else 2]),
    ]
    return [plot for plot in plots if plot.lines]


def _heading(truth: dict[str, Floats], times_s: Floats, page_series: list[Series]) -> Plot:
    heading = np.unwrap(truth.get("yaw_rad", np.zeros(len(times_s))))
    lines = [("heading", times_s, np.degrees(heading))]
    for name, when_s, angles in _setpoint_line(page_series, "heading_rad"):
        turns = np.round((np.interp(when_s, times_s, heading) - angles) / (2.0 * np.pi))  # as near as possible
        lines.append((name, when_s, np.degrees(angles + 2.0 * np.pi * turns)))
    return Plot("[°]", lines, ANGLE_DEG)


def _special(tracks: BodyTracks, truth: dict[str, Floats], displacement_m: Floats) -> Plot:
    """Return the plot of the quantity that is special in this dive; by default, of the distance travelled."""
    times_s = tracks.times_s
    if "water_l" in truth:
        return Plot("[l]", [("water in the hull", times_s, truth["water_l"])], POSITION_M)
    names = broken(tracks.values[-1])
    if names:
        pushes = [(f"push of {name}", times_s, _mean_push(tracks, [name], True)) for name in names]
        return Plot("[N]", [*pushes, ("mean of the others", times_s, _mean_push(tracks, names, False))], 1.0)
    offsets = zip(("to the east", "to the north"), displacement_m.T, strict=False)
    return Plot("[m]", [(name, times_s, offset) for name, offset in offsets], POSITION_M)


def _mean_push(tracks: BodyTracks, names: list[str], are_meant: bool) -> Floats:
    """Return the mean magnitude [N] of the thrusts with these names, or of all the others."""
    means = []
    for vectors in tracks.vectors:
        chosen = [name for name in vectors if name not in NO_PUSH and (name in names) == are_meant]
        means.append(sum(float(np.linalg.norm(vectors[name][3:])) for name in chosen) / max(1, len(chosen)))
    return np.array(means)


def _setpoint_line(page_series: list[Series], name: str) -> list[tuple[str, Floats, Floats]]:
    """Return the line of the setpoint, with a gap where there was none."""
    for key in SETPOINT_KEYS:
        for series in page_series:
            if series.path == (key, name):
                times_s, values = series.when.t_s, series.values
                holes = np.flatnonzero(np.diff(times_s) > GAP_S) + 1
                return [("setpoint", np.insert(times_s, holes, times_s[holes]), np.insert(values, holes, np.nan))]
    return []
