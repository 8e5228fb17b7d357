"""The course's programs have no error under `mypy --strict`, except that their functions need no annotations."""

from __future__ import annotations

from pathlib import Path

import pytest
from mypy import api

from tests.public_types import ROOT, write_programs

OPTIONS = ["--strict", "--allow-untyped-defs", "--allow-incomplete-defs", "--allow-untyped-calls", "--config-file="]
LABS = ROOT / "assignments"
STARTERS = sorted({str(file.parent.relative_to(LABS)) for file in LABS.glob("*/starter/**/*.py")})


# Both forms with every annotation that plain --strict asks for, by public names of one package.
ANNOTATED = """\
from collections.abc import Mapping

import msgspec

from snr_sim import Endpoint, EndpointFactory, Loop, LoopFactory, NodeApi, RobotInfo, SomeTasks
from snr_sim import Task, TaskId, TaskType, handles, page, tasks


@page("engine")
class Engine(msgspec.Struct):
    throttle: float


class Gentle(Endpoint):
    hover = 0.28

    @handles("radar")
    def on_radar(self, radar: Mapping[str, float]) -> Task:
        return self.store_data_task("engine", Engine(self.hover - 0.1 * radar["velocity_mps"]))

    @handles(Engine)
    def on_engine(self, engine: Engine) -> SomeTasks:
        return [tasks.event("go", [engine.throttle])]

    @handles(event="go")
    def on_go(self, task: Task) -> None:
        self.log.info("%s", task.val_list)


class Long(Endpoint):
    def __init__(self, factory: EndpointFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.task_handlers = {(TaskType.process_data, "radar"): self.on_radar}

    def on_radar(self, task: Task, task_id: TaskId) -> SomeTasks:
        return None if self.get_page("radar") is None else tasks.finish("done")


class LongFactory(EndpointFactory):
    def get(self, parent: NodeApi) -> Long:
        return Long(self, parent, "long")


class Beat(Loop):
    max_tick_rate_hz = 10

    def loop(self) -> SomeTasks:
        return self.store_data_task("beat", self.get_time_s())


def factories(robot: RobotInfo) -> list[EndpointFactory | LoopFactory]:
    return [Gentle.factory(hover=0.3), LongFactory(), Beat.factory()]
"""


@pytest.mark.nightly
def test_annotated_program_has_no_error_under_plain_strict(tmp_path: Path) -> None:
    (tmp_path / "annotated.py").write_text(ANNOTATED)
    words = ["--strict", "--config-file=", f"--cache-dir={tmp_path / 'cache'}", str(tmp_path / "annotated.py")]
    out, err, status = api.run(words)
    assert (out.partition(":")[0], err, status) == ("Success", "", 0), out


@pytest.fixture(scope="session")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("programs")
    write_programs(folder)
    return folder


@pytest.mark.nightly
@pytest.mark.parametrize("part", [".", *STARTERS])
def test_program_has_no_error_under_strict(programs: Path, part: str, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = programs / part.replace("/starter", "")
    monkeypatch.setenv("MYPYPATH", f"{folder}:{programs / 'robots'}")
    out, err, status = api.run([*OPTIONS, f"--cache-dir={programs / 'cache'}", *map(str, folder.glob("*.py"))])
    assert (out.partition(":")[0], err, status) == ("Success", "", 0), out
