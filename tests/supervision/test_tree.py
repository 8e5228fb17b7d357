"""The tree of processes: what is restarted and when, in which order all ends, and when it gives up."""

from dataclasses import replace

import hypothesis.strategies as st
import pytest
from hypothesis import example, given

from snr_sim.prelude.errors import UnknownNameError
from snr_sim.supervision.plan import Supervisor
from tests.supervision.world import BACKOFF, World, child, group


def test_children_start_in_order_and_end_in_reverse_one_after_the_other() -> None:
    world = World(group("root", group("outputs", "guard"), "broker", group("components", "drive", "gps")))
    assert world.take_log() == ["start guard", "start broker", "start drive", "start gps"]
    world.stop()
    assert world.take_log() == ["end gps"]
    world.end("gps")
    world.end("drive")
    assert world.take_log() == ["end drive", "end broker"]
    world.answer()
    assert world.take_log() == ["end guard"]
    assert world.tree.is_over
    assert world.tree.safe_stop == ""


def test_failed_child_is_started_alone_after_a_delay_that_doubles_up_to_a_limit() -> None:
    world = World(group("root", "drive", "gps", restarts=9))
    delays = []
    for _ in range(4):
        world.pet("gps")
        world.end("gps", 1)
        world.take_log()
        for delay in range(1, 9):
            world.run(1, "drive")
            if world.take_log() == ["start gps"]:
                delays.append(delay)
                break
    assert delays == [1, 2, 4, 4]
    assert world.tree.process("gps").restarts == 4
    assert world.tree.process("drive").restarts == 0


def test_delay_is_the_first_again_after_healthy_time() -> None:
    world = World(group("root", "gps", restarts=9))
    for wait_s in (1, 2, 1):
        world.run(0 if wait_s == 2 else 20, "gps")
        world.end("gps", 1)
        world.take_log()
        world.tick(wait_s - 0.5)
        assert world.take_log() == []
        world.tick(0.5)
        assert world.take_log() == ["start gps"]


@pytest.mark.parametrize(
    ("restart", "status", "state"),
    [
        ("always", 0, "restarting"),
        ("always", 1, "restarting"),
        ("on_failure", 0, "ended"),
        ("on_failure", -9, "restarting"),
        ("never", 0, "ended"),
        ("never", 1, "failed"),
    ],
)
def test_restart_depends_on_policy_and_status(restart: str, status: int, state: str) -> None:
    world = World(group("root", child("gps", restart), "drive"))  # type: ignore[arg-type]
    world.end("gps", status)
    assert world.tree.process("gps").state == state
    assert not world.tree.is_over
    world.end("drive")
    assert world.tree.root.state == "degraded"


def test_tree_is_over_once_all_have_ended_for_good() -> None:
    world = World(group("root", child("gps", "on_failure"), group("rest", child("drive", "never"))))
    world.end("gps")
    world.end("drive")
    assert world.tree.is_over
    assert world.tree.root.state == "ended"


@pytest.mark.parametrize(("status", "log"), [(0, ["end gps"]), (1, [])])
def test_child_that_ends_all_does_so_without_a_failure_only(status: int, log: list[str]) -> None:
    world = World(group("root", replace(child("drive"), ends_all=True), "gps"))
    world.take_log()
    world.is_latched = status == 0
    world.end("drive", status)
    assert (world.take_log(), world.tree.is_stopping) == (log, status == 0)


def test_rest_for_one_restarts_what_was_started_after_the_failed_child() -> None:
    chain = group("chain", "camera", "detector", child("logger", "never"), "planner", strategy="rest_for_one")
    world = World(group("root", "drive", chain))
    world.take_log()
    world.end("detector", 1)
    world.answer()
    assert world.take_log() == ["end planner", "end logger"]
    world.tick(1.0)
    assert world.take_log() == ["start detector", "start planner"]


