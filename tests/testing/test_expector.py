"""Expectors: satisfied or not, and the messages if not."""

import unittest
from typing import Any

import pytest

from snr_sim import (
    Expector,
    ExpectorEndpointFactory,
    ListReplayerFactory,
    OrderedExpector,
    SNRTestCase,
    Task,
    TaskId,
    TaskType,
    TimeoutLoopFactory,
    tasks,
)
from snr_sim.prelude.errors import ComponentFailedError, ConfigError, ParameterError, RetiredNameError
from snr_sim.testing.function_components import FunctionEndpointFactory

A, B, C = ((TaskType.event, name) for name in "abc")


def feed(expector: Any, *names: str) -> Any:
    for name in names:
        expector.on_task(tasks.event(name))
    return expector


def test_counts_that_are_met_satisfy() -> None:
    with Expector({A: 2, B: 0, TaskType.event: 3}) as expector:
        feed(expector, "a", "a", "c")


def test_list_gives_count_of_each_id() -> None:
    assert feed(Expector([A, B, A]), "a", "a", "b").is_satisfied()
    assert not feed(Expector([A, B, A]), "a", "b").is_satisfied()


@pytest.mark.parametrize("came", [(), ("a",), ("a", "a", "a"), ("a", "a", "b")])
def test_counts_that_are_not_met_fail_at_the_end_of_the_with(came: tuple[str, ...]) -> None:
    with pytest.raises(AssertionError, match="expected"), Expector({A: 2, B: 0}) as expector:
        feed(expector, *came)


def test_failure_names_expected_and_actual() -> None:
    with pytest.raises(AssertionError) as caught, Expector({A: 2, B: 0}) as expector:
        feed(expector, "a", "b")
    assert str(caught.value).split("\n") == [
        "The expected tasks did not arrive:",
        "  event 'a': expected 2, came 1",
        "  event 'b': expected 0, came 1",
    ]


def test_exception_in_with_block_is_raised_unchanged() -> None:
    with pytest.raises(ZeroDivisionError), Expector({A: 1}):
        _ = 1 / 0
    with pytest.raises(ZeroDivisionError), OrderedExpector([A]):
        _ = 1 / 0


def test_order_is_checked_and_other_tasks_may_come_between() -> None:
    with OrderedExpector([A, B, A]) as expector:
        feed(expector, "a", "x", "b", "a")
    with OrderedExpector([A, TaskType.process_data]) as expector:
        feed(expector, "a").on_task(Task(TaskType.process_data, "depth"))


@pytest.mark.parametrize(
    ("came", "complaint"),
    [
        ("ba", "number 1: expected event 'a', came event 'b'"),
        ("a", "number 2: expected event 'b', came nothing more"),
        ("", "number 1: expected event 'a', came nothing more"),
        ("aba", "number 3: expected nothing more, came event 'a'"),
        ("abab", "number 3: expected nothing more, came event 'a'"),
    ],
)
def test_the_first_place_where_the_order_differs_is_named(came: str, complaint: str) -> None:
    with pytest.raises(AssertionError, match=complaint), OrderedExpector([A, B]) as expector:
        feed(expector, *came)


def test_an_order_that_differs_shows_both() -> None:
    (_, expected, came) = feed(OrderedExpector([A, B]), "b", "a").failures()
    assert expected == "expected order: event 'a', event 'b'"
    assert came == "order that came: event 'b', event 'a'"


@pytest.mark.parametrize("expected", [{("a", TaskType.event): 1}, {5: 1}])
def test_invalid_task_id_is_rejected(expected: Any) -> None:
    with pytest.raises(ConfigError, match="expector"):
        Expector(expected)


def test_text_id_is_rejected_in_task_counts() -> None:
    with pytest.raises(ConfigError, match="'a', which no task can have as its id"):
        ExpectorEndpointFactory(Expector(["a"]))


def test_calls_of_the_tests_own_are_counted_by_their_texts() -> None:
    with Expector[str]({"foo": 0, "bar": 1, "bazz": 2}) as expector:
        for name in ("bar", "bazz", "bazz", "extraneous"):
            expector.call(name)
    assert not Expector[str]({"foo": 1}).is_satisfied()
    with pytest.raises(AssertionError, match="call 'foo': expected 1, came 0"):
        Expector({"foo": 1}).assert_satisfied()


def test_calls_are_checked_in_their_order() -> None:
    with OrderedExpector[str](["setup", "halt"]) as expector:
        expector.call("setup")
        expector.call("loop")
        expector.call("halt")
    expector = OrderedExpector(["s", "setup"])
    expector.call("setup")
    assert expector.failures()[0] == "number 1: expected call 's', came call 'setup'"


