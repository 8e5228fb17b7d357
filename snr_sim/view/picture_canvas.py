"""A sheet to draw on, in points from its top left corner, antialiased. The one file that imports Pillow."""

from __future__ import annotations

import importlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy

from snr_sim.prelude.errors import MissingExtra

Rgb: TypeAlias = tuple[int, int, int]
Point: TypeAlias = tuple[float, float]

PIXELS_PER_POINT = 2  # of the picture: sharp on a screen of twice the usual resolution
SUPERSAMPLING = 2  # drawn so much larger and then shrunk: that is what smooths the edges
COLORS_KEPT = 128  # a palette makes the file a quarter as large, and nobody sees it


class Canvas:
    """A sheet of paper.

    Args:
        width, height: in points.
        background: its colour.

    Raises:
        MissingExtra: Pillow is not installed.
    """

    def __init__(self, width: int, height: int, background: Rgb) -> None:
        try:
            self._font_module = importlib.import_module("PIL.ImageFont")
            image_module, draw_module = importlib.import_module("PIL.Image"), importlib.import_module("PIL.ImageDraw")
        except ImportError as error:
            raise MissingExtra("pillow", "view") from error
        self.width, self.height = width, height
        self._scale = PIXELS_PER_POINT * SUPERSAMPLING
        self._image = image_module.new("RGB", (width * self._scale, height * self._scale), background)
        self._draw = draw_module.Draw(self._image)
        self._fonts: dict[float, Any] = {}

    def polygon(self, points: Sequence[Point], fill: Rgb) -> None:
        """Fills a shape."""
        self._draw.polygon(self._pixels(points), fill=fill)

    def line(self, points: Sequence[Point], color: Rgb, width: float = 1.0) -> None:
        """Draws a line through points."""
        if len(points) > 1:
            self._draw.line(self._pixels(points), fill=color, width=max(1, round(width * self._scale)), joint="curve")

    def dashed(self, start: Point, end: Point, color: Rgb, width: float = 1.0, dash: float = 4.0) -> None:
        """Draws a dashed line."""
        (x0, y0), (x1, y1) = start, end
        length = max(1e-9, ((x1 - x0) ** 2 + (y1 - y0) ** 2) ** 0.5)
        for i in range(0, int(length / dash) + 1, 2):
            a, b = i * dash / length, min(1.0, (i + 1) * dash / length)
            if a < 1.0:
                ends = [(x0 + (x1 - x0) * part, y0 + (y1 - y0) * part) for part in (a, b)]
                self.line(ends, color, width)

    def disc(self, center: Point, radius: float, fill: Rgb) -> None:
        """Fills a disc."""
        x, y = center
        self._draw.ellipse(self._pixels([(x - radius, y - radius), (x + radius, y + radius)]), fill=fill)

    def rectangle(self, left: float, top: float, right: float, bottom: float, fill: Rgb) -> None:
        """Fills a rectangle."""
        self._draw.rectangle(self._pixels([(left, top), (right, bottom)]), fill=fill)

    def text(self, at: Point, words: str, size: float, color: Rgb, anchor: str = "la") -> None:
        """Writes a line of text.

        Args:
            at: where.
            words: what.
            size: height of the letters.
            color: of the letters.
            anchor: which point of the text stands there, as Pillow calls it: 'la' left top, 'rm' right middle, ...
        """
        self._draw.text(self._pixels([at])[0], words, fill=color, font=self._font(size), anchor=anchor)

    def text_width(self, words: str, size: float) -> float:
        """Returns how wide a text is."""
        return float(self._draw.textlength(words, font=self._font(size))) / self._scale

    def cut(self, words: str, size: float, width: float) -> str:
        """Returns as much of a text as fits into a width, with dots where the rest is missing."""
        shown = words
        while shown and self.text_width(shown, size) > width:
            words = words[:-1]
            shown = words.rstrip(" ,;:") + " ..."
        return shown

    def save(self, path: str | Path) -> None:
        """Writes the sheet as PNG."""
        size = (self.width * PIXELS_PER_POINT, self.height * PIXELS_PER_POINT)
        small = self._image.reduce(SUPERSAMPLING) if SUPERSAMPLING > 1 else self._image
        small = small.resize(size) if small.size != size else small
        small.quantize(COLORS_KEPT, dither=0).save(path, format="PNG", optimize=True)

    def pixels(self) -> Any:
        """Returns the sheet as an array, shape (height, width, 3) in pixels, dtype uint8."""
        return numpy.asarray(self._image.reduce(SUPERSAMPLING))

    def _font(self, size: float) -> Any:
        if size not in self._fonts:
            self._fonts[size] = self._font_module.load_default(size * self._scale)
        return self._fonts[size]

    def _pixels(self, points: Iterable[Point]) -> list[Point]:
        return [(x * self._scale, y * self._scale) for x, y in points]


def mixed(first: Rgb, second: Rgb, share: float) -> Rgb:
    """Returns a colour between two.

    >>> mixed((0, 0, 0), (100, 200, 50), 0.5)
    (50, 100, 25)
    """
    red, green, blue = (round(a + (b - a) * share) for a, b in zip(first, second, strict=True))
    return red, green, blue
