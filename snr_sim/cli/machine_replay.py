"""A recorded run executed again for its state machines: as it was, or with another program."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

from snr_sim.cli.output import capture_output
from snr_sim.cli.replay import config_of_replay
from snr_sim.cli.trust import ask

if TYPE_CHECKING:
    from snr_sim.behaviors.explain import Evaluations
    from snr_sim.behaviors.program import Program
    from snr_sim.core.config import Config
    from snr_sim.recording.checker import NodeReplay
    from snr_sim.recording.compare import Tolerance
    from snr_sim.recording.reader import Trace


def replay_machines(
    trace: Trace,
    with_file: str = "",
    *,
    trust: bool,
    evaluations: Callable[[Program], Evaluations] | None = None,
    tolerances: Sequence[Tolerance] = (),
) -> list[NodeReplay]:
    """Execute a run again; return the replay of each node. Args as of `replaying` and `replay_node`."""
    from snr_sim.recording.replay import replay_node

    with replaying(trace, with_file, trust=trust, evaluations=evaluations) as (config, before_task):
        roles = [node.removesuffix("_node") for node in trace.header.nodes]
        return [replay_node(trace, role, config, tolerances, before_task) for role in roles]


@contextmanager
def replaying(
    trace: Trace, with_file: str = "", *, trust: bool, evaluations: Callable[[Program], Evaluations] | None = None
) -> Iterator[tuple[Config, Callable[[int], None]]]:
    """Yield what `replay_node` needs; meanwhile files are read as they were recorded, and nothing is printed.

    Args:
        trace: of the run.
        with_file: another controller; as it was recorded if empty.
        trust: whether files of another user may be executed without a question.
        evaluations: returns what takes the evaluations of a program's conditions, if they are to be logged.
    """
    from snr_sim.behaviors.explain import explaining
    from snr_sim.core.reload.sources import reading_from
    from snr_sim.scenario.replay_files import files_of_replay

    plan = files_of_replay(trace, with_file)
    ask(trace.path.parent, plan.unknown, trust)
    with ExitStack() as stack:
        stack.enter_context(capture_output(is_json=True))
        stack.enter_context(reading_from(plan.files))
        if evaluations is not None:
            stack.enter_context(explaining(evaluations))
        config, _ = config_of_replay(trace, plan, with_file)
        yield config, plan.files.begin_task