@pytest.mark.parametrize("name", ["check", "get_expectations", "times_called", "met_expectations"])
def test_members_of_2021_raise_with_replacement(name: str) -> None:
    with pytest.raises(RetiredNameError, match=rf"(?s)expector\.{name}'.*Try: expector\."):
        getattr(Expector({A: 1}), name)


def test_a_call_with_the_id_of_a_task_counts_as_that_task() -> None:
    with Expector({A: 2}) as expector:
        feed(expector, "a").call(A)


@pytest.mark.parametrize("count", [-1, 1.5, None])
def test_a_count_is_a_whole_number(count: Any) -> None:
    with pytest.raises(ParameterError, match="as the count of"):
        Expector({A: count})


class InANode(SNRTestCase):
    """The way students use it."""

    def begins(self, *names: str) -> FunctionEndpointFactory:
        return FunctionEndpointFactory(
            name="starter", begin=lambda part: part.schedule([tasks.event(name) for name in names])
        )

    def test_tasks_of_a_node_are_counted(self) -> None:
        with self.expector({(TaskType.process_data, "x"): 3, TaskType.store_page: 3, B: 0}) as expector:
            self.run_test_node([ListReplayerFactory([1, 2, 3], "x"), ExpectorEndpointFactory(expector)])

    def test_the_order_in_a_node_is_checked(self) -> None:
        with self.ordered_expector([A, B, C]) as expector:
            self.run_test_node([self.begins("a", "b", "c"), ExpectorEndpointFactory(expector)])

    def test_failure_suggests_nearest_name(self) -> None:
        expected = {(TaskType.process_data, "motor_sped"): 1}
        with pytest.raises(AssertionError) as caught, self.expector(expected) as expector:
            self.run_test_node([ListReplayerFactory([1], "motor_speed"), ExpectorEndpointFactory(expector)])
        assert "came 0; did you mean 'motor_speed'? Every process_data that came: motor_speed." in str(caught.value)

    def test_the_failure_is_one_of_the_test_case(self) -> None:
        class ExpectedError(AssertionError):
            pass

        self.failureException = ExpectedError
        with pytest.raises(ExpectedError), self.expector({A: 1}):
            pass

    def test_a_satisfied_expector_can_end_the_run(self) -> None:
        with self.expector({A: 2}) as expector:
            node = self.run_test_node(
                [
                    self.begins("a", "a", "a", "a"),
                    TimeoutLoopFactory(seconds=100),
                    ExpectorEndpointFactory(expector, exit_when_satisfied=True),
                ]
            )
        assert node.exit_reason == "expector satisfied"
        assert node.get_time_s() == 0.0

    def test_failed_run_is_not_masked_by_missing_tasks(self) -> None:
        def fail(task: Task, task_id: TaskId) -> None:
            raise ValueError("mine")

        with pytest.raises(ComponentFailedError, match="mine"), self.expector({B: 1}) as expector:
            self.run_test_node(
                [FunctionEndpointFactory({A: fail}), self.begins("a"), ExpectorEndpointFactory(expector)]
            )

    def test_two_expectors_in_one_node_need_two_names(self) -> None:
        with self.expector({A: 1}) as one, self.expector({B: 1}) as other:
            self.run_test_node(
                [self.begins("a", "b"), ExpectorEndpointFactory(one), ExpectorEndpointFactory(other, "second")]
            )


def test_the_case_also_runs_under_unittest() -> None:
    suite = unittest.defaultTestLoader.loadTestsFromTestCase(InANode)
    result = unittest.TestResult()
    suite.run(result)
    assert result.testsRun == 7
    assert result.wasSuccessful()


@pytest.mark.parametrize("expected", [{A: 1}, {A: 0}, []])
@pytest.mark.parametrize("kind", [Expector, OrderedExpector])
def test_expector_without_node_fails(kind: Any, expected: Any) -> None:
    expected = list(expected) if kind is OrderedExpector else expected
    with (
        pytest.raises(AssertionError, match=r"not in a node that ran(.|\n)*Try: add ExpectorEndpointFactory"),
        kind(expected),
    ):
        pass


def test_expector_in_node_that_did_not_run_fails() -> None:
    class Case(SNRTestCase):
        def runTest(self) -> None:  # noqa: N802 - unittest's name
            with self.expector({A: 0}) as expector:
                self.get_test_node([ExpectorEndpointFactory(expector)])

    with pytest.raises(AssertionError, match="not in a node that ran"):
        Case().runTest()
