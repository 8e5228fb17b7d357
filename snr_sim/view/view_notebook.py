"""A run in a notebook's page, in the rerun viewer: `show_run(RUN)` as the last line of a cell.

The page gets a frame with the content that `snr view --web` serves (`view_server.py`): from this computer only, and
the browser itself blocks every other address. The run is kept in memory, so the notebook may delete its files.
rerun's own notebook widget is not used: it adds 65 MB, and loads the viewer from rerun's site by default.
"""

from __future__ import annotations

import atexit
from contextlib import ExitStack
from dataclasses import dataclass
from html import escape
from pathlib import Path

from snr_sim.prelude.errors import MissingExtraError
from snr_sim.view.view import view_of
from snr_sim.view.view_server import serve_web, viewer_command


@dataclass(frozen=True, repr=False)
class RunFrame:
    """Output of a notebook cell whose last line has this value: a frame, or one line of text."""

    url: str  # of the viewer's page; empty if there is no viewer
    words: str  # the line of text, below the frame if there is one
    height_px: int  # of the frame; it is as wide as the notebook

    def _repr_html_(self) -> str | None:
        if not self.url:
            return None  # a notebook then shows the text
        return (
            f'<iframe src="{escape(self.url)}" width="100%" height="{self.height_px}" style="border: 0"></iframe>'
            f"<div><small>{escape(self.words)}</small></div>"
        )

    def __repr__(self) -> str:
        return self.words


def show_run(run: str | Path, height_px: int = 520) -> RunFrame:
    """Show a run in the notebook; without a viewer, show one line with the command that installs it.

    Args:
        run: a run folder, or an .rrd file, such as that of two runs from `snr replay --with`.

    Raises:
        TraceError: there is no such run.
    """
    try:
        viewer_command()
        content = view_of(Path(run)).read_bytes()
    except MissingExtraError as error:
        return RunFrame("", f"Here the rerun viewer would show this run. {error.message} {error.fix}", height_px)
    # Served until the kernel ends: the browser may load a frame again, even after its cell has been run again.
    served = ExitStack()
    atexit.register(served.close)
    url = served.enter_context(serve_web(content, keeps_viewer=False))
    return RunFrame(url, "The rerun viewer, on this computer, for as long as this notebook's kernel runs.", height_px)
