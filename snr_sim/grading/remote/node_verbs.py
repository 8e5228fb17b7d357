"""The verbs of a student's process that are about nodes: load a file, make components, have them do a step."""

from __future__ import annotations

import base64
import pickle
import sys
from pathlib import Path

import msgspec

from snr_sim.core.config import AnyFactory
from snr_sim.core.loop import LoopFactory
from snr_sim.core.said import Heard
from snr_sim.grading.remote.child import Child
from snr_sim.grading.remote.child_node import ChildNode, in_words
from snr_sim.grading.remote.child_values import plain
from snr_sim.grading.remote.cpu_time import TookTooLong
from snr_sim.grading.remote.node_messages import SUBMISSION, Handle, Load, Make, Open, Opened, Step
from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.task import Task
from snr_sim.prelude.values import encode_value
from snr_sim.scenario import library
from snr_sim.scenario.controller import factories_of


class NodeVerbs:
    """The verbs of a student's process that are about nodes.

    Args:
        child: the other verbs.
    """

    def __init__(self, child: Child) -> None:
        self._child = child
        self._factories: list[AnyFactory] = []
        self._nodes: dict[str, ChildNode] = {}
        sys.stdout = Heard(sys.stdout, self._nodes.values())
        self._folders = {SUBMISSION: Path.cwd()}
        child.verbs |= {
            "load": self.load,
            "open": self.open,
            "make": self.make,
            "handle": self.handle,
            "step": self.step,
        }

    def load(self, raw: msgspec.Raw) -> bytes:
        """Reads a file; returns its OPTIONS and ROLES, if it has any."""
        args = _decode_load(raw)
        for name, folder in args.robots:
            self._folders[name] = Path(folder)
            library.name_robot(name, Path(folder))
        module = self._child.module(args.file)
        if not callable(getattr(module, "factories", None)):
            raise SnrError(
                f"{args.file} has no function `factories`, which a controller needs.",
                fix="def factories(robot): return [MyEndpointFactory()].",
            )
        return encode_value(
            {"options": plain(getattr(module, "OPTIONS", None)), "roles": plain(getattr(module, "ROLES", None))}
        )

    def open(self, raw: msgspec.Raw) -> bytes:
        """Has a file make its factories; returns for each whether it makes a loop."""
        args = _decode_open(raw)
        module = self._child.module(args.file)
        robot = pickle.loads(base64.b64decode(args.robot))  # the grader's word, not a stranger's
        made = factories_of(module, robot)
        self._factories += made
        return _encode(Opened([isinstance(one, LoopFactory) for one in made], _files_read(self._folders)))

    def make(self, raw: msgspec.Raw) -> bytes:
        """Makes the component of a factory in a node; returns what the grader needs to know of it."""
        args = _decode_make(raw)
        if args.node not in self._nodes:
            self._nodes[args.node] = ChildNode(args.node, args.chance)
        return msgspec.json.encode(self._nodes[args.node].add(self._factories[args.factory]))

    def handle(self, raw: msgspec.Raw) -> bytes:
        """Has the components of a node handle a task."""
        args = _decode_handle(raw)
        node = self._nodes[args.node]
        node.bring(args.now_s, args.pages, args.came_s)
        task = node.with_page(Task.deserialize(bytes(args.task)), args.processed)
        return _encode(node.handle(task, args.component, self._child))

    def step(self, raw: msgspec.Raw) -> bytes:
        """Has a component of a node do a step of its life."""
        args = _decode_step(raw)
        node = self._nodes[args.node]
        node.bring(args.now_s, args.pages, args.came_s)
        self._child.component = args.component
        self._child.step = args.step
        try:
            return _encode(node.step(node.components[args.component], args.step))
        except TookTooLong:
            raise
        except BaseException as error:
            text, fix = in_words(error, None)
            raise SnrError(text, fix) from None


_encode = msgspec.json.Encoder().encode
_decode_load = msgspec.json.Decoder(Load).decode
_decode_open = msgspec.json.Decoder(Open).decode
_decode_make = msgspec.json.Decoder(Make).decode
_decode_handle = msgspec.json.Decoder(Handle).decode
_decode_step = msgspec.json.Decoder(Step).decode


def _files_read(folders: dict[str, Path]) -> list[tuple[str, str]]:
    """Returns which files in these folders were read as modules: the folder's name and the path in it."""
    files = {Path(file).resolve() for one in list(sys.modules.values()) if (file := getattr(one, "__file__", None))}
    return sorted(
        (name, file.relative_to(folder).as_posix())
        for name, folder in folders.items()
        for file in files
        if file.is_relative_to(folder)
    )
