"""One picture that tells a whole run: the body at several moments of its way over the ground, and plots beside it.

Bodies are seen from the south, in the x-z plane. One that only rises and falls is spread out along time; one
under water whose way is better seen on a map is seen from above.
Everything comes from the header's scene and the true states of the trace, so any plant can have its picture taken.

    picture_flight.py   what is shown
    picture_layout.py   where it lies on the sheet
    picture_scene.py    the scene, put together from picture_world.py and picture_bodies.py
    picture_plots.py    the plots beside it
    picture_canvas.py   the sheet
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TypeAlias

from snr_sim.recording.picture_canvas import Canvas
from snr_sim.recording.picture_flight import Flight, flight_of
from snr_sim.recording.picture_layout import HEIGHT, PLOTS, WIDTH
from snr_sim.recording.picture_plots import BACKGROUND, INK, PALE, Plot, draw_plots
from snr_sim.recording.picture_scene import draw_scene
from snr_sim.recording.records import EndRecord, Header, Record
from snr_sim.recording.view_blueprint import Line, name_and_unit, plots
from snr_sim.recording.view_columns import Batch, Series

PLOTTED_UNITS = ("m", "m/s", "", "kg")  # what a newcomer understands; the view has the rest

Touchdown: TypeAlias = Mapping[str, float] | None


def draw_run(
    header: Header, records: Iterable[Record], path: str | Path, outcome: str = "", touchdown: Touchdown = None
) -> None:
    """Draws a run as a PNG of 1800 x 1000 pixels.

    Args:
        header: of the trace.
        records: of the trace.
        path: of the file to write.
        outcome: how it ended, in a word; without it, the reason that the node gave.
        touchdown: the judged one, number by name with unit, as in result.json; only that is told in words.

    Raises:
        MissingExtra: Pillow is not installed.
        TraceError: the trace has no true states, as one from a real robot.
    """
    batch, kept = Batch(), list(records)
    batch.extend(kept)
    reason = next((record.reason for record in reversed(kept) if isinstance(record, EndRecord)), "")
    flight = flight_of(header, batch)
    canvas = Canvas(WIDTH, HEIGHT, BACKGROUND)
    draw_scene(canvas, header, flight)
    draw_plots(canvas, PLOTS, _plots(batch), flight.touchdown_s)
    _draw_title(canvas, header, flight, outcome or reason, touchdown)
    canvas.save(path)


def _plots(batch: Batch) -> list[Plot]:
    """Returns a plot for each unit that a newcomer understands, out of the true numbers."""
    series: dict[str, Series] = {one.path[-1]: one for one in batch.truth_values() if one.values.any()}
    lines = [Line(key, *name_and_unit((key,)), is_truth=True) for key in series]
    chosen = {title: group for title, group in plots(lines).items() if group[0].unit in PLOTTED_UNITS}
    return [
        Plot(title, [(line.name, series[line.entity].when.t_s, series[line.entity].values) for line in group])
        for title, group in chosen.items()
    ]


def _draw_title(canvas: Canvas, header: Header, flight: Flight, outcome: str, touchdown: Touchdown) -> None:
    left, right = 14.0, PLOTS[2]
    canvas.text((left, 10), header.scenario, 19.0, INK)
    beside = left + canvas.text_width(header.scenario, 19.0) + 12
    canvas.text((beside, 16), f"seed {header.seed}, controller '{header.controller}'", 12.5, PALE)
    said = f"{outcome}, " if outcome else ""
    canvas.text((right, 12), f"{said}{flight.times_s[-1]:.1f} s", 15.0, INK, "ra")
    canvas.text((right, 35), _told(flight, touchdown), 11.5, PALE, "ra")


def _told(flight: Flight, touchdown: Touchdown) -> str:
    """Returns what is worth a line: how it touched down, and what it burned."""
    told = []
    first, last = flight.values[0], flight.values[-1]
    numbers = [(*name_and_unit((key,)), value) for key, value in (touchdown or {}).items()]
    if numbers:
        told.append("touchdown: " + ", ".join(f"{name} {value:.1f} {unit}" for name, unit, value in numbers))
    for key in first.keys() & last.keys():
        name, unit = name_and_unit((key,))
        if unit == "kg" and last[key] < first[key]:
            told.append(f"{first[key] - last[key]:.0f} kg of {name}")
    return "; ".join(told)
