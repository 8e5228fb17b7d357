"""What a program's robot reads and commands, from pages: of a node that runs, or of a recorded run."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

from snr_sim.behaviors.bridge import Bridge, Drive, Read
from snr_sim.prelude.task import DataKey, Page
from snr_sim.web.messages import Command, Reading, RobotPart

APPLIED = "_applied"  # end of the keys of pages with the result of a command
MAX_TEXT = 1000  # characters of a value that is shown
MAX_ELEMENTS = 100
GetPage: TypeAlias = Callable[[DataKey], Page | None]


def parts_of(bridge: Bridge | None) -> list[RobotPart]:
    """Return the parts of a robot that a program can name."""
    if bridge is None:
        return []
    found = []
    for name, functions in bridge.parts.items():
        read, drive = bridge.reads.get(name), bridge.drives.get(name)
        limits = (None, None) if drive is None else (drive.low, drive.high)
        unit = read.unit if read is not None else drive.unit if drive is not None else ""
        found.append(RobotPart(name, sorted(functions), unit, *limits))
    return found


def pages_of(bridge: Bridge | None) -> list[DataKey]:
    """Return the keys of all pages that `readings_of` and `commands_of` read."""
    if bridge is None:
        return []
    commands = [one.page for one in bridge.drives.values()]
    keys = [*(one.page for one in bridge.reads.values()), *commands, *(f"{key}{APPLIED}" for key in commands)]
    return list(dict.fromkeys(keys))


def readings_of(
    bridge: Bridge | None, others: Sequence[DataKey], get_page: GetPage, age_s: Callable[[Page], float]
) -> dict[str, Reading]:
    """Return value and age of each part that is read.

    Args:
        bridge: the parts; without one, the fields of the pages `others` are shown.
        others: keys of pages that a machine reacts to.
        get_page: returns the newest page of a key.
        age_s: returns the age of a page.
    """
    if bridge is None:
        reads = {name: read for key in others for name, read in _fields(key, get_page(key)).items()}
    else:
        reads = dict(bridge.reads)
    return {name: _reading(read, get_page(read.page), age_s) for name, read in reads.items()}


def _fields(key: DataKey, page: Page | None) -> dict[str, Read]:
    if page is None or not isinstance(page.data, Mapping):
        return {key: Read(key)}
    return {f"{key}.{field}": Read(key, str(field)) for field in list(page.data)[:MAX_ELEMENTS]}


def _reading(read: Read, page: Page | None, age_s: Callable[[Page], float]) -> Reading:
    limit_s = read.fresh_s if math.isfinite(read.fresh_s) else None
    if page is None:
        return Reading(None, None, limit_s)
    try:
        value = page.data[read.field] if read.field else page.data
        value = value if value is None or read.to is None else read.to(value)
    except Exception as error:  # of a page with other content, and of code of the robot's
        value = f"{type(error).__name__}: {error}"
    age = age_s(page)
    return Reading(shown(value), age if math.isfinite(age) else None, limit_s)


def commands_of(bridge: Bridge | None, get_page: GetPage) -> dict[str, Command]:
    """Return the newest command to each part, as its page has it, and how long it took until it was applied."""
    drives = {} if bridge is None else bridge.drives
    return {name: _command(drive, get_page) for name, drive in drives.items()}


def _command(drive: Drive, get_page: GetPage) -> Command:
    page, applied = get_page(drive.page), get_page(f"{drive.page}{APPLIED}")
    delay = applied.data.get("delay_s") if applied is not None and isinstance(applied.data, Mapping) else None
    value = page.data.get(drive.field) if page is not None and isinstance(page.data, Mapping) else None
    is_time = isinstance(delay, (int, float)) and math.isfinite(delay)
    return Command(shown(value), float(delay) if is_time else None)  # type: ignore[arg-type]


def shown(value: Any, depth: int = 4) -> Any:
    """Return a value as JSON can show it, and shortened.

    >>> shown((1, "a" * 5000))[1][-4:], shown(float("nan")), shown({1: 2})
    ('a...', 'nan', '{1: 2}')
    """
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else str(value)
    if isinstance(value, int):
        return int(value) if abs(value) <= 2**53 else str(value)
    if isinstance(value, (list, tuple)) and depth > 0:
        more = ["..."] if len(value) > MAX_ELEMENTS else []
        return [shown(one, depth - 1) for one in value[:MAX_ELEMENTS]] + more
    text = value if isinstance(value, str) else reprlib.repr(value)
    return text if len(text) <= MAX_TEXT else f"{text[: MAX_TEXT - 3]}..."
