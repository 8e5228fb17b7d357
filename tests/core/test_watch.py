"""`--watch`: a saved file has its components reloaded, once, and a file that was saved halfway is waited for."""

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from snr_sim import Config, Node, SimClock, TaskType, TimeoutLoopFactory, WatchLoopFactory, tasks
from snr_sim.core.lockstep import LockStep
from snr_sim.core.runners import CliRunner
from snr_sim.scenario.library import load_program
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

PILOT = """
from snr_sim import Endpoint, EndpointFactory, TaskType
GAIN = 1
class Pilot(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.task_handlers = {(TaskType.event, "fly"): self.on_fly}
    def on_fly(self, task, task_id):
        return self.store_data_task("thrust", GAIN)
class PilotFactory(EndpointFactory):
    def __init__(self, name="pilot"):
        super().__init__()
        self.name = name
    def get(self, parent):
        return Pilot(self, parent, self.name)
"""
FASTER = PILOT.replace("GAIN = 1", "GAIN = 5")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "watched_pilot.py"
    path.write_text(PILOT)
    return path


def watch(factories: list[Any], *saves: Callable[[], object], until_s: float = 6.0) -> tuple[Node, list[Any]]:
    """Run a watched node in virtual time; each second something is saved. Returns also what reloads there were."""
    clock = SimClock()
    node = Node("r", Config(factories={"r": [*factories, WatchLoopFactory(rate_hz=2.0)]}), clock=clock)
    for i, save in enumerate(saves, 1):
        clock.call_at(i - 0.1, lambda save=save: save() and None)  # type: ignore[misc]
    reloads: list[Any] = []
    node.add_store_listener(
        "reload", lambda page: reloads.append((page.created_at_s, page.data["created"], page.data["ok"]))
    )
    LockStep([node], clock, until_s=until_s).run()
    return node, reloads


def test_saved_file_reloads_component_at_next_check(file: Path) -> None:
    ticker = FunctionLoopFactory(lambda loop: loop.schedule(tasks.event("fly")), rate_hz=1.0)
    node, reloads = watch([load_program(str(file)).PilotFactory(), ticker], lambda: file.write_text(FASTER))
    assert reloads == [(1.0, ["pilot"], True)]
    assert node.get_data("thrust") == 5


def test_a_file_that_was_saved_unchanged_reloads_nothing(file: Path) -> None:
    _, reloads = watch([load_program(str(file)).PilotFactory()], lambda: file.write_text(PILOT))
    assert reloads == []


def test_saved_file_reloads_only_its_components(file: Path) -> None:
    module = load_program(str(file))
    factories = [module.PilotFactory("a"), FunctionEndpointFactory(), module.PilotFactory("b")]
    _, reloads = watch(factories, lambda: file.write_text(FASTER))
    assert reloads == [(1.0, ["a", "b"], True)]


def test_partly_saved_file_is_reported_once_and_retried(file: Path) -> None:
    def break_it() -> None:
        file.write_text(FASTER + "x = (")

    def repair_it() -> None:
        file.write_text(FASTER)

    node, reloads = watch([load_program(str(file)).PilotFactory()], break_it, lambda: None, repair_it)
    assert reloads == [(1.0, [], False), (3.0, ["pilot"], True)]
    assert len([note for note in node.notes if "SyntaxError" in note]) == 1


def test_a_file_that_an_editor_has_emptied_or_moved_away_is_waited_for(file: Path) -> None:
    saves = [
        lambda: file.write_text(""),
        lambda: file.rename(file.with_suffix(".old")),
        lambda: file.write_text(FASTER),
    ]
    _, reloads = watch([load_program(str(file)).PilotFactory()], *saves)
    assert reloads == [(3.0, ["pilot"], True)]


def test_the_file_of_an_added_component_is_watched_too(file: Path) -> None:
    factory = load_program(str(file)).PilotFactory("late")
    adder = FunctionEndpointFactory({(TaskType.event, "more"): lambda task, task_id: tasks.add_component(factory)})
    once = TimeoutLoopFactory(seconds=0.5, task=tasks.event("more"))
    _, reloads = watch([adder, once], lambda: None, lambda: file.write_text(FASTER))
    assert reloads == [(2.0, ["late"], True)]


def test_reload_all_excludes_watch(file: Path) -> None:
    def once(loop: Any) -> None:
        if "is_done" not in vars(loop.factory):  # the loop itself is recreated
            loop.factory.is_done = True
            loop.schedule(tasks.reload_component("all"))

    factories = [load_program(str(file)).PilotFactory(), FunctionLoopFactory(once)]
    _, reloads = watch(factories, lambda: None, lambda: file.write_text(FASTER))
    assert [made for _, made, _ in reloads] == [["pilot", "ticker"], ["pilot"]]


@pytest.mark.slow
def test_a_robot_started_with_watch_takes_an_edited_file_while_its_threads_run(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Real threads and real time: ends when the new code has answered, or fails after two minutes."""
    thrusts: list[int] = []

    def on_thrust(task: Any, task_id: Any) -> Any:
        thrusts.append(task.val_list[0].data)
        if len(thrusts) == 3:
            threading.Thread(target=lambda: file.write_text(FASTER)).start()
        return tasks.terminate("faster") if thrusts[-1] == 5 else None

    listener = FunctionEndpointFactory({(TaskType.store_page, "thrust"): on_thrust})
    ticker = FunctionLoopFactory(lambda loop: loop.schedule(tasks.event("fly")), rate_hz=50.0)
    factories = [load_program(str(file)).PilotFactory(), listener, ticker, TimeoutLoopFactory(seconds=120)]
    CliRunner({"r": factories}, ["robot.py", "--watch", "r"]).run()
    assert thrusts[:3] == [1, 1, 1]
    assert thrusts[-1] == 5
    assert "INFO snr.r_node.node_core: Recreated: pilot." in capsys.readouterr().err