def test_rest_for_one_waits_for_all_that_ends_before_it_starts_any() -> None:
    world = World(group("root", "camera", "detector", "planner", strategy="rest_for_one"))
    world.take_log()
    world.end("camera", 1)
    world.run(1, "detector")
    assert world.take_log() == ["end planner"]
    world.tick(1.0)
    assert world.take_log() == ["kill planner"]
    world.end("planner", -9)
    world.end("detector", 1)  # it fails while it is ended, which is not counted
    assert world.take_log() == ["end detector", "start camera", "start detector", "start planner"]
    assert world.tree.root.budget_left(world.now_s) == 2


def test_chain_is_started_in_order_by_the_longest_delay_before_each() -> None:
    world = World(group("root", "camera", "detector", "planner", strategy="rest_for_one", restarts=9))
    for delay_s in (1.0, 2.0):
        world.end("detector", 1)
        world.answer()
        world.tick(delay_s)
    world.end("detector", 1)  # its next delay is 4 s
    world.end("camera", 1)
    world.answer()
    world.take_log()
    world.tick(1.0)
    assert world.take_log() == ["start camera"]
    world.tick(2.9)
    assert world.take_log() == []
    world.tick(0.1)
    assert world.take_log() == ["start detector", "start planner"]


def test_restart_due_in_a_group_is_dropped_when_a_chain_restarts_the_group() -> None:
    world = World(group("root", "camera", group("parts", "drive", "gps"), strategy="rest_for_one"))
    world.end("drive", 1)
    world.now_s += 0.5
    world.end("camera", 1)
    world.answer()
    world.take_log()
    world.tick(0.5)
    assert world.take_log() == []
    world.tick(0.5)
    assert world.take_log() == ["start camera", "start drive", "start gps"]


def test_hang_is_asked_to_end_then_killed_restarted_and_counted_once() -> None:
    world = World(group("root", "drive", "gps"))
    world.pet("gps")
    world.take_log()
    world.run(2, "drive")
    assert world.take_log() == []
    world.run(1, "drive")
    assert (world.take_log(), world.tree.process("gps").state) == (["end gps"], "hung")
    world.run(1, "drive")
    assert world.take_log() == []
    world.run(1, "drive")
    assert world.take_log() == ["kill gps"]
    world.end("gps", -9, "it was ended by SIGKILL")
    world.run(1, "drive")
    assert world.take_log() == ["start gps"]
    assert world.tree.process("gps").why == "it hung: no report for 3.0 s"
    assert world.tree.root.budget_left(world.now_s) == 2


def test_setup_has_a_timeout_of_its_own() -> None:
    world = World(group("root", "gps"))
    world.take_log()
    world.tick(3.9)
    assert world.take_log() == []
    world.tick(0.1)
    assert world.take_log() == ["end gps"]
    assert world.tree.process("gps").why == "it had not begun for 4.0 s"


def test_group_that_exceeds_its_budget_ends_in_order_and_is_restarted_by_its_parent() -> None:
    world = World(group("root", "guard", group("parts", "drive", "gps", "arm", restarts=1), "web", restarts=1))
    world.end("gps", 1)
    world.tick(1.0)
    world.take_log()
    world.end("gps", 1, "the port is gone")
    assert world.take_log() == ["end arm"]
    world.answer()
    assert world.take_log() == ["end drive"]
    assert world.tree.root.members[1].state == "restarting"
    world.tick(1.0)
    assert world.take_log() == ["start drive", "start gps", "start arm"]
    why = "gps failed 2 times in 1 s (1 restart is allowed in 10 s), last: the port is gone"
    assert world.tree.root.members[1].why == why
    assert world.tree.safe_stop == ""


def test_restart_due_in_a_group_is_dropped_when_the_group_fails() -> None:
    world = World(group("root", group("parts", "drive", "gps", restarts=1)))
    world.take_log()
    world.end("drive", 1)
    world.now_s += 0.5
    world.end("gps", 1)
    world.tick(0.5)
    assert world.take_log() == []
    world.tick(0.5)
    assert world.take_log() == ["start drive", "start gps"]


