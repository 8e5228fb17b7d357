"""Random programs of several nodes that reload, add, remove and fail: each recorded run must replay identically.

A program is a list of statements for each handler and loop. Statements that bring further tasks are limited by
`spend`, which counts in the node, as a component that counts in itself would begin again with each reload.
"""

from dataclasses import dataclass

from hypothesis import strategies as st

KEYS = ("alpha", "beta", "gamma", "far")
EVENTS = ("go", "stop", "turn")
NAMES = ("one", "two", "three", "beat", "worker", "extra", "all", "nothing")

HEAD = """
import msgspec
import numpy as np

from pathlib import Path

from snr_sim import Config, Endpoint, Loop, SimClock, TaskType, TimeoutLoopFactory, handles, page, tasks
from snr_sim.core.interrupts import interrupt_new_code
from snr_sim.links import LinkFaults, SocketsPair

GAIN = 1


@page("typed")
class Typed(msgspec.Struct):
    count: int
    name: str = "x"


class Parts:
    def spend(self):
        if isinstance(self, Loop):  # a replay has none
            return self.factory.total < 100
        spent = vars(self.parent).setdefault("spent_by_test", [0])
        spent[0] += 1
        return spent[0] < 300

    def bump(self):
        self.count = getattr(self, "count", 0) + 1
        self.factory.total = getattr(self.factory, "total", 0) + 1
        return self.count
"""

# {key}, {other}, {event}, {name}, {n}: drawn for each statement.
HARMLESS = (
    "self.schedule(tasks.event({event!r}))",
    "out.append(self.store_data_task({key!r}, [self.count, GAIN, self.factory.total]))",
    "out.append(self.store_data_task({key!r}, {{'seen': size(self.get_data({other!r})), 't': self.get_time_s()}}))",
    "out.append(self.store_data_task({key!r}, float(self.rng.normal())))",
    "out.append(self.store_data_task({key!r}, self.rng.random(3)))",
    "out.append(self.store_data_task({key!r}, np.arange(self.count % 4)))",
    "out.append(self.store_data_task({key!r}, [float('nan'), float('inf'), -0.0, None, True, 2**62, 'ä\\u2028']))",
    "out.append(self.store_data_task({key!r}, (1, [2, (3,)], {{'a': {{}}}})))",
    "out.append(self.store_data_task('typed', Typed(self.count)))",
    "out.append(self.store_data_task({key!r}, size(self.get_data(Typed)), process=False))",
    "self.store_data({key!r}, size(self.get_data({other!r} + '_prev')))",
    "out.append(tasks.event({event!r}, [self.count, {other!r}]))",
    "out.append(tasks.process_data({key!r}))",
    "out.append(self.store_data_task({key!r}, about(self.get_page({other!r}))))",
    "out.append(self.store_data_task({key!r}, self.get_age_s({other!r})))",
    "print('said', self.count)",
    "self.log.info('logged %d', self.count)",
    "self.keep = self.get_data({other!r})",
    "self.keep.append(self.count) if isinstance(getattr(self, 'keep', None), list) else None",
    "out.append(self.store_data_task({key!r}, self.keep)) if 0 < size(getattr(self, 'keep', '')) < 200 else None",
)
CHANGES = (
    "out.append(tasks.reload_component({name!r}))",
    "out.append(tasks.reload_component('one', {name!r}))",
    "out.append(tasks.remove_component({name!r}))",
    "out.append(tasks.add_component(Extra.factory()))",
    "out.append(tasks.add_component(More.factory()))",
    "out.append(tasks.add_component(Extra.factory('extra {n}'), False))",
    "out.append(tasks.terminate('done')) if self.count == {n} else None",
    "out.append(tasks.finish('finished')) if self.count == {n} else None",
    "out.append(1 / (self.count - {n}) and None)",
)
TABLES = (
    "self.task_handlers[(TaskType.event, {event!r})] = self.other",
    "self.task_handlers.pop((TaskType.event, {event!r}), None)",
    "self.task_handlers[(TaskType.process_data, {key!r})] = self.other",
    "self.task_handlers[TaskType.event] = self.other",
    "self.task_handlers = {{(TaskType.event, {event!r}): self.other}}",
    "out.append(task) if task is not None and self.count % 3 == 0 else None",
    "out.append(self.store_data_task({key!r}, size(getattr(task, 'val_list', None))))",
)
EDITS = (
    "edit('GAIN = 1', 'GAIN = {n}')",
    "edit('# spare', 'self.missing()')",
    "edit('# first', 'hang(self)')",
    "edit('# spare', 'self.store_data(\"alpha\", \"poison\")')",
    "edit('# spare', 'self.store_data(\"far\", 2**70)')",
    "edit('# spare', 'self.schedule(tasks.event(5))')",
    "edit('# spare', 'not isinstance(self, Loop) and self.schedule(tasks.add_component(Extra.factory(\"late\")))')",
    "edit('# spare', 'self.rng.random()')",
    "edit('GAIN = 1', 'GAIN =')",
    "edit('GAIN = 1', 'GAIN = 1 / 0')",
    "edit('class Extra', 'class Other')",
)
RELOADS = 2 * (EDITS + 2 * CHANGES[:3])
HELPERS = """
def size(value):
    return len(repr(value))


def about(one):
    return [one.key, one.origin, one.created_at_s, one.process, size(one.data)] if one is not None else None


def hang(component):
    while interrupt_new_code(component.parent, "It has not returned."):
        component.bump()
        component.store_data("beta", "dropped")


def edit(old, new):
    first = Path(__file__).with_name("first.txt").read_text()
    Path(__file__).write_text(first.replace(old, new))
"""


