"""What the grader's node and the student's process say to each other about components: see `protocol.py`."""

from __future__ import annotations

from typing import Any, TypeAlias

import msgspec

SUBMISSION = "."  # the name of the submission's folder; those of robots have theirs
# Type of the task, its name (None: every one), and the handler's name.
HandlerRow: TypeAlias = tuple[str, str | None, str]


class Load(msgspec.Struct, frozen=True):
    """Read this file.

    Args:
        file: of the submission.
        robots: names and folders of robots whose modules it may import.
    """

    file: str
    robots: list[tuple[str, str]]


class Loaded(msgspec.Struct, frozen=True):
    """A file was read: its OPTIONS and its ROLES, if it has any."""

    options: Any
    roles: Any


class Open(msgspec.Struct, frozen=True):
    """Call the file's `factories`.

    Args:
        file: of the submission, which was read.
        robot: what `factories` gets, pickled, in base64.
    """

    file: str
    robot: str


class Opened(msgspec.Struct, frozen=True):
    """There are factories: for each whether it makes a loop; and which files were read, in which folder."""

    are_loops: list[bool]
    files: list[tuple[str, str]]


class Make(msgspec.Struct, frozen=True):
    """Make the component of a factory in the node of a role."""

    node: str
    factory: int
    chance: int


class Made(msgspec.Struct, frozen=True, omit_defaults=True):
    """A component: its name, its handlers, and which steps of its life its author has written."""

    name: str
    handlers: list[HandlerRow]
    steps: list[str]
    is_loop: bool = False
    rate_hz: float = 0.0
    first_s: float = 0.0
    next_s: float | None = None


class Handle(msgspec.Struct, frozen=True):
    """Handle a task, from the component named on; `pages` are new in the datastore since the last message.

    Args:
        processed: of `process_data` that carries a page: that page and the one before it, if newer ones are in the
            datastore; nothing if it is the newest. Then `task` is without values. None: `task` has what it carries.
    """

    node: str
    component: str
    task: msgspec.Raw
    now_s: float
    pages: list[msgspec.Raw]
    came_s: dict[str, float]
    processed: list[msgspec.Raw] | None


class Step(msgspec.Struct, frozen=True):
    """Do a step of a component's life: begin, join, terminate; of a loop also setup, loop."""

    node: str
    component: str
    step: str
    now_s: float
    pages: list[msgspec.Raw]
    came_s: dict[str, float]


class Told(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """What is told after every step: what entered through the door, new handlers, notes, pages asked for in vain.

    Args:
        said: what components have printed and logged: component, level, text.
    """

    entered: list[tuple[msgspec.Raw, str]] = []
    handlers: dict[str, list[HandlerRow]] | None = None
    notes: list[str] = []
    missed: list[str] = []
    said: list[tuple[str, str, str]] = []


class Returned(Told, frozen=True, omit_defaults=True):
    """What handlers returned, by component; and which one failed, if one did."""

    returned: dict[str, list[msgspec.Raw]]
    failed: str = ""
    text: str = ""
    fix: str = ""
    is_slow: bool = False


class StepDone(Told, frozen=True, omit_defaults=True):
    """What a step scheduled; of a loop also when its next tick is to come, and whether there is to be one."""

    scheduled: list[msgspec.Raw]
    next_s: float | None = None
    is_stopped: bool = False
