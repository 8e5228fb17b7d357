"""A sheet to draw on, in points from its top left corner. The only module that imports matplotlib and Pillow.

Agg, and figures without pyplot: a user's style has no effect. It replaced a canvas on Pillow. On one core a frame of
the lander takes 8 ms instead of 30 (its faces are turned as arrays), one of `LunarLanderBox` 1.5 instead of 1.0, and
`snr view --png` of a dive 1.6 s instead of 1.4, with 144 MB instead of 129.
"""

from __future__ import annotations

import warnings
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from snr_sim.prelude.errors import MissingExtraError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

Rgb: TypeAlias = tuple[int, int, int]
Point: TypeAlias = tuple[float, float]
Floats: TypeAlias = NDArray[np.float64]
Area: TypeAlias = tuple[float, float, float, float]  # left, top, right, bottom

PIXELS_PER_POINT = 2  # for screens with twice the usual resolution
COLORS_KEPT = 128  # a palette reduces the file to a quarter without a visible difference
SEAM = 0.35  # width of the edge of a face: without one the background shines through between two smoothed faces

INK: Rgb = (240, 242, 246)
PALE: Rgb = (176, 184, 198)
FAINT: Rgb = (96, 106, 124)
GRID: Rgb = (44, 51, 68)
BACKGROUND: Rgb = (20, 24, 36)
EVENT: Rgb = (255, 200, 80)

# Style of texts and axes. Everything else has matplotlib's defaults, regardless of the user's own style.
STYLE: Any = {
    "font.family": "DejaVu Sans",  # included in matplotlib, so the font is the same everywhere
    "text.parse_math": False,  # a dollar sign in a name is a dollar sign
    **{f"axes.spines.{side}": False for side in ("left", "right", "top", "bottom")},
    "lines.solid_capstyle": "round",
}
ALIGNED: dict[str, str] = {"l": "left", "m": "center", "r": "right"}


class Part(NamedTuple):
    """A polygon or a line on a sheet."""

    points: Floats  # shape (n, 2), in points
    rgb: Rgb
    width: float = 0.0  # of the line in points; of a polygon 0