def test_root_that_exceeds_its_budget_is_a_safe_stop_with_all_reasons() -> None:
    world = World(group("root", "guard", group("parts", "drive", "gps", restarts=0), restarts=0))
    world.take_log()
    world.end("gps", 1, "the port is gone")
    world.answer()
    assert world.take_log() == ["end drive", "safe stop", "end guard"]
    assert world.tree.is_over
    assert world.tree.safe_stop == (
        "parts failed once (0 restarts are allowed in 10 s), last: gps failed once (0 restarts are allowed in 10 s), "
        "last: the port is gone"
    )
    world.tick(100.0)
    assert world.take_log() == []


def test_group_that_is_ended_by_its_parent_is_not_counted_as_failed() -> None:
    parts = group("parts", "drive", "gps", restarts=0)
    world = World(group("root", "camera", parts, strategy="rest_for_one", restarts=1))
    world.take_log()
    world.end("gps", 1)  # parts fails, and ends
    world.end("camera", 1)  # so camera takes over: all after it ends, and starts again with it
    world.end("drive")
    assert world.tree.root.budget_left(world.now_s) == 0
    world.tick(1.0)
    assert world.take_log() == ["end drive", "start camera", "start drive", "start gps"]


def test_failures_older_than_the_window_are_forgotten() -> None:
    world = World(group("root", "gps", restarts=1))
    for _ in range(3):
        world.end("gps", 1)
        world.run(10, "gps")
    assert world.tree.safe_stop == ""
    world.end("gps", 1)
    world.run(9, "gps")
    world.end("gps", 1)
    assert "gps failed 2 times in 9 s" in world.tree.safe_stop


def test_second_stop_asks_all_at_once_and_third_kills() -> None:
    world = World(group("root", "guard", "drive", "gps"))
    world.take_log()
    world.stop()
    world.stop()
    assert world.take_log() == ["end gps", "end guard", "end drive"]
    world.stop()
    assert world.take_log() == ["kill guard", "kill drive", "kill gps"]


def test_process_that_had_to_be_killed_at_the_stop_has_failed_and_says_so() -> None:
    world = World(group("root", "drive", "gps"))
    world.stop()
    world.end("gps", -9)  # it had not begun, so it was killed at once
    world.tick(2.0)
    assert world.take_log()[-2:] == ["end drive", "kill drive"]
    world.end("drive", -9)
    assert [(world.tree.process(name).state, world.tree.process(name).why) for name in ("drive", "gps")] == [
        ("failed", "it did not end within 2 s, and was killed"),
        ("ended", ""),
    ]
    assert world.tree.is_over


def test_own_report_of_a_failure_is_kept_as_its_reason() -> None:
    world = World(group("root", "gps"))
    world.tree.failed("gps", "DeviceError: /dev/ttyUSB0 is gone")
    world.tree.failed("gps", "a consequence")
    world.end("gps", 1, "it ended with exit status 1")
    assert world.tree.process("gps").why == "DeviceError: /dev/ttyUSB0 is gone"
    world.tick(1.0)
    world.end("gps", 1, "it ended with exit status 1")
    assert world.tree.process("gps").why == "it ended with exit status 1"


def test_unknown_process_is_named_with_the_nearest_known_one() -> None:
    with pytest.raises(UnknownNameError, match="'navigaton' is not supervised"):
        World(group("root", "navigation")).tree.petted("navigaton", 0.0)


# Random histories

TREES: dict[str, Supervisor] = {
    "flat": group("root", "a", "b", "c", restarts=2),
    "chain": group("root", "a", child("b", "on_failure"), "c", child("d", "never"), strategy="rest_for_one"),
    "groups": group("root", group("one", "a", "b", restarts=1), "c", group("two", "d", "e", restarts=0), restarts=1),
    "deep": group(
        "root",
        "a",
        group("one", "b", group("two", "c", "d", restarts=1), "e", strategy="rest_for_one", restarts=1),
        child("f", "on_failure"),
        strategy="rest_for_one",
    ),
}
EVENTS = st.one_of(
    st.tuples(st.just("tick"), st.integers(1, 6)),
    st.tuples(st.sampled_from(["pet", "crash", "finish", "answer one"]), st.integers(0, 5)),
    st.tuples(st.sampled_from(["crash", "pet all", "tick", "answer all"]), st.integers(1, 3)),
)


