"""Reports of a process that its node works."""

import hypothesis.strategies as st
from hypothesis import given

from snr_sim import Config, Node, SimClock, tasks
from snr_sim.supervision.beats import BEAT_S, Beats, beat_period_s
from snr_sim.testing.function_components import FunctionEndpointFactory


class Line:
    """A connection to the supervisor that keeps what is sent."""

    def __init__(self, sent: list[tuple[object, ...]]) -> None:
        self.sent = sent

    def __call__(self, *values: object) -> bool:
        self.sent.append(values)
        return True


def test_node_reports_once_it_has_begun_and_only_after_progress() -> None:
    node = Node("drive", Config(factories={"drive": [FunctionEndpointFactory()]}), clock=SimClock())
    sent: list[tuple[object, ...]] = []
    beats = Beats(node, Line(sent))
    beats.check()
    node.begin()
    beats.check()
    assert sent == []
    node.schedule(tasks.event("go"))
    node.run_ready()
    beats.check()
    beats.check()
    assert len(sent) == 1
    node.inbox.wait(0.0)  # an idle node polls
    beats.check()
    assert len(sent) == 2
    node.schedule([tasks.event("go"), tasks.event("go")])
    beats.check()
    assert len(sent) == 2
    node.end()


def test_report_has_processor_time_memory_and_waiting_tasks() -> None:
    node = Node("drive", Config(factories={"drive": [FunctionEndpointFactory()]}), clock=SimClock())
    sent: list[tuple[object, ...]] = []
    node.begin()
    node.inbox.wait(0.0)
    node.schedule([tasks.event("go"), tasks.event("go")])
    assert Beats(node, Line(sent)).check()
    ((what, cpu_s, rss_mb, waiting),) = sent
    assert what == "beat"
    assert isinstance(cpu_s, float)
    assert isinstance(rss_mb, float)
    assert cpu_s > 0.0
    assert 10.0 < rss_mb < 10_000.0
    assert waiting == 2
    node.end()


def test_reports_end_when_the_supervisor_has_gone() -> None:
    node = Node("drive", Config(factories={"drive": [FunctionEndpointFactory()]}), clock=SimClock())
    node.begin()
    node.inbox.wait(0.0)
    Beats(node, lambda *values: False).run(0.0)  # it would not return
    node.end()


@given(hang_s=st.floats(0.01, 100.0))
def test_several_reports_fit_into_the_time_of_a_hang(hang_s: float) -> None:
    assert hang_s / beat_period_s(hang_s) >= 4.9
    assert beat_period_s(hang_s) <= BEAT_S
