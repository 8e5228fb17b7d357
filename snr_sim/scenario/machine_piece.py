"""A piece of a recorded run as the input of one state machine, for a test: `snr machine record` prints one.

    run --> replay_node --> snapshot at the beginning --.
    trace --> readings, signals, steps of the piece ----+--> text --> replay_piece --> changes of state

A piece has what its machine's steps depend on, and nothing else of the run: no other component, no clock, no plant.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeAlias

from snr_sim.behaviors.endpoint import MachineEndpoint, MachineFactory
from snr_sim.behaviors.interpreter import NS_PER_S, Change
from snr_sim.core.config import Config
from snr_sim.core.node import Node
from snr_sim.prelude import tasks
from snr_sim.prelude.errors import ParameterError, UnknownNameError, suggest
from snr_sim.prelude.task import KINDS, Task, TaskType
from snr_sim.prelude.values import decode_value, encode_value
from snr_sim.recording.reader import Trace
from snr_sim.recording.records import BeginRecord, Executed, PageRecord
from snr_sim.recording.replay import ReplayClock, replay_node
from snr_sim.scenario.library import bridge_of_robot, load_program
from snr_sim.scenario.machine_controller import read_program
from snr_sim.scenario.machine_edits import EDITS, changes_of

STEPS_PER_ROW = 12
_STEP = tasks.event("step")
Transition: TypeAlias = tuple[float, str, str, str]  # time [s], path of the machine, source, target


def piece_of(
    trace: Trace, config: Config, before_task: Callable[[int], None], name: str, from_s: float, until_s: float
) -> tuple[str, list[Transition]]:
    """Return a piece of a run as text, and the changes of state that its machine made there.

    Args:
        trace: of the run, which is executed again.
        config: of the run.
        before_task: as of `replay_node`.
        name: of the machine's component.
        from_s, until_s: beginning and end of the piece.

    Raises:
        UnknownNameError: the run has no such machine.
        ParameterError: nothing happens in the interval, or the machine is paused at its beginning.
    """
    node = next((one.node for one in trace.records if isinstance(one, BeginRecord) and one.component == name), None)
    executed = [one for one in trace.records if isinstance(one, Executed) and one.node == node and one.t <= until_s]
    first = next((one.seq for one in executed if one.t >= from_s), None)
    if node is None:
        known = dict.fromkeys(one.component for one in trace.records if isinstance(one, BeginRecord))
        raise UnknownNameError(f"This run has no machine '{name}'.", fix=suggest(name, known))
    if first is None:
        raise ParameterError(f"Nothing happens from {from_s:g} s on.", fix="choose an interval within the run.")
    made: list[Node] = []
    snapshots: list[dict[str, Any]] = []

    def keep(seq: int) -> None:
        before_task(seq)
        if seq >= first and not snapshots:
            endpoint = _endpoint(made[0], name)
            if endpoint.is_paused:
                raise ParameterError(f"The machine is paused at {from_s:g} s.", fix="begin before the pause.")
            snapshots.append(endpoint.interpreter.snapshot())

    replay_node(trace, node.removesuffix("_node"), config, (), keep, made.append)
    bridge = _endpoint(made[0], name).factory.bridge
    keys = set() if bridge is None else {one.page for one in bridge.reads.values()}
    pages = {one.name: one for one in executed if isinstance(one, PageRecord) and one.name in keys and one.seq < first}
    inside = [one for one in executed if one.seq >= first]
    rows = [["begin", trace.header.robot, node.removesuffix("_node"), name, snapshots[0]]]
    for page in pages.values():
        rows += _rows(page, name, keys)
    for record in inside:
        for row in _rows(record, name, keys):
            is_next = row[0] == rows[-1][0] == "step" and len(rows[-1]) <= STEPS_PER_ROW
            rows[-1:] = [rows[-1] + row[1:]] if is_next else [rows[-1], row]
    steps = {one.seq for one in inside if _handles(one, name)}
    changes = changes_of([one for one in inside if one.cause in steps and one.name == f"{name}.transition"])
    found = [_transition(one["t_ns"], one["machine"], one["source"], one["target"]) for one in changes]
    return "\n".join(encode_value(row).decode() for row in rows), found


def _handles(record: Executed, name: str) -> bool:
    return any(call.component == name for call in record.handled)


def _rows(record: Executed, name: str, keys: set[str]) -> Iterator[list[Any]]:
    """Yield what a task means for the machine: a reading, a step, another event; nothing for an edit."""
    if isinstance(record, PageRecord):
        if record.name in keys:
            yield ["page", record.t, *decode_value(bytes(record.values), KINDS)]
    elif not _handles(record, name) or record.name.endswith(EDITS):
        return
    elif record.type == TaskType.process_data or record.name == f"{name}.step":
        yield ["step", record.t]
    else:
        yield ["event", record.t, record.name, decode_value(bytes(record.values), KINDS)]


def _transition(t_ns: int, machine: str, source: str, target: str) -> Transition:
    return t_ns / NS_PER_S, machine, source, target


def _endpoint(node: Node, name: str) -> MachineEndpoint:
    found = node.components.get(name)
    if not isinstance(found, MachineEndpoint):
        raise UnknownNameError(f"There is no machine '{name}'.", fix=suggest(name, node.components))
    return found


def replay_piece(piece: str, file: str) -> list[Transition]:
    """Run the program of a file on a piece of a run; return its changes of state, for a test.

    Args:
        piece: as `snr machine record` prints it.
        file: an LRP program.

    Raises:
        ConfigError: the program has mistakes.
        ParameterError: the program does not have a state or a variable with which the piece begins.
    """
    (_, robot, role, name, snapshot), *rows = (
        decode_value(line.encode(), KINDS) for line in piece.strip().splitlines()
    )
    bridge = bridge_of_robot(robot)
    program = read_program(Path(file), load_program, bridge)
    clock = ReplayClock()
    config = Config(factories={role: [MachineFactory(program, name, bridge=bridge)]})
    node = Node(role, config, clock=clock, is_replay=True)
    endpoint = _endpoint(node, name)
    try:
        endpoint.interpreter.restore({**snapshot, "sha256": program.sha256})
    except (KeyError, UnknownNameError) as error:
        raise ParameterError(
            f"The piece begins with what {file} does not have: {error}.", fix="record a piece with today's program."
        ) from error
    endpoint.recent = deque()
    for kind, t_s, *values in rows:
        clock.show(t_s)
        if kind == "page":
            node.datastore.put(values[0])
            node.datastore.received_s[values[0].key] = t_s  # counts for pages of other nodes
        elif kind == "event" and (TaskType.event, values[0]) in endpoint.task_handlers:
            endpoint.task_handlers[TaskType.event, values[0]](Task(TaskType.event, *values), TaskType.event)
        for step_s in [t_s, *values] if kind == "step" else []:
            clock.show(step_s)
            endpoint.on_step(_STEP, _STEP.type)
    changes = [one for _, one in endpoint.recent if isinstance(one, Change)]
    return [_transition(one.t_ns, one.machine, one.source, one.target) for one in changes]
