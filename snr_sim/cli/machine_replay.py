"""A recorded run executed again for its state machines: as it was, or with another program."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

from snr_sim.cli.output import capture_output
from snr_sim.cli.replay import replay_nodes
from snr_sim.cli.trust import ask

if TYPE_CHECKING:
    from snr_sim.behaviors.explain import Evaluations
    from snr_sim.behaviors.program import Program
    from snr_sim.recording.checker import NodeReplay
    from snr_sim.recording.compare import Tolerance
    from snr_sim.recording.reader import Trace
    from snr_sim.scenario.replay_files import ReplayFiles


def replay_machines(
    trace: Trace,
    with_file: str = "",
    *,
    trust: bool,
    evaluations: Callable[[Program], Evaluations] | None = None,
    tolerances: Sequence[Tolerance] = (),
) -> list[NodeReplay]:
    """Execute a run again; return the replay of each node. Args as of `replaying` and `replay_node`."""
    with replaying(trace, with_file, trust=trust, evaluations=evaluations) as plan:
        replays, _ = replay_nodes(trace, plan, with_file, tolerances)
        return replays


@contextmanager
def replaying(
    trace: Trace, with_file: str = "", *, trust: bool, evaluations: Callable[[Program], Evaluations] | None = None
) -> Iterator[ReplayFiles]:
    """Yield the files of a replay, from which all is read meanwhile; nothing is printed.

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
        yield plan
