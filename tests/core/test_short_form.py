"""`@handles`, `Class.factory(...)` and `@page`: the short forms do exactly what the long ones do."""

import subprocess
import sys
from enum import StrEnum
from pathlib import Path
from textwrap import dedent
from typing import Annotated, Any, ClassVar, Protocol

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim import (
    Config,
    Endpoint,
    EndpointFactory,
    ListReplayerFactory,
    Loop,
    LoopFactory,
    Node,
    SimClock,
    SimRunner,
    Task,
    TaskType,
    handles,
    page,
    tasks,
)
from snr_sim.core.component import from_page, to_page
from snr_sim.core.lockstep import LockStep
from snr_sim.prelude.errors import ComponentFailedError, ConfigError, TaskError
from snr_sim.recording.reader import read_trace
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.program import program_header

READINGS = [{"altitude_m": 100.0 - i, "velocity_mps": -1.0} for i in range(5)]


@page("engine")
class Engine(msgspec.Struct):
    throttle: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]


@page("radar")
class Radar(msgspec.Struct):
    altitude_m: float
    velocity_mps: float


class LongFactory(EndpointFactory):
    def __init__(self, hover: float) -> None:
        super().__init__()
        self.hover = hover

    def get(self, parent: Any) -> Endpoint:
        return Long(self, parent, "pilot")


class Long(Endpoint):
    factory: LongFactory

    def __init__(self, factory: LongFactory, parent: Any, name: str) -> None:
        super().__init__(factory, parent, name)
        self.task_handlers = {
            (TaskType.process_data, "radar"): self.on_radar,
            (TaskType.event, "go"): self.on_go,
        }

    def on_radar(self, task: Task, task_id: Any) -> Any:
        radar = self.get_data("radar")
        if radar["altitude_m"] == 98.0:
            return tasks.event("go", [0.75])
        return self.store_data_task("engine", {"throttle": self.factory.hover})

    def on_go(self, task: Task, task_id: Any) -> Any:
        return self.store_data_task("engine", {"throttle": task.val_list[0]})


class Short(Endpoint):
    hover = 0.1

    @handles("radar")
    def on_radar(self, radar: dict[str, float]) -> Any:
        if radar["altitude_m"] == 98.0:
            return tasks.event("go", [0.75])
        return self.store_data_task("engine", {"throttle": self.hover})

    @handles(event="go")
    def on_go(self, task: Task) -> Any:
        return self.store_data_task("engine", {"throttle": task.val_list[0]})


class Typed(Endpoint):
    hover = 0.1

    @handles(Radar)
    def on_radar(self, radar: Radar) -> Any:
        if radar.altitude_m == 98.0:
            return tasks.event("go", [0.75])
        return self.store_data_task("engine", Engine(throttle=self.hover))

    @handles(event="go")
    def on_go(self, task: Task) -> Any:
        return self.store_data_task("engine", Engine(throttle=task.val_list[0]))


class Clock(Loop):
    start = 0

    def setup(self) -> None:
        self.count = self.start

    def loop(self) -> None:
        self.count += 1
        self.store_data("count", self.count)


class ClockFactory(LoopFactory):
    def get(self, parent: Any) -> Loop:
        clock = Clock(self, parent, "clock", 20.0)
        clock.start = 7
        return clock


def trace_of(folder: Path, *factories: Any) -> bytes:
    folder.mkdir()
    clock = SimClock()
    config = Config(factories={"r": [ListReplayerFactory(READINGS, "radar"), *factories]})
    writer = TraceWriter(folder / FILE_NAME, program_header(["r"], config, __file__, clock))
    try:
        SimRunner(config, clock=clock, recorder=writer, until_s=1.0).run()
    finally:
        writer.close()
    return b"".join((folder / FILE_NAME).read_bytes().splitlines(keepends=True)[2:])  # without the time of day


