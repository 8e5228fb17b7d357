"""Summary picture of a run: the body at several moments of its path over the ground, with plots on the right.

Bodies are drawn from the south, in the x-z plane. A body that only rises and falls is spread out along time; one
under water is also drawn from above, and one that drives about from above alone.
All data come from the header's scene and the true states of the trace, so this works for any plant.

    picture_tracks.py    data to draw           run_events.py           events, as text
    picture_layout.py    layout of the sheet
    picture_scene.py     a flight               picture_bodies.py       bodies and flames
    picture_dive.py      a dive                 picture_water.py        the water around it
    picture_drive.py     a drive
    picture_plots.py     the plots              picture_dive_plots.py   the plots of a dive
    picture_sheet.py     the sheet: matplotlib
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TypeAlias

from snr_sim.recording.columns import Batch, Series
from snr_sim.recording.records import EndRecord, Header, Record
from snr_sim.view.picture_dive import draw_dive
from snr_sim.view.picture_dive_plots import dive_plots
from snr_sim.view.picture_drive import draw_drive
from snr_sim.view.picture_layout import HEIGHT, PLOTS, SCENE, WIDTH
from snr_sim.view.picture_plots import Plot, draw_plots
from snr_sim.view.picture_scene import draw_scene
from snr_sim.view.picture_sheet import INK, PALE, Rgb, Sheet, picture
from snr_sim.view.picture_tracks import BodyTracks, body_tracks_of, is_drive, is_in_water, is_planar
from snr_sim.view.run_events import find_run_events
from snr_sim.view.view_blueprint import PlotLine, name_and_unit, plots

PLOTTED_UNITS = ("m", "m/s", "", "kg")  # understandable for beginners; the view has all units

MET: Rgb = (130, 220, 150)
NOT_MET: Rgb = (255, 120, 100)
MAX_METRICS_SHOWN = 5

Metrics: TypeAlias = Mapping[str, float | str]
Numbers: TypeAlias = Mapping[str, float]  # by name with unit


def draw_run(
    header: Header,
    records: Iterable[Record],
    path: str | Path,
    outcome: str = "",
    touchdown: Numbers | None = None,
    success: bool | None = None,
    metrics: Metrics | None = None,
    outcome_reason: str = "",
) -> None:
    """Draw a run as a PNG of 1800 x 1000 pixels.

    Args:
        header, records: of the trace.
        path: of the file to write.
        outcome: one word; by default, the reason that the node gave for its end.
        touchdown: the evaluated one, number by name with unit, as in result.json; no other is described.
        success: whether the criterion was met; None if unknown.
        metrics: what the scenario measured, by name with unit; shown for a dive or a drive.
        outcome_reason: the scenario's comment on the result; shown for a dive or a drive instead of `metrics`.

    Raises:
        MissingExtraError: matplotlib is not installed.
        TraceError: the trace has no true states, such as one from a real robot.
    """
    batch, kept = Batch(), list(records)
    batch.extend(kept)
    reason = next((record.reason for record in reversed(kept) if isinstance(record, EndRecord)), "")
    tracks = body_tracks_of(header, batch)
    with picture(path, WIDTH, HEIGHT) as sheet:
        if is_in_water(header):
            events = find_run_events(tracks, header.scene["statics"], batch)
            draw_dive(sheet, header, tracks, events)
            times_s = [event.time_s for event in events]
            draw_plots(sheet, PLOTS, dive_plots(tracks, batch, is_planar(header)), times_s, are_numbered=True)
            subtitle = outcome_reason or _format_metrics(metrics or {})
        elif is_drive(header, next(iter(tracks.poses.values()))):
            draw_drive(sheet, header, tracks)
            draw_plots(sheet, PLOTS, _plots(batch), [])
            subtitle = outcome_reason or _format_metrics(metrics or {})
        else:
            draw_scene(sheet, header, tracks)
            draw_plots(sheet, PLOTS, _plots(batch), [] if tracks.touchdown_s is None else [tracks.touchdown_s])
            subtitle = _describe_landing(tracks, touchdown)
        _draw_title(sheet, header, f"{outcome or reason}, {tracks.times_s[-1]:.1f} s".lstrip(", "), success)
        sheet.text((PLOTS[2], 37), sheet.cut(subtitle, 10.5, PLOTS[2] - SCENE[0]), 10.5, PALE, "rt")


def _plots(batch: Batch) -> list[Plot]:
    """Return a plot of the true numbers for each of `PLOTTED_UNITS`."""
    series: dict[str, Series] = {one.path[-1]: one for one in batch.truth_values() if one.values.any()}
    lines = [PlotLine(key, *name_and_unit((key,)), is_truth=True) for key in series]
    return [
        Plot(
            f"[{group[0].unit}]" if group[0].unit else "",
            [(line.name, series[line.entity].when.t_s, series[line.entity].values) for line in group],
        )
        for group in plots(lines).values()
        if group[0].unit in PLOTTED_UNITS
    ]


def _draw_title(sheet: Sheet, header: Header, ended: str, success: bool | None) -> None:
    left, right = 14.0, PLOTS[2]
    sheet.text((left, 13), header.scenario, 17.0, INK)
    subtitle_x = left + sheet.text_width(header.scenario, 17.0) + 12
    sheet.text((subtitle_x, 18), f"seed {header.seed}, controller '{header.controller}'", 11.0, PALE)
    sheet.text((right, 14), ended, 14.0, {None: INK, True: MET, False: NOT_MET}[success], "rt")


def _describe_landing(tracks: BodyTracks, touchdown: Numbers | None) -> str:
    """Return a line about the touchdown and the fuel used."""
    phrases = []
    first, last = tracks.values[0], tracks.values[-1]
    if touchdown:
        named = ((*name_and_unit((key,)), value) for key, value in touchdown.items())
        phrases.append("touchdown: " + ", ".join(f"{name} {value:.1f} {unit}" for name, unit, value in named))
    for key, begin in first.items():
        name, unit = name_and_unit((key,))
        if unit == "kg" and last.get(key, begin) < begin:
            phrases.append(f"{begin - last[key]:.0f} kg of {name}")
    return "; ".join(phrases)


def _format_metrics(metrics: Metrics) -> str:
    """Return a line of the scenario's measurements that have a unit, as many as fit."""
    phrases = []
    for key, value in metrics.items():
        name, unit = name_and_unit((key,))
        if isinstance(value, str):
            phrases.append(f"{name} {value}")
        elif unit:
            digits = 2 if abs(value) < 10.0 else 1 if abs(value) < 100.0 else 0
            phrases.append(f"{name} {value:.{digits}f} {unit}")
    return ", ".join(phrases[:MAX_METRICS_SHOWN])
