"""Which files a reload reads, and how: the student's own, however they were loaded; and nothing that starts a robot."""

import json
import subprocess
import sys
from pathlib import Path
from textwrap import dedent
from types import ModuleType
from typing import Any

import pytest

from snr_sim import Config, Node, SimClock, TimeoutLoopFactory, tasks
from snr_sim.core.reload.sources import ModuleReload, modules_of, source_of
from snr_sim.scenario.library import FoundItem, load_controller, load_program, load_robot
from snr_sim.testing.function_components import FunctionEndpointFactory


def node_of(*factories: Any) -> Node:
    return Node("r", Config(factories={"r": list(factories)}), clock=SimClock())


def reloaded(node: Node, name: str) -> dict[str, Any]:
    """Reload a component of a node in virtual time; return the page that reports it."""
    node.enqueue_input([tasks.reload_component(name), tasks.finish("done")], "test")
    node.loop()
    return dict(node.get_data("reload"))


ROBOT = """
    ROLES, IO = ("r",), ("sim",)
    def roles(context, controller):
        return {}
"""
CONTROLLER = """
    from snr_sim import Endpoint, EndpointFactory
    from ..mixer import mix

    class PilotFactory(EndpointFactory):
        def get(self, parent):
            pilot = Endpoint(self, parent, "pilot")
            pilot.answer = mix(1)
            return pilot

    def factories(robot):
        return [PilotFactory()]
"""


def test_a_controller_in_a_robots_folder_is_read_again_with_its_relative_imports(tmp_path: Path) -> None:
    folder = tmp_path / "boat"
    (folder / "controllers").mkdir(parents=True)
    (folder / "robot.py").write_text(dedent(ROBOT))
    (folder / "mixer.py").write_text("def mix(x):\n    return x\n")
    path = folder / "controllers" / "pilot.py"
    path.write_text(dedent(CONTROLLER))
    found = FoundItem("robots", "boat", folder, "the path given")
    load_robot(found)
    node = node_of(*load_controller(found, "pilot").factories(None))
    path.write_text(dedent(CONTROLLER).replace("mix(1)", "mix(7)"))
    page = reloaded(node, "pilot")
    assert page["ok"], page["message"]
    assert list(page["sources"]) == ["controllers/pilot.py"]
    assert node.components["pilot"].answer == 7  # type: ignore[attr-defined]


def test_a_helper_is_read_again_if_the_factory_names_it(tmp_path: Path) -> None:
    helper, program = tmp_path / "mixing_helper.py", tmp_path / "boat_with_helper.py"
    helper.write_text("def mix(x):\n    return x\n")
    program.write_text(
        dedent("""
        import mixing_helper
        from snr_sim import Endpoint, EndpointFactory

        class PilotFactory(EndpointFactory):
            def __init__(self):
                super().__init__(reload_targets=mixing_helper)

            def get(self, parent):
                pilot = Endpoint(self, parent, "pilot")
                pilot.answer = mixing_helper.mix(1)
                return pilot
    """)
    )
    node = node_of(load_program(str(program)).PilotFactory())
    helper.write_text("def mix(x):\n    return 8 * x\n")
    assert list(reloaded(node, "pilot")["sources"]) == [f"{tmp_path.name}/mixing_helper.py"]
    assert node.components["pilot"].answer == 8  # type: ignore[attr-defined]


def test_of_the_kits_own_components_no_file_is_read(tmp_path: Path) -> None:
    node = node_of(TimeoutLoopFactory(seconds=5), FunctionEndpointFactory())
    assert [modules_of(one.factory, one) for one in node.components.values()] == [[], [], []]  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("mixer", "list 'mixer', which is not a module"),
        (json.decoder.scanstring, "which is not a module"),
        (
            sys,
            "The reload target 'sys' of FunctionEndpointFactory cannot be read again, as it was not read from a Python",
        ),
        (ModuleType("ghost"), "The reload target 'ghost' of FunctionEndpointFactory cannot be read again"),
    ],
)
def test_missing_reload_target_is_reported_and_node_continues(target: Any, message: str) -> None:
    factory = FunctionEndpointFactory()
    factory.reload_targets = [target]
    node = node_of(factory)
    page = reloaded(node, "part")
    assert message in page["message"]
    assert node.exit_reason == "done"


def test_a_reload_target_whose_file_is_gone_is_named_with_its_path(tmp_path: Path) -> None:
    path = tmp_path / "soon_gone.py"
    path.write_text("x = 1\n")
    factory = FunctionEndpointFactory()
    factory.reload_targets = [load_program(str(path))]
    path.unlink()
    assert f"there is no file {path}" in reloaded(node_of(factory), "part")["message"]


def test_reload_deletes_removed_names_and_keeps_external_ones(tmp_path: Path) -> None:
    path = tmp_path / "forgetful.py"
    path.write_text("import json\ndef old(): ...\ndef kept(): ...\nCOUNT = 1\n")
    module = load_program(str(path))
    module.note = "from outside"  # type: ignore[attr-defined]
    path.write_text("def kept(): ...\n")
    ModuleReload(module).execute()
    assert not hasattr(module, "old")
    assert module.note == "from outside"
    assert callable(module.kept)


def test_a_bad_text_that_was_undone_is_not_what_the_module_runs(tmp_path: Path) -> None:
    path = tmp_path / "failing.py"
    path.write_text("x = 1\n")
    module = load_program(str(path))
    path.write_text("x = 1 / 0\n")
    reading = ModuleReload(module)
    with pytest.raises(ZeroDivisionError):
        reading.execute()
    reading.undo()
    path.write_text("x = 1\n")
    assert source_of(module) == b"x = 1\n"


# A program that reloads its own file while it runs as a script; START is how it starts its robot.
SCRIPT = """
    import sys
    from snr_sim import CliRunner, Endpoint, EndpointFactory, TaskType, TimeoutLoopFactory, tasks

    class Pilot(Endpoint):
        def __init__(self, factory, parent, name):
            super().__init__(factory, parent, name)
            factory.made += 1
            self.task_handlers = {(TaskType.process_data, "reload"): self.on_reload}

        def on_reload(self, task, task_id):
            page = self.get_data("reload")
            print(self.factory.made, page["ok"], page["message"].splitlines()[-1], type(self).__module__)
            return tasks.terminate("done")

    class PilotFactory(EndpointFactory):
        made = 0
        def get(self, parent):
            return Pilot(self, parent, "pilot")

    print("read")
    roles = {"r": [PilotFactory(), TimeoutLoopFactory(ms=20, task=tasks.reload_component("pilot"))]}
    START
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("start", "message"),
    [
        ("if __name__ == '__main__': CliRunner(roles, ['', 'r']).run()", "2 True Recreated: pilot. __main__"),
        ("if '__main__' == __name__ and roles: CliRunner(roles, ['', 'r']).run()", "2 True Recreated: pilot. __main__"),
        ("CliRunner(roles, ['', 'r']).run()", "1 False   Kept as before: pilot. __main__"),
    ],
)
def test_a_script_reloads_its_own_classes_without_starting_its_robot_again(
    tmp_path: Path, start: str, message: str
) -> None:
    (tmp_path / "script.py").write_text(dedent(SCRIPT).replace("START", start))
    done = subprocess.run(
        [sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout.splitlines() == ["read", "read", message]
    if "False" in message:
        assert done.stderr.splitlines()[0].startswith("script.py, line 23: CliRunner(roles")
        assert "script.py makes a node while it is read again for a reload." in done.stderr
        assert "put what starts the robot under: if __name__ == '__main__':" in done.stderr
