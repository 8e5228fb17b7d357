"""A run in a notebook's page, in the rerun viewer: `show_run(RUN)` as the last line of a cell.

The page gets a frame, and in the frame is what `snr view --web` serves (`view_server.py`): from this computer only,
and the browser itself refuses every other address. The run is kept in memory, so the notebook may tidy up its files.
rerun's own widget for notebooks is not used: it would be 65 MB more, and by itself asks rerun's site for the viewer.
"""

from __future__ import annotations

import atexit
from contextlib import ExitStack
from html import escape
from pathlib import Path

from snr_sim.prelude.errors import MissingExtra
from snr_sim.view.view import view_of
from snr_sim.view.view_server import serve_web, viewer_command


class RunFrame:
    """What a notebook shows when it is the value of a cell's last line: a frame, or one line of text.

    Args:
        url: of the viewer's page; empty if there is no viewer.
        words: the line of text; under the frame, if there is one.
        height_px: of the frame; it is as wide as the notebook.
    """

    def __init__(self, url: str, words: str, height_px: int) -> None:
        self.url = url
        self._words = words
        self._height_px = height_px

    def _repr_html_(self) -> str | None:
        if not self.url:
            return None  # a notebook then shows the text
        return (
            f'<iframe src="{escape(self.url)}" width="100%" height="{self._height_px}" style="border: 0"></iframe>'
            f"<div><small>{escape(self._words)}</small></div>"
        )

    def __repr__(self) -> str:
        return self._words


def show_run(run: str | Path, height_px: int = 520) -> RunFrame:
    """Show a run in the notebook; without a viewer, one line says how to get one.

    Args:
        run: a run folder, or an .rrd file: one of two runs side by side is what `snr replay --with` writes.
        height_px: how high the frame is.

    Raises:
        TraceError: there is no such run.
    """
    try:
        viewer_command()
        content = view_of(Path(run)).read_bytes()
    except MissingExtra as error:
        return RunFrame("", f"Here the rerun viewer would show this run. {error.message} {error.fix}", height_px)
    # It is served until the kernel ends: a frame may be loaded again, also after its cell has been run once more.
    served = ExitStack()
    atexit.register(served.close)
    url = served.enter_context(serve_web(content, keeps_viewer=False))
    return RunFrame(url, "The rerun viewer, on this computer, for as long as this notebook's kernel runs.", height_px)