@st.composite
def statements(draw: st.DrawFn, choices: tuple[str, ...], max_count: int = 4) -> list[str]:
    """Draw statements."""
    return [
        draw(st.sampled_from(choices)).format(
            key=draw(st.sampled_from(KEYS)),
            other=draw(st.sampled_from(KEYS)),
            event=draw(st.sampled_from(EVENTS)),
            name=draw(st.sampled_from(NAMES)),
            n=draw(st.integers(2, 9)),
        )
        for _ in range(draw(st.integers(0, max_count)))
    ]


def method(head: str, body: list[str], spends: bool = True) -> str:
    lines = [f"    def {head}:", "        # first", "        self.bump()", "        out = []"]
    if spends:
        lines += ["        if not self.spend():", "            return None"]
    lines += [f"        {line}" for line in body]
    lines += ["        # spare", "        return [one for one in out if one is not None]"]
    return "\n".join(lines) + "\n"


@st.composite
def endpoint(draw: st.DrawFn, name: str, choices: tuple[str, ...]) -> str:
    key, event = draw(st.sampled_from(KEYS)), draw(st.sampled_from(EVENTS))
    parts = [f"class {name}(Parts, Endpoint):"]
    if draw(st.booleans()):
        parts.append(method("begin(self)", draw(statements(HARMLESS, 2))))
    parts.append(f'    @handles("{key}")')
    fails = ["type(data) is str and data == 'poison' and 1 / 0"] if draw(st.booleans()) else []
    parts.append(method("on_page(self, data, task=None)", fails + draw(statements(choices))))
    parts.append(f'    @handles(event="{event}")')
    parts.append(method("on_event(self, task)", draw(statements(choices))))
    parts.append(method("other(self, task, task_id)", draw(statements(choices, 2))))
    if draw(st.booleans()):
        parts.append(method("halt(self)", ["self.factory.halted = True"], spends=False).rsplit("        return", 1)[0])
    return "\n".join(parts)