def apply(world: World, event: str, number: int) -> None:
    names = sorted(world.asked_s)
    name = names[number % len(names)] if names else ""
    if event == "tick":
        world.tick(float(number))
    elif event == "pet":
        world.pet(name)
    elif event == "pet all":
        for one in names:
            world.pet(one)
    elif event in ("crash", "finish"):
        world.end(name, int(event == "crash"))
    elif event == "stop":
        world.stop()
    elif event == "answer all":
        world.answer()
    elif asked := [one for one in names if world.asked_s[one] is not None]:
        world.end(asked[number % len(asked)], number % 2)


@given(tree=st.sampled_from(sorted(TREES)), events=st.lists(EVENTS, max_size=40), stops=st.integers(1, 3))
@example(tree="deep", events=[("crash", 1)], stops=1)  # it is stopped while a group restarts a part of itself
def test_no_history_breaks_an_order_and_each_one_can_be_stopped(
    tree: str, events: list[tuple[str, int]], stops: int
) -> None:
    world = World(TREES[tree])
    for event, number in events:
        apply(world, event, number)
    for _ in range(stops):
        world.stop()
    for _ in range(20):  # each process that does not answer is killed in its turn
        world.tick(2.0)
        for line in world.take_log():
            if line.startswith("kill "):
                world.end(line.removeprefix("kill "), -9)
    assert world.tree.is_over
    assert world.asked_s == {}


class Model:
    """What a supervisor with strategy one_for_one does, from the times of its failures alone."""

    def __init__(self, names: str, restarts: int, within_s: float) -> None:
        self.restarts, self.within_s = restarts, within_s
        self.failed_s: list[float] = []
        self.due_s: dict[str, float] = {}
        self.delays: dict[str, list[float]] = {name: [] for name in names}
        self.started_s = dict.fromkeys(names, 0.0)

    def fail(self, name: str, now_s: float) -> bool:
        """Returns whether it is restarted."""
        self.failed_s.append(now_s)
        if sum(now_s - self.within_s < failed_s <= now_s for failed_s in self.failed_s) > self.restarts:
            return False
        if now_s - self.started_s[name] >= BACKOFF.healthy_s:
            self.delays[name] = []
        delay_s = 1.0 if not self.delays[name] else min(2.0 * self.delays[name][-1], BACKOFF.longest_s)
        self.delays[name].append(delay_s)
        self.due_s[name] = now_s + delay_s
        return True

    def start(self, now_s: float) -> list[str]:
        due = sorted(name for name, due_s in self.due_s.items() if due_s <= now_s)
        for name in due:
            del self.due_s[name]
            self.started_s[name] = now_s
        return due


@given(history=st.lists(st.tuples(st.integers(1, 8), st.sampled_from("abc-")), max_size=60), restarts=st.integers(0, 5))
@example(history=[(1, "a")] * 4, restarts=5)
def test_restarts_follow_the_model_of_one_supervisor(history: list[tuple[int, str]], restarts: int) -> None:
    world, model = World(group("root", "a", "b", "c", restarts=restarts)), Model("abc", restarts, 10.0)
    world.take_log()
    for seconds, name in history:
        for _ in range(seconds):
            world.run(1, "a", "b", "c")
            assert world.take_log() == [f"start {one}" for one in model.start(world.now_s)]
        if name not in world.asked_s:
            continue
        world.end(name, 1)
        if not model.fail(name, world.now_s):
            assert world.take_log()[0] == "safe stop"
            assert world.tree.safe_stop
            return
        assert world.take_log() == []
