"""Table of action values, and its file: numbers only, so that reading executes no code from the file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snr_sim.learning.array_file import MAX_BYTES, FileMetadata, check_memory, read_arrays, write_arrays
from snr_sim.learning.discretiser import Discretiser
from snr_sim.prelude.errors import ParameterError, RecordingError

MAKER = "QTable.save"


class QTableMetadata(FileMetadata, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Metadata in a table's file: names and edges of its `Discretiser`, and the description of each action."""

    names: tuple[str, ...]
    edges: tuple[tuple[float, ...], ...]
    actions: tuple[str, ...]


class QTable:
    """Values of actions in cells.

    Args:
        discretiser: maps observations to cells.
        actions: description of each action.
        environment: what it is for.

    Attributes:
        values: shape (cells, actions), the value of each action.
        visits: shape (cells, actions), how often it was tried: an untried action is not chosen for its initial zero.
    """

    def __init__(self, discretiser: Discretiser, actions: Sequence[str], environment: str) -> None:
        if len(actions) < 2:
            raise ParameterError(f"A table of {len(actions)} actions leaves nothing to choose.", fix="2 or more.")
        self.discretiser: Discretiser = discretiser
        self.actions: tuple[str, ...] = tuple(actions)
        self.environment: str = environment
        self.values: NDArray[np.float64] = np.zeros((discretiser.count, len(actions)))
        self.visits: NDArray[np.int64] = np.zeros((discretiser.count, len(actions)), np.int64)
        self.made_by: str = ""

    def best(self, cell: int) -> int:
        """Return the tried action of the highest value in a cell; the first of several, and 0 if none was tried.

        So the choice depends on the numbers alone, and not on randomness or on a hidden order.
        """
        best, highest = 0, -math.inf
        # Lists: for a few actions NumPy would take ten times as long.
        for action, (visits, value) in enumerate(
            zip(self.visits[cell].tolist(), self.values[cell].tolist(), strict=True)
        ):
            if visits > 0 and value > highest:
                best, highest = action, value
        return best

    def act(self, observation: Sequence[float]) -> int:
        """Return the best action for an observation. Changes nothing."""
        return self.best(self.discretiser.cell(observation))

    def save(self, path: str | Path) -> None:
        """Write the table as npz: arrays of numbers, and a line of JSON about them.

        Raises:
            RecordingError: it cannot be written there.
        """
        grid = self.discretiser
        about = QTableMetadata(
            environment=self.environment, made_by=self.made_by, names=grid.names, edges=grid.edges, actions=self.actions
        )
        write_arrays(path, about, {"values": self.values, "visits": self.visits})

    @classmethod
    def load(
        cls,
        path: str | Path,
        environment: str = "",
        names: Sequence[str] = (),
        actions: Sequence[str] = (),
        max_bytes: int = MAX_BYTES,
    ) -> QTable:
        """Return the table in a file.

        Args:
            path: of the file.
            environment: required one; any if empty.
            names: required names of the observed numbers, in this order; any if empty.
            actions: required number of actions; any if empty. Their descriptions may differ.
            max_bytes: of the file, and of what it unpacks to.

        Raises:
            RecordingError: the file is missing, of another kind (a pickle is refused, not opened), truncated or
                damaged, or for something else.
        """

        def empty(about: QTableMetadata) -> tuple[QTable, dict[str, NDArray[Any]]]:
            if names and about.names != tuple(names):
                raise RecordingError(
                    f"{path} is a table over {', '.join(about.names)}; what flies observes {', '.join(names)}.",
                    fix="a table whose Discretiser has those names, in that order.",
                )
            if actions and len(about.actions) != len(actions):
                raise RecordingError(
                    f"{path} is a table of {len(about.actions)} actions ({', '.join(about.actions)}); what flies has "
                    f"{len(actions)} ({', '.join(actions)}).",
                    fix="a table with one action for each of them.",
                )
            grid = Discretiser(about.names, about.edges)
            check_memory(2 * grid.count * len(about.actions))
            table = cls(grid, about.actions, about.environment)
            table.made_by = about.made_by
            return table, {"values": table.values, "visits": table.visits}

        table = read_arrays(path, QTableMetadata, empty, "table of action values", MAKER, environment, max_bytes)
        if (table.visits < 0).any():
            raise RecordingError(f"{path} has visits below 0.", fix=f"a file that {MAKER} has written.")
        return table
