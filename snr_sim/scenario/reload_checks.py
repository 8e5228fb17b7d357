"""Static checks of a controller after each reload: an edit in flight is checked as one before the run is."""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence

from snr_sim.core.node import Node
from snr_sim.core.source_location import SourceLocation, short_path
from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.task import Page, TaskType
from snr_sim.scenario.controller_source import finding, parsed
from snr_sim.scenario.simulation import Simulation
from snr_sim.scenario.source_checks import notes_before


class ReloadChecks:
    """Checks the source after each reload of a run.

    They follow the page `reload` and change nothing, so they are neither recorded nor replayed.

    Args:
        simulation, nodes: that run.
        known: findings that have been reported.
        report: called with each new finding.
    """

    def __init__(
        self, simulation: Simulation, nodes: Sequence[Node], known: Sequence[str], report: Callable[[str], None]
    ) -> None:
        self._simulation = simulation
        self._nodes = nodes
        self._known = set(known)
        self._report = report
        self._factories = self._read_factories()
        for node in nodes:
            node.add_store_listener(TaskType.reload.value, self._on_reload)

    def _on_reload(self, page: Page) -> None:
        if not page.data["created"]:
            return  # the old code continues
        try:
            notes = notes_before(self._simulation, self._nodes, is_running=True)
        except SnrError as error:
            notes = [str(error)]
        factories = self._read_factories()
        if factories and self._factories and factories[0] != self._factories[0]:
            what = "factories(robot) has changed, but is called only when a run starts: this run continues without it."
            notes.append(finding(factories[1], what, "start the run again."))
            self._known.discard(notes[-1])
        self._factories = factories
        for note in notes:
            if note not in self._known:
                self._known.add(note)
                self._report(note)

    def _read_factories(self) -> tuple[str, SourceLocation] | None:
        """Return what the controller's `factories` does, as text, and its line."""
        path = self._simulation.controller_path
        for node in parsed(path).body if path.suffix == ".py" else ():
            if isinstance(node, ast.FunctionDef) and node.name == "factories":
                return ast.dump(node), SourceLocation(short_path(str(path)), node.lineno, node.name, "")
        return None