class Sheet:
    """A sheet to draw on, of a width and height in points; raise MissingExtraError if matplotlib is not installed."""

    def __init__(self, width: int, height: int, background: Rgb = BACKGROUND) -> None:
        try:
            from matplotlib.backends.backend_agg import FigureCanvasAgg
            from matplotlib.figure import Figure
            from matplotlib.transforms import Affine2D
        except ImportError as error:
            raise MissingExtraError("matplotlib", "view") from error
        self.width: int = width
        self.height: int = height
        self.figure: Figure = Figure((width / 72, height / 72), 72 * PIXELS_PER_POINT, facecolor=color(background))
        self._canvas: Any = FigureCanvasAgg(self.figure)
        self._points = Affine2D().scale(PIXELS_PER_POINT, -PIXELS_PER_POINT).translate(0, PIXELS_PER_POINT * height)

    def paint(self, parts: Sequence[Part], axes: Axes | None = None) -> None:
        """Draw parts, the first at the bottom, clipped to the axes."""
        from matplotlib.collections import PolyCollection

        outlines = [np.concatenate([points, points[:1]]) if not width else points for points, _, width in parts]
        edges = [color(part.rgb) for part in parts]
        collection = PolyCollection(
            outlines,
            closed=False,
            facecolors=["none" if part.width else edge for part, edge in zip(parts, edges, strict=True)],
            edgecolors=edges,
            linewidths=[part.width or SEAM for part in parts],
            capstyle="round",
            joinstyle="round",
            transform=self._points,
        )
        (axes or self.figure).add_artist(collection)

    def axes(self, area: Area, across: Point = (0.0, 1.0), up: Point = (0.0, 1.0), rgb: Rgb | None = None) -> Axes:
        """Return axes without ticks, on an area without the labels around it.

        `across` and `up` are the values at left and right edge, and at lower and upper edge.
        """
        left, top, right, bottom = area
        wide, high = self.width, self.height
        rect = (left / wide, 1.0 - bottom / high, (right - left) / wide, (bottom - top) / high)
        face = "none" if rgb is None else color(rgb)
        return self.figure.add_axes(rect, xlim=across, ylim=up, facecolor=face, xticks=[], yticks=[])

    def scale(
        self, axis: Axis, count: int, room_low: float = 0.0, room_high: float = 0.0, mark: Rgb | None = None
    ) -> None:
        """Write about `count` round numbers along an axis of the axes that `axes` returned.

        Margins at its ends, in values of the axis, have no numbers; `mark` is the colour of a line at each number.
        """
        from matplotlib.ticker import MaxNLocator

        low, high = sorted(axis.get_view_interval())
        numbers = MaxNLocator(count, steps=[1, 2, 5, 10]).tick_values(low, high)
        axis.set_ticks([number for number in numbers if low + room_low <= number <= high - room_high])
        axis.set_major_formatter("{x:g}")
        axis.set_tick_params(labelsize=9.0, labelcolor=color(PALE), length=4.0 if mark else 0.0)
        if mark:
            axis.set_tick_params(color=color(mark), width=0.8)

    def text(self, at: Point, words: str, size: float, rgb: Rgb, anchor: str = "lt", **options: Any) -> None:
        """Write a line of text; `options` are further arguments of `Figure.text`.

        The anchor is the point of the text at that position: 'lt' left top, 'rm' right middle, ...
        """
        ha, va = ALIGNED[anchor[0]], "top" if anchor[1] == "t" else "center_baseline"
        self.figure.text(*at, words, size=size, color=color(rgb), ha=ha, va=va, transform=self._points, **options)

    def text_width(self, words: str, size: float) -> float:
        """Return the width of a text."""
        from matplotlib.font_manager import FontProperties

        font = FontProperties(size=size)
        width, _, _ = self._canvas.get_renderer().get_text_width_height_descent(words, font, ismath=False)
        return float(width) / PIXELS_PER_POINT

    def cut(self, words: str, size: float, width: float) -> str:
        """Return a text truncated to a width, with dots at the end if it is truncated."""
        if self.text_width(words, size) <= width:
            return words

        def shortened(length: int) -> str:
            return words[:length].rstrip(" ,;:") + " ..."

        lengths = range(1, len(words))
        fitting = bisect_right(lengths, width, key=lambda length: self.text_width(shortened(length), size))
        return shortened(lengths[fitting - 1]) if fitting else ""

    def pixels(self) -> NDArray[np.uint8]:
        """Return the sheet as an array, shape (height, width, 3) in pixels."""
        self._canvas.draw()
        rgba = np.asarray(self._canvas.buffer_rgba())
        return np.dstack([rgba[..., i] for i in range(3)])  # a quarter of the time of rgba[..., :3].copy()

    def save(self, path: str | Path) -> None:
        """Write the sheet as PNG."""
        from PIL import Image  # a dependency of matplotlib, so it is installed

        Image.fromarray(self.pixels()).quantize(COLORS_KEPT, dither=Image.Dither.NONE).save(path, "PNG", optimize=True)


@contextmanager
def picture(path: str | Path, width: int, height: int, background: Rgb = BACKGROUND) -> Iterator[Sheet]:
    """Yield a sheet that is written as PNG at the end; the user's own matplotlib style does not affect it.

    MissingExtraError is raised if matplotlib is not installed.
    """
    sheet = Sheet(width, height, background)
    from matplotlib import rc_context, rcdefaults

    with rc_context(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # a box is drawn for characters missing in the font
        rcdefaults()
        with rc_context(STYLE):
            yield sheet
            sheet.save(path)


def color(rgb: Rgb) -> tuple[float, float, float]:
    """Return a colour in matplotlib's format, each component 0 to 1.

    >>> color((255, 0, 51))
    (1.0, 0.0, 0.2)
    """
    red, green, blue = rgb
    return red / 255, green / 255, blue / 255


def mixed(first: Rgb, second: Rgb, fraction: float) -> Rgb:
    """Return a colour between two.

    >>> mixed((0, 0, 0), (100, 200, 50), 0.5)
    (50, 100, 25)
    """
    red, green, blue = (round(a + (b - a) * fraction) for a, b in zip(first, second, strict=True))
    return red, green, blue