@st.composite
def loop(draw: st.DrawFn, name: str, choices: tuple[str, ...], executor: str = "thread") -> str:
    rate = draw(st.sampled_from([0.5, 1.0, 3.0, 7.0, 10.0]))
    wakes = draw(st.sampled_from(["()", "('alpha',)", "('far', 'beta')"]))
    body = draw(statements(choices, 5))
    body = [f"if self.count % {draw(st.integers(1, 4))} == 0: {line}" for line in body]
    head = [f"class {name}(Parts, Loop):", f"    max_tick_rate_hz = {rate}", f"    wakes_on = {wakes}"]
    head.append(f"    executor = {executor!r}")
    if draw(st.booleans()):
        head.append(method("setup(self)", ["out.append(self.store_data_task('alpha', 0))"], spends=False))
    return "\n".join([*head, method("loop(self)", body)])


@dataclass
class Program:
    """The text of a program and how to run it; on the wall clock it ends by itself."""

    text: str
    seed: int
    until_s: float
    is_in_lock_step: bool = True


@st.composite
def programs(draw: st.DrawFn) -> Program:
    """Draw a program of one to three roles, with links between the first two if there are several."""
    roles = ["r", "s", "t"][: draw(st.integers(1, 3))]
    choices = HARMLESS + TABLES + draw(st.sampled_from([(), CHANGES, CHANGES[:6], CHANGES[6:]]))
    ticks = HARMLESS[:6] + RELOADS + draw(st.sampled_from([(), HARMLESS, CHANGES[6:]]))
    classes, factories = [], []
    for role in roles:
        names = ["One", "Two", "Three"][: draw(st.integers(1, 3))]
        classes += [draw(endpoint(f"{name}_{role}", choices)) for name in names]
        classes.append(draw(loop(f"Beat_{role}", ticks)))
        made = [f"{name}_{role}.factory('{name.lower()}')" for name in names]
        place = draw(st.integers(0, len(made)))
        made.insert(place, f"Beat_{role}.factory('beat')")
        factories.append(made)
    classes.append(draw(endpoint("Extra", choices)))
    classes.append(draw(loop("More", HARMLESS)))
    link = ""
    if len(roles) > 1:
        faults = draw(
            st.sampled_from(
                ["None", "LinkFaults(loss=0.2, jitter_s=0.1)", "LinkFaults(duplication=0.3, latency_s=0.4)"]
            )
        )
        link = f'pair = SocketsPair(("127.0.0.1", 9), name="wire", faults={faults})\n'
        factories[0].append("pair.server(['far', 'alpha'])")
        for made in factories[1:]:
            made.append("pair.client(['far', 'beta'])")
    config = ", ".join(f"'{role}': [{', '.join(made)}]" for role, made in zip(roles, factories, strict=True))
    text = f"{HEAD}\n{HELPERS}\n" + "\n\n".join(classes) + f"\n\n{link}config = Config(factories={{{config}}})\n"
    return Program(text, draw(st.integers(0, 5)), draw(st.sampled_from([1.0, 3.0, 6.0])))


@st.composite
def programs_with_processes(draw: st.DrawFn) -> Program:
    """Draw a program of one role on the wall clock, with a loop on a thread and one in a process."""
    choices = HARMLESS + TABLES + draw(st.sampled_from([(), CHANGES[:6]]))
    classes = [draw(endpoint(name, choices)) for name in ("One", "Two", "Extra")]
    classes += [draw(loop("Beat", HARMLESS[:6] + RELOADS)), draw(loop("More", HARMLESS))]
    classes.append(draw(loop("Worker", HARMLESS, "process")))
    made = ["One.factory('one')", "Two.factory('two')", "Beat.factory('beat')", "Worker.factory('worker')"]
    until_s = draw(st.sampled_from([0.7, 1.5]))  # a process takes most of that to start
    made.append(f"TimeoutLoopFactory(seconds={until_s})")
    config = f"config = Config(factories={{'r': [{', '.join(made)}]}})"
    text = "\n\n".join([HEAD, HELPERS, *classes, config])
    return Program(text + "\n", draw(st.integers(0, 5)), until_s, is_in_lock_step=False)