@pytest.mark.parametrize("kind", [Short, Typed])
def test_short_form_leaves_the_trace_of_the_long_form(tmp_path: Path, kind: Any) -> None:
    long = trace_of(tmp_path / "long", LongFactory(0.3), ClockFactory())
    short = trace_of(
        tmp_path / "short", kind.factory("pilot", hover=0.3), Clock.factory(max_tick_rate_hz=20.0, start=7)
    )
    assert short == long
    assert long.count(b'"throttle":') > 4


def run(*factories: Any, until_s: float = 1.0) -> Node:
    clock = SimClock()
    node = Node("r", Config(factories={"r": [ListReplayerFactory(READINGS, "radar"), *factories]}), clock=clock)
    LockStep([node], clock, until_s=until_s).run()
    return node


def test_handler_with_task_gets_the_task() -> None:
    class Whole(Endpoint):
        seen: ClassVar[list[Task]] = []

        @handles("radar", task=True)
        def on_radar(self, task: Task) -> None:
            self.seen.append(task)

    run(Whole.factory())
    assert [one.page.data for one in Whole.seen if one.page is not None] == READINGS


def test_two_decorators_make_one_method_the_handler_of_both() -> None:
    class Both(Endpoint):
        @handles("radar")
        @handles(event="again")
        def on_any(self, what: Any) -> Any:
            if isinstance(what, Task):
                return self.store_data_task("again", what.val_list)
            return tasks.event("again", [what["altitude_m"]])

    assert run(Both.factory()).get_data("again") == [96.0]


def test_overriding_method_is_called_without_a_decorator_of_its_own() -> None:
    class Base(Endpoint):
        @handles("radar")
        def on_radar(self, radar: Any) -> Any:
            return self.store_data_task("out", "base")

    class Own(Base):
        def on_radar(self, radar: Any) -> Any:
            return self.store_data_task("out", "own")

    class Other(Base):
        @handles("radar")
        def on_other(self, radar: Any) -> Any:
            return self.store_data_task("out", "other")

    class Elsewhere(Base):
        @handles(event="go")
        def on_radar(self, radar: Any) -> Any:
            return self.store_data_task("out", "elsewhere")

    assert [run(kind.factory()).get_data("out") for kind in (Base, Own, Other, Elsewhere)] == [
        "base",
        "own",
        "other",
        None,
    ]


def test_handlers_of_table_and_decorator_are_both_called() -> None:
    class Mixed(Endpoint):
        def __init__(self, factory: Any, parent: Any, name: str) -> None:
            super().__init__(factory, parent, name)
            self.task_handlers = {(TaskType.event, "go"): self.on_go}

        @handles("radar")
        def on_radar(self, radar: Any) -> Any:
            return tasks.event("go")

        def on_go(self, task: Task, task_id: Any) -> Any:
            return self.store_data_task("out", 1)

    assert run(Mixed.factory()).get_data("out") == 1


def test_task_handled_by_table_and_decorator_raises_config_error() -> None:
    class Twice(Short):
        def __init__(self, factory: Any, parent: Any, name: str) -> None:
            super().__init__(factory, parent, name)
            self.task_handlers = {(TaskType.process_data, "radar"): self.by_hand}

        def by_hand(self, task: Task, task_id: Any) -> None: ...

    with pytest.raises(ConfigError, match="'twice' handles process_data 'radar' twice"):
        run(Twice.factory())


def test_task_handled_by_two_methods_raises_config_error() -> None:
    with pytest.raises(ConfigError, match="Two handles event 'go' twice: in on_one and in on_two"):

        class Two(Endpoint):
            @handles(event="go")
            def on_one(self, task: Task) -> None: ...

            @handles(event="go")
            def on_two(self, task: Task) -> None: ...


class Decorate(Protocol):
    def __call__(self) -> Any: ...


def _without_brackets() -> Any:
    @handles  # type: ignore[arg-type]
    def on_radar(self: Any, radar: Any) -> None: ...


