"""Writer of a run to a rerun stream: the entity of each number, and its style. See `view.py`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import takewhile
from typing import Any, TypeAlias

import numpy as np

from snr_sim.recording.columns import BROKEN, Batch, LogRows, Series, When
from snr_sim.recording.records import Header
from snr_sim.view.view_blueprint import (
    FAILURES,
    FLAGS,
    STATES,
    Layout,
    PlotLine,
    blueprint,
    color_and_width,
    display_units,
    name_and_unit,
)
from snr_sim.view.view_links import LinkReports, is_of_link
from snr_sim.view.view_pages import PageContents
from snr_sim.view.view_sender import Sender
from snr_sim.view.view_world import SceneSender

NOT_PLOTTED = ("number",)  # sequence numbers: straight lines without information
MAX_DIVERGENCES_MARKED = 1_000
DIVERGENCE_RGB = (255, 60, 60)

Divergences: TypeAlias = Sequence[tuple[int, float, str]]


def title_of(header: Header) -> str:
    """Return the title of a run."""
    return f"{header.scenario}, seed {header.seed}, {header.controller}"


class Writer:
    """Writer of one run to a recording stream of `rr`, the module rerun, which only `view.py` imports.

    Args:
        root: prefix of its entities, if there are two runs in the stream.
        layout: shared by the runs in the stream; by default a new one.
        lines: of handlers, by name.
    """

    def __init__(
        self,
        rr: Any,
        stream: Any,
        header: Header,
        root: tuple[str, ...] = (),
        layout: Layout | None = None,
        lines: Mapping[str, str] | None = None,
    ) -> None:
        self._header, self._root = header, root
        self._sender = Sender(rr, stream, root)
        self.batch: Batch = Batch()
        self.layout: Layout = layout or Layout(title_of(header))
        self._known: set[tuple[str, ...]] = set()
        self._factors: dict[tuple[str, ...], float] = {}  # scale factors of numbers that are shown in another unit
        self._flags: dict[str, float] = {}
        self._states: dict[tuple[str, ...], dict[str, int]] = {}  # number of each state, by machine
        self._links = LinkReports()
        self._contents = PageContents(lines)
        self._send_run()
        self._scene_sender = SceneSender(self._sender, header.scene, self.layout)

    def flush(self) -> None:
        """Send the records in the batch, and empty it."""
        batch = self.batch
        self._scene_sender.send(batch)
        for series in batch.truth_values():
            self._send_series(("truth", *series.path), series, is_truth=True)
        for node, series in batch.page_values():
            self._send_series((node, "pages", *series.path), series, is_truth=False)
        for node, machine, when, states in batch.changes_of_state():
            self._send_states(node, machine, when, states)
        for node, path, when, images in batch.images():
            self._send_images((node, "pages", *path), when, images)
        for place, logs in (("tasks", batch.executed()), ("events", batch.events())):
            for node, rows in logs:
                self._send_log(node, place, rows)
        for node, when, texts in self._contents.of(batch):
            entity = self._sender.entity(node, "contents")
            self._sender.send(entity, when, self._sender.rr.TextDocument.columns(text=texts))
            if entity not in self.layout.contents:
                self.layout.contents.append(entity)
        batch.clear()

    def blueprint(self, follow_time: bool = False) -> Any:
        """Return the layout of the view for the data sent so far."""
        return blueprint(self._sender.rr.blueprint, self.layout, follow_time)

    def send_divergences(self, divergences: Divergences) -> None:
        """Mark where two runs differ: as text, in the plots, and on the path of each body."""
        rr = self._sender.rr
        seqs, times, texts = zip(*divergences, strict=True)
        when = When(np.array(seqs, np.int64), np.array(times, np.float64))
        log = rr.TextLog.columns(text=list(texts), level=["WARN"] * len(texts))
        self._sender.send("/divergences", when, log)
        marked = when[:MAX_DIVERGENCES_MARKED]
        marks = rr.SeriesPoints(colors=DIVERGENCE_RGB, markers="diamond", marker_sizes=4.0, names="differs")
        self._sender.log("/divergences/marks", marks)
        self._sender.send_numbers("/divergences/marks", marked, np.zeros(len(marked)))
        self.layout.has_divergences = True

    def _send_run(self) -> None:
        header = self._header
        lines = [f"# {title_of(header)}", "", "| | |", "|---|---|"]
        names = ("scenario", "seed", "robot", "controller", "engine", "io", "clock", "version", "python", "platform")
        lines += [f"| {name} | {getattr(header, name)} |" for name in names]
        lines += [f"| {name} | {version} |" for name, version in header.packages.items()]
        document = self._sender.rr.TextDocument("\n".join(lines), media_type="text/markdown")
        self._sender.log(self._sender.entity("run"), document)

    def _send_series(self, parts: tuple[str, ...], series: Series, is_truth: bool) -> None:
        if parts not in self._known:
            self._register_series(parts, series, is_truth)
        entity = self._sender.entity(*parts)
        self.layout.end_s = max(self.layout.end_s, float(series.when.t_s[-1]))
        factor = self._factors.get(parts)
        values = series.values if factor is None else factor * series.values
        self._sender.send_numbers(entity, series.when, values)
        if series.is_flag and not is_of_link(series.path):  # plotted if it changes
            first = self._flags.setdefault(entity, float(series.values[0]))
            if entity not in self.layout.changed_flags and bool((series.values != first).any()):
                self.layout.changed_flags.append(entity)
        if is_of_link(series.path) and not self._root:
            self._send_reports(parts[0], entity, series)

    def _register_series(self, parts: tuple[str, ...], series: Series, is_truth: bool) -> None:
        self._known.add(parts)
        name, unit, factor = display_units(*name_and_unit(series.path))
        if factor != 1.0:
            self._factors[parts] = factor
        legend = " ".join([*self._root, *(["true"] if is_truth else []), name])
        is_failure = is_truth and parts[1].startswith(BROKEN)
        plot = FAILURES if is_failure else FLAGS if series.is_flag else ""
        line = PlotLine(self._sender.entity(*parts), legend, unit, is_truth, plot, is_step=bool(plot))
        self._add_line(line, is_truth or self._is_plotted(parts))

    def _send_states(self, node: str, machine: str, when: When, states: list[str]) -> None:
        """Send the states of a machine as steps of a line: their numbers, whose names are in the legend."""
        parts = (node, "machines", *machine.split("/"))
        numbers = self._states.setdefault(parts, {})
        known = len(numbers)
        values = [numbers.setdefault(state, len(numbers)) for state in states]
        entity = self._sender.entity(*parts)
        if len(numbers) > known:
            names = ", ".join(f"{number} {state}" for state, number in numbers.items() if state)
            line = PlotLine(entity, f"{machine}: {names}", "", False, STATES, is_step=True)
            self._add_line(line, is_plotted=parts not in self._known)
            self._known.add(parts)
        self._sender.send_numbers(entity, when, np.array(values, np.float64))

    def _is_plotted(self, parts: tuple[str, ...]) -> bool:
        """Return whether a number is plotted: not pages of other nodes, sequence numbers or counts of links.

        Those are shown elsewhere. Of two runs side by side only actuator commands are plotted: all lines of both would
        hide their differences.
        """
        node, _, key, *_ = parts
        if self._root and self._header.commands:
            return key in self._header.commands.get(node, ())
        return not (parts[-1] in NOT_PLOTTED or is_of_link(parts[2:]) or self.batch.is_copy(node, key))

    def _send_reports(self, node: str, entity: str, series: Series) -> None:
        """Send the quantities that a link reports, in separate plots."""
        for report in self._links.of(node, series):
            if report.series is not None:
                entity = self._sender.entity(node, "links", *report.series.path)
                self._sender.send_numbers(entity, series.when, report.series.values)
            if (entity, report.plot) not in self._known:
                self._known.add((entity, report.plot))
                line = PlotLine(entity, f"{node} {report.name}", "", False, report.plot, is_step=report.series is None)
                self._add_line(line, is_plotted=True)

    def _add_line(self, line: PlotLine, is_plotted: bool) -> None:
        """Send the style of a line, and add it to the layout if it is plotted."""
        rgba, width = color_and_width(line, list(takewhile(lambda one: one.entity != line.entity, self.layout.lines)))
        if is_plotted:
            self.layout.lines.append(line)
        mode = "StepAfter" if line.is_step else None
        style = self._sender.rr.SeriesLines(names=line.name, colors=rgba, widths=width, interpolation_mode=mode)
        self._sender.log(line.entity, style)

    def _send_images(self, parts: tuple[str, ...], when: When, images: Sequence[Any]) -> None:
        """Send camera images."""
        rr, entity = self._sender.rr, self._sender.entity(*parts)
        formats = [
            rr.components.ImageFormat(width=wide, height=high, color_model="RGB", channel_datatype="U8")
            for high, wide, _ in (image.shape for image in images)
        ]
        self._sender.send(entity, when, rr.Image.columns(buffer=[image.tobytes() for image in images], format=formats))
        if entity not in self.layout.images:
            self.layout.images.append(entity)

    def _send_log(self, node: str, place: str, rows: LogRows) -> None:
        texts = self._sender.rr.TextLog.columns(text=rows.texts, level=rows.levels)
        self._sender.send(self._sender.entity(node, place), rows.when, texts)
        log = self._sender.entity(node)
        if log not in self.layout.logs:
            self.layout.logs.append(log)