def _two_arguments() -> Any:
    @handles("radar")
    def on_radar(self: Any, task: Any, task_id: Any) -> None: ...


def _no_argument() -> Any:
    @handles(event="go")
    def on_go(self: Any) -> None: ...


def _generator() -> Any:
    @handles("radar")
    def on_radar(self: Any, radar: Any) -> Any:
        yield 1


@pytest.mark.parametrize(
    ("decorate", "message"),
    [
        (_without_brackets, r"@handles above on_radar does not name"),
        (lambda: handles(), "neither a page nor an event"),
        (lambda: handles("radar", event="go"), "a page and an event"),
        (lambda: handles(3), "3 is neither the key of a page nor a class"),  # type: ignore[arg-type]
        (lambda: handles(dict), "dict is neither the key of a page nor a class that declares one"),
        (lambda: handles(event=3), "an event's name is text"),  # type: ignore[arg-type]
        (lambda: handles(None, "radar"), r"@handles\(None, 'radar'\) does not name one page"),  # type: ignore[arg-type]
        (lambda: handles(3, 4), r"@handles\(3, 4\) does not name one page"),  # type: ignore[arg-type]
        (lambda: handles([]), r"@handles\(\[\]\) does not name one page"),  # type: ignore[arg-type]
        (_two_arguments, r"on_radar, the handler of process_data 'radar', takes \(self.*called with \(self, data\)"),
        (_no_argument, r"def on_go\(self, task\)"),
        (_generator, "is a generator function"),
    ],
)
def test_wrong_decorator_raises_config_error(decorate: Decorate, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        decorate()


def test_decorated_method_of_a_loop_raises_config_error() -> None:
    class Wrong(Loop):
        @handles("radar")
        def on_radar(self, radar: Any) -> None: ...

        def loop(self) -> None: ...

    with pytest.raises(ConfigError, match="Loop 'wrong' of role 'r' registers handlers"):
        run(Wrong.factory())


# Factories


def test_name_is_that_of_the_class_unless_given() -> None:
    class DepthHold2(Endpoint): ...

    node = run(DepthHold2.factory(), DepthHold2.factory("other"))
    assert list(node.components)[-3:-1] == ["depth_hold2", "other"] or {"depth_hold2", "other"} <= set(node.components)


def test_settings_are_attributes_before_the_rest_of_init_and_parameters_of_init() -> None:
    class Mixed(Endpoint):
        gain: float
        limit = 2.0

        def __init__(self, factory: Any, parent: Any, name: str, offset: float, scale: float = 1.0) -> None:
            super().__init__(factory, parent, name)
            self.all = [self.gain, self.limit, offset, scale]

    node = run(Mixed.factory(gain=3.0, offset=4.0), Mixed.factory("second", gain=1.0, limit=5.0, offset=0.0, scale=7.0))
    assert node.components["mixed"].all == [3.0, 2.0, 4.0, 1.0]  # type: ignore[attr-defined]
    assert node.components["second"].all == [1.0, 5.0, 0.0, 7.0]  # type: ignore[attr-defined]
    assert Mixed.limit == 2.0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Short.factory(hovr=0.3), "Short has no setting 'hovr'.*\n.*'hover'"),
        (lambda: Short.factory(on_radar=3), "Short has no setting 'on_radar'"),
        (lambda: Short.factory(task_handlers={}), "Short has no setting 'task_handlers'"),
        (lambda: Short.factory(0.3), "is given 0.3 as the component's name"),
        (lambda: Needs.factory(), r"Needs.factory\(\) needs offset"),
    ],
)
def test_wrong_setting_raises_config_error(make: Decorate, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        make()


class Needs(Endpoint):
    def __init__(self, factory: Any, parent: Any, name: str, offset: float) -> None:
        super().__init__(factory, parent, name)


def test_class_in_place_of_its_factory_raises_config_error() -> None:
    with pytest.raises(ConfigError, match=r"lists the class Short where a factory belongs.\n  Try: Short.factory\(\)"):
        run(Short)


def test_factory_of_the_long_form_has_any_attributes() -> None:
    class OwnFactory(EndpointFactory):
        settings: ClassVar[Any] = [1, 2]
        component_class = component_name = init_settings = "mine"

        def get(self, parent: Any) -> Endpoint:
            return Short(self, parent, "own")

    node = run(OwnFactory())
    assert vars(node.components["own"]).keys().isdisjoint({"settings", "component_name"})


def test_negative_rate_as_setting_raises() -> None:
    with pytest.raises(Exception, match="max_tick_rate_hz=-1"):
        run(Clock.factory(max_tick_rate_hz=-1))


# Pages


def test_key_may_be_of_a_subclass_of_str() -> None:
    class Key(StrEnum):
        radar = "radar"

    class Reader(Endpoint):
        @handles(Key.radar)
        def on_radar(self, radar: Any) -> Any:
            return self.store_data_task("out", self.get_data(Key.radar) == radar)

    assert run(Reader.factory()).get_data("out") is True


def test_declared_page_holds_a_dict_and_is_read_as_its_class() -> None:
    seen: list[Any] = []

    class Reader(Endpoint):
        @handles("engine")
        def on_engine(self, engine: Any) -> None:
            seen.append((engine, self.get_data("engine"), self.get_data(Engine)))

    run(Typed.factory(hover=1), Reader.factory())
    assert seen[0] == ({"throttle": 1.0}, {"throttle": 1.0}, Engine(1.0))
    assert type(seen[0][0]["throttle"]) is float


def test_get_data_of_never_stored_page_returns_none() -> None:
    class Reader(Endpoint):
        @handles("radar")
        def on_radar(self, radar: Any) -> Any:
            return self.store_data_task("out", self.get_data(Engine) is None)

    assert run(Reader.factory()).get_data("out") is True


def test_stored_object_that_does_not_fit_names_line_page_and_field() -> None:
    with pytest.raises(
        ComponentFailedError, match=r"test_short_form.py, line(.|\n)*Page 'engine' is given a Engine that is"
    ):
        run(Typed.factory(hover=1.5))


def test_page_that_does_not_fit_its_class_names_page_and_field() -> None:
    @page("radar")
    class Other(msgspec.Struct):
        range_m: float

    class Reader(Endpoint):
        @handles(Other)
        def on_radar(self, radar: Other) -> None: ...

    with pytest.raises(ComponentFailedError, match=r"Page 'radar' does not fit Other: .*`range_m`"):
        run(Reader.factory())


def test_object_stored_under_another_key_raises_task_error() -> None:
    with pytest.raises(TaskError, match="Page 'motor' is given a Engine, which is declared as page 'engine'"):
        to_page("motor", Engine(0.1))


def test_page_above_non_struct_class_raises_config_error() -> None:
    with pytest.raises(ConfigError, match=r"is on Plain, which is not a msgspec\.Struct"):

        @page("x")  # type: ignore[type-var]
        class Plain: ...

    with pytest.raises(ConfigError, match="instead of the key"):
        page(Engine)  # type: ignore[arg-type]


class Inner(msgspec.Struct):
    values: list[float]


@page("nested")
class Nested(msgspec.Struct):
    inner: list[Inner]
    by_name: dict[str, int]
    array: np.ndarray[Any, Any]
    name: str = "x"


@given(
    st.lists(st.lists(st.floats(allow_nan=False), max_size=3), max_size=3),
    st.dictionaries(st.text(), st.integers(-(2**40), 2**40), max_size=3),
    st.text(),
)
def test_object_to_page_and_back_is_equal(inner: list[list[float]], by_name: dict[str, int], name: str) -> None:
    before = Nested([Inner(one) for one in inner], by_name, np.arange(3), name)
    data = to_page("nested", before)
    after = from_page(Nested, data)
    assert np.array_equal(before.array, after.array)
    after.array = before.array
    assert after == before


def test_numpy_numbers_are_numbers_in_a_declared_page() -> None:
    assert to_page("engine", Engine(np.float64(0.5))) == {"throttle": 0.5}
    assert from_page(Radar, {"altitude_m": np.float32(0.5), "velocity_mps": np.int64(3)}) == Radar(0.5, 3.0)


def test_replay_of_declared_pages_is_identical(tmp_path: Path) -> None:
    trace_of(tmp_path / "run", Typed.factory("pilot", hover=0.3))
    trace = read_trace(tmp_path / "run" / FILE_NAME)
    config = Config(factories={"r": [ListReplayerFactory(READINGS, "radar"), Typed.factory("pilot", hover=0.3)]})
    assert replay_node(trace, "r", config).is_identical


# Reload, processes, the command line

RELOADED = """
    from snr_sim import Endpoint, handles

    class Pilot(Endpoint):
        gain = 1
        made = 0

        @handles(event="move")
        def on_move(self, task):
            self.factory.calls = getattr(self.factory, "calls", 0) + 1
            return self.store_data_task("thrust", [GAIN * self.gain, self.factory.calls])

    GAIN = 1
"""


def test_reload_keeps_settings_and_state_of_the_factory_and_takes_the_new_class(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    file = tmp_path / "short_pilot.py"
    file.write_text(dedent(RELOADED))
    import importlib

    module = importlib.import_module("short_pilot")
    try:
        clock = SimClock()
        node = Node("r", Config(factories={"r": [module.Pilot.factory(gain=5)]}), clock=clock)
        seen: list[Any] = []

        def step(source: str, inputs: list[Task]) -> Any:
            def work() -> None:
                file.write_text(dedent(source))
                node.enqueue_input(inputs, "keyboard")

            return work

        changed = RELOADED.replace("GAIN = 1", "GAIN = 10").replace("gain = 1", "gain = 2")
        broken = changed.replace("class Pilot", "class Pilto")
        move, reload = tasks.event("move"), tasks.reload_component("pilot")
        for i, (source, inputs) in enumerate(
            [(RELOADED, [move]), (changed, [reload, move]), (broken, [reload, move]), (RELOADED, [reload, move])], 1
        ):
            clock.call_at(float(i), step(source, inputs))
        node.datastore.listeners.setdefault("thrust", []).append(lambda page: seen.append(page.data))  # type: ignore[attr-defined]
        LockStep([node], clock).run()
        assert seen == [[5, 1], [50, 2], [50, 3], [5, 4]]
    finally:
        del sys.modules["short_pilot"]


PROGRAM = """
    import os
    import sys
    from snr_sim import CliRunner, Config, Endpoint, Loop, handles, tasks

    class Worker(Loop):
        executor = "process"
        max_tick_rate_hz = 50
        first = 0

        def loop(self):
            self.store_data("work", [self.first, os.getpid()])

    class Listener(Endpoint):
        @handles("work")
        def on_work(self, work):
            print(work[0], work[1] != os.getpid())
            return tasks.terminate("done")

    if __name__ == "__main__":
        CliRunner(Config(factories={"robot": [Worker.factory(first=3), Listener.factory()]})).run()
"""


@pytest.mark.slow
@pytest.mark.parametrize("words", [[], ["robot"]])
def test_program_of_one_role_runs_without_naming_it_with_a_loop_in_a_process(tmp_path: Path, words: list[str]) -> None:
    file = tmp_path / "robot.py"
    file.write_text(dedent(PROGRAM))
    ended = subprocess.run([sys.executable, file, *words], capture_output=True, text=True, timeout=60, cwd=tmp_path)
    assert (ended.stdout, ended.returncode) == ("3 True\n", 0), ended.stderr
