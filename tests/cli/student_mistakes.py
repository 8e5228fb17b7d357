# ruff: noqa: E501 (a table: a line a mistake)
"""The table of students' mistakes: each is a small change of a controller in the long form (docs/components.md) or the short one, or a command line.

Each message must state, for one point each: the student's own line; the class, handler, page or argument; what was
expected; what was found; the fix. A sixth point is for at most six lines. `test_student_mistakes.py` scores them.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

_PAGE = (Path(__file__).parents[2] / "docs" / "components.md").read_text()
GENTLE = re.findall(r"```python\n(.*?)```", _PAGE.partition("## The long form")[2], re.DOTALL)[0]

Change = Callable[[str], str]
RUN = ("run", "lander_vertical", "--controller", "./gentle.py")
COMMAND = 'return self.store_data_task("engine", {"throttle": min(max(throttle, 0.0), 1.0)})'
RADAR = '        radar = self.get_data("radar")\n'
HANDLERS = '{(TaskType.process_data, "radar"): self.on_radar}'


@dataclass(frozen=True)
class Mistake:
    """One mistake, and what its message must state.

    Args:
        number: in the list in which it was first tried.
        what: the student did.
        patterns: of line, name, what was expected, what was found, the fix; "" if there is none.
        files: changes by file; gentle.py is that of the page, others are initially empty.
        words: of the command line.
        then: words of a second command line; {run} is the run folder.
        is_before: whether it is reported before there is a run.
        elsewhere: the test that covers it, if it needs its own process, port or disk.
        is_slow: whether it takes seconds.
    """

    number: int
    what: str
    patterns: tuple[str, str, str, str, str]
    files: Mapping[str, Change] = field(default_factory=dict)
    words: tuple[str, ...] = RUN
    then: tuple[str, ...] = ()
    is_before: bool = True
    elsewhere: str = ""
    is_slow: bool = False


def put(*changes: str) -> dict[str, Change]:
    """Return changes of the controller: an old text, the new one, and so on; each old one must be there."""

    def change(text: str) -> str:
        for old, new in zip(changes[::2], changes[1::2], strict=True):
            assert old in text, old
            text = text.replace(old, new)
        return text

    return {"gentle.py": change}


def holds(text: str) -> Change:
    """Return a change that writes a whole file."""
    return lambda before: text


TRACKER = """\
from snr_sim import Endpoint, handles


class Tracker(Endpoint):
    @handles("plan")
    def on_plan(self, plan):
        self.goal_m = plan["goal_m"]
"""
PLAN = 'self.store_data("plan", {"goal_m": 0.0})'


def with_tracker(changes: dict[str, Change]) -> dict[str, Change]:
    """Return changes of a controller which also stores a page for a component in another file."""
    names = (
        "[GentleFactory()]",
        "[GentleFactory(), Tracker.factory()]",
        "from snr_sim",
        "from tracker import Tracker\nfrom snr_sim",
    )
    plan = put(RADAR, f"{RADAR}        {PLAN}\n", *names)["gentle.py"]
    return {"tracker.py": holds(TRACKER), "gentle.py": lambda text: changes["gentle.py"](plan(text))}


def in_flight(old: str, new: str) -> dict[str, Change]:
    """Return changes by which the controller saves another version of itself 20 s into the run."""
    edit = f"""        if self.get_time_s() > 20.0 and "saved" not in vars(self.factory):
            path = __import__("pathlib").Path(__file__)
            self.factory.saved = True
            path.write_text({new!r}.join(path.read_text().rsplit({old!r}, 1)))
"""
    return put(RADAR, edit + RADAR)


SHORT = """\
import msgspec

from snr_sim import Endpoint, handles, page


@page("engine")
class Engine(msgspec.Struct):
    throttle: float


class Gentle(Endpoint):
    hover = 0.28

    @handles("radar")
    def on_radar(self, radar):
        target_mps = -1.0 - 0.05 * radar["altitude_m"]
        throttle = self.hover + 0.1 * (target_mps - radar["velocity_mps"])
        return self.store_data_task("engine", Engine(min(max(throttle, 0.0), 1.0)))


def factories(robot):
    return [Gentle.factory(hover=0.28)]
"""


def short(*changes: str) -> dict[str, Change]:
    """Return changes of the controller in the short form, as `put`."""
    return {"gentle.py": lambda before: put(*changes)["gentle.py"](SHORT)}


def beat(body: str) -> dict[str, Change]:
    """Return a change that adds a Loop with this body."""
    new = f"class Beat(Loop):\n{body}\n\ndef factories"
    names = (
        "[Gentle.factory(hover=0.28)]",
        "[Gentle.factory(hover=0.28), Beat.factory()]",
        "import Endpoint,",
        "import Endpoint, Loop,",
    )
    return short("def factories", new, *names)


def latin(before: str) -> str:
    """Return a text that is written as Latin-1."""
    return "# caf\udce9\n" + before


WATCHED = (*RUN, "--speed", "1000", "--watch")
MISTAKES = [
    Mistake(1, "handler of page 'rader'", ("line 12: ", "page 'rader'", "Stored are: .*radar", "'rader'", "did you mean 'radar'"),
            put('"radar")', '"rader")')),
    Mistake(3, "field 'altitude_n'", ("line 16: ", "page 'radar'", "altitude_m, stamp_s, velocity_mps", "'altitude_n'", "did you mean 'altitude_m'"),
            put("altitude_m", "altitude_n")),
    Mistake(4, "command page 'enigne'", ("line 18: ", "page 'enigne'", "take: engine", "'enigne'", "did you mean 'engine'"),
            put('"engine"', '"enigne"')),
    Mistake(5, "command field 'throtle'", ("line 18: ", "'engine'", "One of: attitude, gimbal_rad, throttle", "'throtle'", "did you mean 'throttle'"),
            put('"throttle"', '"throtle"')),
    Mistake(7, "NaN as a command", ("line 18: ", "'engine'", "from 0 to 1", "throttle = nan", "store what is from"),
            put(COMMAND, COMMAND.replace("min(max(throttle, 0.0), 1.0)", 'float("nan")'))),
    Mistake(8, "a text for a number", ("line 18: ", "'engine'", "must be a number from 0 to 1", "the text 'half'", "store a dict"),
            put(COMMAND, COMMAND.replace("min(max(throttle, 0.0), 1.0)", '"half"'))),
    Mistake(9, "super().__init__ forgotten", ("line 11: ", "Gentle sets task_handlers", "before it has called", "sets task_handlers", r"super\(\).__init__\("),
            put("        super().__init__(factory, parent, name)\n", "")),
    Mistake(11, "time.sleep in a handler", ("line ", "on_radar", "2 s|return", "sleep|not returned", "Try: "),
            put(RADAR, "        __import__('time').sleep(60.0)\n" + RADAR), is_before=False,
            elsewhere="tests/core/test_watchdog.py::test_repeatedly_sleeping_handler_is_reported_once_with_line"),
    Mistake(12, "handler without task_id", ("line 12: ", "gentle.on_radar", r"called with \(task, task_id\)", r"takes \(task\)", r"def on_radar\(self, task, task_id\)"),
            put("on_radar(self, task, task_id)", "on_radar(self, task)")),
    Mistake(13, "a handler that is called where it is named", ("line 12: ", r"on_radar\(\)", "self.on_radar, not", "missing 2 required", "leave out the brackets"),
            put(HANDLERS, HANDLERS.replace("on_radar", "on_radar()"))),
    Mistake(15, "no factories()", ("gentle.py", "`factories`", "a controller needs", "has no", r"def factories\(robot\)"),
            {"gentle.py": lambda text: text[: text.index("def factories")]}),
    Mistake(16, "factories() gives no list", ("line 21: ", r"factories\(robot\)", "not a list", "GentleFactory object", r"return \["),
            put("[GentleFactory()]", "GentleFactory()")),
    Mistake(17, "factories() gives a class", ("line 21: ", r"factories\(robot\)", "not a factory", "the class GentleFactory", "with the brackets"),
            put("[GentleFactory()]", "[GentleFactory]")),
    Mistake(19, "get() without return", ("line 5: ", r"GentleFactory.get\(\)", "should return an Endpoint", "returned None", "with: return"),
            put("return Gentle(", "Gentle(")),
    Mistake(20, "a line with one space too few", ("line 16: ", "gentle.py", "unindent does not match", "IndentationError", "as many spaces"),
            put("        target_mps", "       target_mps")),
    Mistake(21, "a colon forgotten", ("line 5: ", "gentle.py", "expected ':'", "SyntaxError", "with a colon"),
            put("def get(self, parent):", "def get(self, parent)")),
    Mistake(23, "TaskType.proces_data", ("line 12: ", "TaskType", "event, process_data, reload, store_page, terminate", "proces_data", "did you mean 'process_data'"),
            put("process_data", "proces_data")),
    Mistake(24, "the two parts of an id swapped", ("line 12: ", "'gentle'", "swapped", r"\('radar', TaskType", r"\(TaskType.process_data, 'radar'\)"),
            put('(TaskType.process_data, "radar")', '("radar", TaskType.process_data)')),
    Mistake(25, "a handler returns a dict", ("line 18: ", r"on_radar\(\) of Gentle", "not a task", r"returns \{'throttle'", r"store_data_task\("),
            put(COMMAND, 'return {"throttle": 1.0}')),
    Mistake(27, "an object in a page", ("line ", "'mine'", "plain|numbers", "Gentle", "Try: "),
            put(COMMAND, 'self.store_data("mine", self)\n        ' + COMMAND), is_before=False),
    Mistake(28, "a list that is changed after it was stored", ("line ", "'mine'", "changed|store", "list", "Try: "),
            put(COMMAND, 'self.way = getattr(self, "way", [])\n        self.way.append(1)\n        self.store_data("mine", self.way)\n        ' + COMMAND),
            is_before=False,  # a page keeps what was stored, so nothing is wrong any more
            elsewhere="tests/core/test_page_data.py::test_growing_list_is_kept_as_stored_in_prev_trace_and_replay"),
    Mistake(29, "import of EndPoint", ("line 1: ", "EndPoint", "'Endpoint'", "cannot import name 'EndPoint'", "did you mean 'Endpoint'"),
            put("import Endpoint,", "import EndPoint,")),
    Mistake(31, "two helpers that import each other", ("two.py, line 1: ", "one", "import each other", "circular import", "into a third file"),
            {**put("from snr_sim", "import one\nfrom snr_sim"), "one.py": holds("import two\nGAIN = 1\n"), "two.py": holds("from one import GAIN\n")}),
    Mistake(32, "a file that is not there", ("gentel.py", "gentel", "there are: gentle.py", "no file './gentel.py'", "did you mean 'gentle.py'"),
            words=("run", "lander_vertical", "--controller", "./gentel.py")),
    Mistake(33, "an unknown scenario", ("lander_vertial", "no scenario", "One of: ", "'lander_vertial'", "did you mean 'lander_vertical'"),
            words=("run", "lander_vertial")),
    Mistake(35, "a file without ./ and .py", ("'gentle'", "no controller", "one of: coast", "'gentle'", r"--controller \./"),
            words=("run", "lander_vertical", "--controller", "gentle")),
    Mistake(36, "a lander's controller on the vehicle", ("line 12: ", "'radar'", "a page of 'lander'", "'urov'.* has none", "snr run lander"),
            words=("run", "urov_depth_hold", "--controller", "./gentle.py")),
    Mistake(37, "random.random(), then replay --check", ("line 18: ", r"random.random\(\)", "repeat", "does not repeat|diverged", "self.rng"),
            put("class GentleFactory", "import random\nclass GentleFactory", "throttle = 0.28", "throttle = 0.01 * random.random() + 0.28"),
            then=("replay", "{run}", "--check"), is_before=False),
    Mistake(39, "a policy that is a text", ("policy.txt", "policy.txt", "table of action values", "not a zip file", "QTable.save"),
            {"policy.txt": holds("hello")}, words=("run", "lander_vertical", "--controller", "q", "--policy", "policy.txt")),
    Mistake(40, "a policy that is not there", ("none.npz", "none.npz", "file", "no file", "save it first"),
            words=("run", "lander_vertical", "--controller", "q", "--policy", "none.npz")),
    Mistake(41, "a console's port that is in use", ("", "", "", "", ""),
            elsewhere="tests/console/test_command_receiver.py::test_port_in_use_raises_link_error_and_halts_components"),
    Mistake(43, "a full disk", ("", "", "", "", ""), is_before=False,
            elsewhere="tests/cli/test_signals.py::test_full_disk_stops_run_with_message_and_complete_trace"),
    Mistake(44, "no display: snr view", ("snr view", "window", "a display|a browser", "no display", "--web"), then=("view", "{run}")),
    Mistake(45, "no display: snr run --view", ("--view", "window", "a display|a browser", "no display", "--web-view"), words=(*RUN, "--view")),
    Mistake(47, "teleoperation without a terminal", ("pilot=manual", "keyboard|keys", "a terminal|a game controller", "no terminal|no manual input", "Try: "),
            elsewhere="tests/cli/test_roles.py::test_pilot_without_terminal_logs_missing_input"),
    Mistake(48, "division by zero", ("line 16: ", r"on_radar\(\)", "other than 0", "division by zero", "before you divide"),
            put("-1.0 - 0.05 *", "1.0 / (2 - 2) - 0.05 *"), is_before=False),
    Mistake(49, "task_handlers misspelt", ("line 12: ", "'gentle'", r"self.task_handlers = ", "no handlers", "not self.task_handler\\."),
            put("self.task_handlers", "self.task_handler")),
    Mistake(51, "sys.exit() in a handler", ("line 16: ", r"on_radar\(\) of Gentle", "ends the run as an error", "leaves the program", "tasks.terminate"),
            put("class GentleFactory", "import sys\nclass GentleFactory", RADAR, "        sys.exit()\n" + RADAR)),
    Mistake(52, "a handler that stores its own trigger without end", ("line 14: ", "gentle.on_radar", "a Loop bring in", "executed 10000 tasks", "only when something has changed"),
            put(COMMAND, "return task"), is_before=False),
    Mistake(53, "throttle 7.0", ("line 18: ", "'engine'", "from 0 to 1", "throttle = 7", "store what is from"),
            put(COMMAND, COMMAND.replace("min(max(throttle, 0.0), 1.0)", "7.0"))),
    Mistake(55, "a loop() without an end", ("line ", "loop", "return", "not returned", "Try: "), is_before=False,
            elsewhere="tests/core/test_watchdog.py::test_standstill_in_begin_loop_and_halt_is_reported"),
    Mistake(56, "a misspelt attribute in begin()", ("line 15: ", "'gentle', a Gentle", "set it in __init__|did you mean", "no attribute 'gian'", "Try: "),
            put("    def on_radar", "    def begin(self):\n        self.gain = self.gian\n\n    def on_radar")),
    Mistake(57, "a page that is not there", ("line 16: ", "page 'wind'", "stored are: engine, radar", "'wind'", "Try: "),
            put("        target_mps", '        wind = self.get_data("wind")["speed_mps"]\n        target_mps')),
    Mistake(59, "Python 3.10", ("", "", "", "", ""), elsewhere="pip: Package 'snr-sim' requires a different Python: 3.10 not in '>=3.11'"),
    Mistake(60, "--seed abc", ("--seed", "--seed", "whole number", "abc", "--seed 3"), words=(*RUN, "--seed", "abc")),
    Mistake(61, "--speed fsat", ("--speed", "--speed", "a number greater than 0", "not 'fsat'", "--speed fast"), words=(*RUN, "--speed", "fsat")),
    Mistake(63, "snr rnu", ("rnu", "rnu", "'run'", "No such command 'rnu'", "Did you mean 'run'"), words=("rnu", "lander_vertical")),
    Mistake(64, "an unknown lab", ("dept_hold", "assignment 'dept_hold'", "One of: 01", "no assignment", "did you mean '02_depth_hold'"), words=("check", "dept_hold")),
    Mistake(65, "a new lab where one is", ("depth_hold", "depth_hold", "nothing was changed", "is there already", "rename it"),
            words=("new", "lab", "depth_hold"), then=("new", "lab", "depth_hold")),
    Mistake(67, "a damaged trace", ("line 20 is not a record", "trace.jsonl", "malformed", "It reads: ", "untouched copy"),
            then=("trace", "{damaged}")),
    Mistake(68, "a live edit with a KeyError in the handler", ("line 20: ", r"on_radar\(\)", "Its keys are: altitude_m", "KeyError: 'altitude_n'", "did you mean 'altitude_m'"),
            in_flight('radar["altitude_m"]', 'radar["altitude_n"]'), words=WATCHED, is_before=False),
    Mistake(69, "a live edit with a syntax error", ("line 20: ", "gentle.py", "never closed", "SyntaxError", "count the brackets"),
            in_flight('radar["altitude_m"]', '(radar["altitude_m"]'), words=WATCHED, is_before=False),
    *[Mistake(70 + i, f"a live edit that stores {what}", (r"line \d+: ", "'engine'|gentle.on_radar", must, found, fix), in_flight(*edit), words=WATCHED, is_before=False)
      for i, (what, must, found, fix, *edit) in enumerate([
          ("an unknown field", "did you mean", "'throtle'", "throttle", '"throttle"', '"throtle"'),
          ("NaN", "finite number", "nan", "send a number from", 'min(max(throttle, 0.0), 1.0)', 'float("nan")'),
          ("a text", "must be a dict|must be a number", "'half'", "store a dict", 'min(max(throttle, 0.0), 1.0)', '"half"'),
      ])],
    Mistake(73, "a live edit that stores its own trigger without end", ("", "", "", "", ""), is_before=False,
            elsewhere="tests/core/test_rollback.py::test_new_code_with_tasks_without_end_leaves_its_place_to_the_old_code"),
    Mistake(77, "a live edit that does not return", ("line 22: while True: pass", r"on_radar\(\) of component 'gentle'", "does its work once and returns", "has not returned for 2 s", "is a Loop's work"),
            in_flight(COMMAND, "while True: pass"), words=WATCHED, is_before=False, is_slow=True),
    Mistake(78, "a live edit that stores what another component fails on", (r"gentle.py, line \d+: .*gaol_m", r"on_plan\(\), component 'tracker'", "Its keys are: gaol_m", "KeyError: 'goal_m'", "did you mean 'gaol_m'"),
            with_tracker(in_flight("goal_m", "gaol_m")), words=WATCHED, is_before=False),
    Mistake(74, "a live edit that stores a misspelt page", ("line 20: ", "'enigne'", "its actuators take: engine", "Nothing in this robot takes", "did you mean 'engine'"),
            in_flight('"engine"', '"enigne"'), words=WATCHED, is_before=False),
    Mistake(75, "a live edit that removes the handlers", (r"line \d+: |Endpoint 'gentle'", "'gentle'", "task_handlers", "no handlers", "set self.task_handlers"),
            in_flight("def factories", "Gentle.__init__ = Endpoint.__init__\n\n\ndef factories"), words=WATCHED, is_before=False),
    Mistake(76, "a live edit of factories()", (r"line 2\d", r"factories\(robot\)", "only when a run starts", "has changed", "start the run again"),
            in_flight("[GentleFactory()]", "[GentleFactory(), GentleFactory()]"), words=WATCHED, is_before=False),
    # Others of the same kinds.
    Mistake(101, "a name that is not imported", ("line 16: ", "tasks", "from snr_sim import tasks", "Nothing gives tasks a value", "add at the top"),
            put(RADAR, RADAR + '        if radar["altitude_m"] < 3: return tasks.terminate("done")\n')),
    Mistake(102, "a misspelt variable", ("line 18: ", "thrott", "'throttle'", "Nothing gives thrott a value", "did you mean 'throttle'"),
            put("min(max(throttle,", "min(max(thrott,")),
    Mistake(103, "self. forgotten", ("line 18: ", "store_data_task", "self.store_data_task", "Nothing gives store_data_task", "did you mean self"),
            put("return self.store", "return store")),
    Mistake(104, "a field as an attribute", ("line 16: ", r"on_radar\(\)", "a page is a dict", "no attribute 'altitude_m'", r'radar\["altitude_m"\]'),
            put('radar["altitude_m"]', "radar.altitude_m"), is_before=False),
    Mistake(105, "square brackets around an argument", ("line 15: ", r"on_radar\(\)", "round brackets", "not subscriptable", r"self.get_data\('radar'\)"),
            put('get_data("radar")', 'get_data["radar"]'), is_before=False),
    Mistake(106, "quotes forgotten", ("line 15: ", r"on_radar\(\)", "a text has quotes", "UnboundLocalError", '"radar"'),
            put('get_data("radar")', "get_data(radar)"), is_before=False),
    Mistake(431, "a page for its data", ("line 16: ", r"on_radar\(\)", "has its data in data", "'Page' object is not subscriptable", r"radar\.data\['altitude_m'\]"),
            put('get_data("radar")', 'get_page("radar")'), is_before=False),
    Mistake(107, "__init__ misspelt", ("line 10: ", "'gentle'", "'__init__'", "no handlers", "did you mean '__init__'"),
            put("def __init__", "def _init__")),
    Mistake(108, "a handler that is not there", ("line 12: ", "Gentle", r"\(self, task, task_id\)", "no attribute 'on_landed'", "define it"),
            put(HANDLERS, '{(TaskType.event, "landed"): self.on_landed}')),
    Mistake(109, "a handler misspelt", ("line 12: ", "Gentle", "'on_radar'", "no attribute 'on_radr'", "did you mean"),
            put("self.on_radar", "self.on_radr")),
    Mistake(110, "an argument of __init__ forgotten", ("line 11: ", "'name'", "positional argument: 'name'", "missing 1", r"super\(\).__init__\(factory, parent, name\)"),
            put("__init__(factory, parent, name)", "__init__(factory, parent)")),
    Mistake(111, "the factory forgotten", ("line 6: ", "Gentle", r"Gentle\(factory, parent, name\)", "missing 1", "give them"),
            put("Gentle(self, parent,", "Gentle(parent,")),
    Mistake(432, "an argument of an endpoint's own forgotten", ("line 6: ", "Gentle", r"GentleEndpoint\(factory, parent, name\)", "missing 1", "give them"),
            put("Gentle(self, parent, \"gentle\")", "GentleEndpoint(self, parent)", "class Gentle(", "class GentleEndpoint(")),
    Mistake(112, "get() misspelt", ("line 4: ", "GentleFactory", r"get\(self, parent\)", "needs a method", "write that method"),
            put("def get(", "def gte(")),
    Mistake(113, "a factory of no class", ("line 5: ", "GentleFactory", "EndpointFactory", "is not a factory", r"class GentleFactory\(EndpointFactory\)"),
            put("GentleFactory(EndpointFactory)", "GentleFactory")),
    Mistake(114, "an endpoint of no class", ("line 11: ", "GentleFactory", r"class Mine\(Endpoint\)", "exactly one argument", "name the class"),
            put("Gentle(Endpoint)", "Gentle")),
    Mistake(115, "a package misspelt", ("line 1: ", "nunpy", "'numpy'", "No module named 'nunpy'", "did you mean"),
            put("from snr_sim", "import nunpy\nfrom snr_sim")),
    Mistake(116, "a number for a command", ("line 18: ", "'engine'", "must be a dict", "is 0.5", "fields are throttle"),
            put(COMMAND, 'return self.store_data_task("engine", 0.5)')),
    Mistake(117, "a task that is not returned", ("line 18: ", r"on_radar\(\) of Gentle", "returns is done", "drops it", "return self.store_data_task"),
            put("return self.store_data_task", "self.store_data_task")),
    Mistake(118, "an assignment into a page", ("line 16: ", r"on_radar\(\) of Gentle", "that it reads", "changes the page 'radar'", r"radar = dict\(radar\)"),
            put(RADAR, RADAR + '        radar["altitude_m"] = 0.0\n')),
    Mistake(119, "a controller in the place of a scenario", ("gentle.py", "gentle.py", "scenario's file says", "is a controller", r"--controller ./gentle.py"),
            words=("run", "./gentle.py")),
    Mistake(120, "a controller without its option", ("gentle.py", "gentle.py", "--controller", "extra argument", r"--controller ./gentle.py"),
            words=("run", "lander_vertical", "gentle.py")),
    Mistake(121, "a misspelt name for snr trace", ("radr", "tasks or pages", "One of: |radar", "no tasks or pages 'radr'", "did you mean 'radar'"),
            then=("trace", "{run}", "--name", "radr")),
    Mistake(122, "a file that is not UTF-8", ("line 1: ", "gentle.py", "not Python source", "0xe9", "UTF-8"),
            {"gentle.py": latin}, is_before=True),
    # The short form
    Mistake(201, "@handles page 'rader'", ("line 14: ", "page 'rader'", "Stored are: .*radar", "'rader'", "did you mean 'radar'"),
            short('@handles("radar")', '@handles("rader")')),
    Mistake(202, "@handles without brackets", ("line 14: ", "on_radar", "does not name", "@handles", r'@handles\("radar"\)'),
            short('@handles("radar")', "@handles")),
    Mistake(203, "field of the given page", ("line 16: ", "page 'radar'", "altitude_m, stamp_s, velocity_mps", "'altitude_n'", "did you mean 'altitude_m'"),
            short("altitude_m", "altitude_n")),
    Mistake(204, "a handler with the long form's arguments", ("line 1[45]: ", "on_radar", r"called with \(self, data\)", r"takes \(self, task, task_id\)", r"def on_radar\(self, data\)"),
            short("on_radar(self, radar)", "on_radar(self, task, task_id)")),
    Mistake(205, "a setting misspelt", ("line 22: ", "Gentle", "no setting", "'hovr'", "did you mean 'hover'"),
            short("factory(hover", "factory(hovr")),
    Mistake(206, "the class in place of a factory", ("line 2[12]: ", r"factories\(robot\)", "not a factory", "the class Gentle", r"Gentle.factory\(\)"),
            short("Gentle.factory(hover=0.28)", "Gentle")),
    Mistake(207, "factory without brackets", ("line 2[12]: ", r"factories\(robot\)", "not a factory", "with Gentle.factory,", r"Gentle.factory\(\)"),
            short("Gentle.factory(hover=0.28)", "Gentle.factory")),
    Mistake(208, "a page that does not fit", ("line 18: ", "Page 'engine'", "`float`", "`str`", "store|Try"),
            short("Engine(min(max(throttle, 0.0), 1.0))", "Engine('full')"), is_before=False),
    Mistake(209, "a page under another key", ("line 18: ", "Page 'engines'", "declared as page 'engine'", "given a", r'store_data\("engine"'),
            short('_task("engine"', '_task("engines"'), is_before=False),
    Mistake(210, "no class that declares a page", ("line 14: ", "Gentles", "neither the key", "Gentles", r"@page\("),
            short('@handles("radar")', '@handles(type("Gentles", (), {}))')),
    Mistake(211, "two methods for one page", ("line 11: |Gentle", "Gentle", "page|process_data", "twice", "one method"),
            short("    @handles", "    @handles('radar')\n    def on_other(self, radar):\n        pass\n\n    @handles")),
    Mistake(215, "an assignment into a page in the short form", ("line 16: ", r"on_radar\(\) of Gentle", "that it reads", "changes the page 'radar'", r"radar = dict\(radar\)"),
            short("        target_mps", '        radar["altitude_m"] -= 1.0\n        target_mps')),
    Mistake(216, "two components that store one command", (r"line \d+: ", "'engine'", "let one store it", "Several components store.*gentle, other", "pages of their own"),
            short("Gentle.factory(hover=0.28)", "Gentle.factory(hover=0.28), Gentle.factory('other')")),
    Mistake(217, "a log message with too few values", ("line 16: ", "'gentle' logs", "as many values", "not enough arguments", "% marks"),
            short("        target_mps", '        self.log.warning("alt %d %s", 3)\n        target_mps'), is_before=False),
    # What was found by trying a lesson's worth of mistakes in the short form
    Mistake(301, "page and key swapped", ("line 18: ", "A page's key", "which is not text", "the dict", r"store_data_task\('engine', "),
            short('"engine", Engine(min(max(throttle, 0.0), 1.0))', '{"throttle": 0.5}, "engine"'), is_before=False),
    Mistake(302, "a tuple of key and data", ("line 14: ", "gentle.on_radar", "not a task", "a tuple with 'engine'", r"self.store_data_task\('engine'"),
            short('self.store_data_task("engine", Engine(min(max(throttle, 0.0), 1.0)))', '("engine", {"throttle": 0.5})'), is_before=False),
    Mistake(303, "self.parent is overwritten", ("line 17: ", "parent", "the component's node", "NoneType", "another name"),
            short("        target_mps", '        self.parent = None\n        self.get_data("radar")\n        target_mps'), is_before=False),
    Mistake(304, "an endpoint without its base class", ("line 22: ", "Gentle", "builds on", "no attribute 'factory'", r"class Gentle\(Endpoint\)"),
            short("class Gentle(Endpoint)", "class Gentle")),
    Mistake(305, "@handles(pages=...)", ("line 14: ", "handles", "It takes|it takes", "'pages'", "did you mean 'page'"),
            short('@handles("radar")', '@handles(pages="radar")')),
    Mistake(306, "a page handled as an event", ("line 14: ", "'gentle'", "a page of that name", "event 'radar'", r"@handles\('radar'\)"),
            short('@handles("radar")', '@handles(event="radar")'), is_before=False),
    Mistake(307, "a misspelt field in get()", ("line 16: ", "page 'radar'", "altitude_m, stamp_s, velocity_mps", "'altitude_ft'", "did you mean 'altitude_m'"),
            short('radar["altitude_m"]', 'radar.get("altitude_ft", 0)')),
    Mistake(308, "self.get_time()", ("line 17: ", "'gentle'", "nothing sets it", "'get_time'", "did you mean 'get_time_s'"),
            short("self.hover", "0.0 * self.get_time()")),
    Mistake(309, "self.logger", ("line 16: ", "'gentle'", "nothing sets it", "'logger'", "did you mean 'log'"),
            short("        target_mps", '        self.logger.info("x")\n        target_mps')),
    Mistake(310, "def lop in a Loop", ("line 21: ", "Beat", r"no method loop\(self\)", "is a Loop", "not lop"),
            short("def factories", "class Beat(Loop):\n    def lop(self):\n        pass\n\n\ndef factories", "[Gentle.factory(hover=0.28)]", "[Beat.factory()]", "import Endpoint,", "import Endpoint, Loop,")),
    Mistake(311, "__init__(self)", ("line 13: ", "Gentle|gentle", "positional argument", "4 were given", "as many arguments|def __init__"),
            short("    hover = 0.28\n", "    hover = 0.28\n\n    def __init__(self):\n        pass\n")),
    Mistake(312, "begin(self, x)", ("line 14: ", r"begin\(\) of Gentle", "without arguments", r"takes \(x\)", r"def begin\(self\)"),
            short("    hover = 0.28\n", "    hover = 0.28\n\n    def begin(self, x):\n        pass\n")),
    Mistake(313, "halt(self, why)", ("line 14: ", r"halt\(\) of Gentle", "without arguments", r"takes \(why\)", r"def halt\(self\)"),
            short("    hover = 0.28\n", "    hover = 0.28\n\n    def halt(self, why):\n        pass\n")),
    Mistake(314, "two components of one name", ("line 11: ", "'gentle'", "two components", "a Gentle and a Gentle", "a name of its own"),
            short("Gentle.factory(hover=0.28)", "Gentle.factory(), Gentle.factory()")),
    Mistake(315, "curly quotes", ("line 14: ", "gentle.py", "SyntaxError", "invalid character", "straight quotes"),
            short('@handles("radar")', "@handles(\u201cradar\u201d)")),
    Mistake(316, "tasks.store", ("line 18: ", "tasks", "store_page", "no attribute 'store'", "did you mean"),
            short("self.store_data_task(", "tasks.store(", "import Endpoint,", "import Endpoint, tasks,"), is_before=False),
    Mistake(317, "max_tick_rate in a Loop", ("line 21: ", "Beat", "max_tick_rate_hz", "Nothing uses max_tick_rate ", "did you mean 'max_tick_rate_hz'"),
            beat("    max_tick_rate = 10\n\n    def loop(self):\n        pass\n")),
    Mistake(318, "a rate of a million", ("line 21: ", "'beat'", "50 Hz suffice", "ticks 1e\\+06 times", "every tick"),
            beat("    max_tick_rate_hz = 1e6\n    first_tick_after_s = 1e6\n\n    def loop(self):\n        pass\n")),
    *[Mistake(319 + i, f"def {name} in an Endpoint", ("line 14: ", name, expected, f"Nothing uses|nothing uses its {name}", fix),
              short("    hover = 0.28\n", f"    hover = 0.28\n\n    def {name}(self):\n        pass\n"))
      for i, (name, expected, fix) in enumerate([("loop", "a Loop has one", "class Gentle"), ("setup", "a Loop has one", "class Gentle"), ("beginn", "begin", "did you mean 'begin'")])],
    # What an outsider tried afterwards, who had not written the messages
    Mistake(401, "fields as arguments of store_data_task", ("line 18: ", r"on_radar\(\)", "it takes: .*key", "'throttle'", "Try: "),
            short('Engine(min(max(throttle, 0.0), 1.0))', "throttle=0.5"), is_before=False),
    Mistake(402, "a comma at the end of a line", ("line 19: ", "'engine'", "a number from 0 to 1", r"the tuple \(0.3,\)", "store a dict"),
            short("throttle = self.hover", "throttle = 0.3,\n        other = self.hover", "Engine(min(max(throttle, 0.0), 1.0))", '{"throttle": throttle}'), is_before=False),
    Mistake(403, "^ for a power", ("line 16: ", r"on_radar\(\)", "two stars", r"for \^: 'float' and 'int'", r"a \*\* 2"),
            short('radar["altitude_m"]', 'radar["altitude_m"] ^ 2'), is_before=False),
    Mistake(404, "an index behind a number", ("line 16: ", r"on_radar\(\)", "it has no parts", "'float' object", r"leave out \[0\]"),
            short('radar["altitude_m"]', 'radar["altitude_m"][0]'), is_before=False),
    Mistake(405, "a counter outside the class", ("line 19: ", "'gentle'|count", "a function sets is its own", "UnboundLocalError", r"self\.count, set in __init__"),
            short("class Gentle", "count = 0\n\n\nclass Gentle", "        target_mps", "        count += 1\n        target_mps"), is_before=False),
    Mistake(406, "a page for a number in a text", ("line 16: ", r"on_radar\(\)", "a value of its kind", "not dict", "f'{value}'"),
            short("        target_mps", '        print("altitude %d" % radar)\n        target_mps'), is_before=False),
    Mistake(407, "a method scheduled that is not called", ("line 16: ", r"gentle\.schedule", "not a task", "was given <bound method", r"round brackets: store_data_task\("),
            short("        target_mps", "        self.schedule(self.store_data_task)\n        target_mps"), is_before=False),
    Mistake(408, "a handler outside its class", ("line 21: ", "on_inertial", "the class of an Endpoint", "is in no class", "indent it"),
            short("def factories", '@handles("inertial")\ndef on_inertial(self, data):\n    pass\n\n\ndef factories')),
    Mistake(409, "two methods of one name", ("line 22: ", "on_radar", "never called", "replaces the one of line 15", "a name of its own"),
            short("def factories", '    @handles(event="go")\n    def on_radar(self, task):\n        pass\n\n\ndef factories')),
    Mistake(410, "a method without its brackets", ("line 16: ", r"on_radar\(\)", "round brackets", "'method' and 'float'", r"call it.*self\.get_time_s\(\)"),
            short("        target_mps", "        later_s = self.get_time_s - 3.0\n        target_mps"), is_before=False),
    Mistake(411, "self.log()", ("line 16: ", r"on_radar\(\)", "the level", "'ComponentLog' object is not callable", r"self\.log\.info\("),
            short("        target_mps", '        self.log("hello")\n        target_mps'), is_before=False),
    Mistake(412, "round brackets behind a page", ("line 16: ", r"on_radar\(\)", "square brackets", "'dict' object is not callable", r"radar\['altitude_m'\]"),
            short('radar["altitude_m"]', 'radar("altitude_m")'), is_before=False),
    Mistake(413, "a field without a type", ("line 6: ", r'@page\("engine"\)', "not a field", "throttle has no type", "throttle: float = 0.5"),
            short("throttle: float", "throttle = 0.5")),
    Mistake(414, "an attribute that the factory has not", ("line 16: ", r"on_radar\(\)", "before the factory is returned", "no attribute 'count'", "made.count = "),
            short("        target_mps", "        self.factory.count += 1\n        target_mps"), is_before=False),
    Mistake(415, "else if", ("line 18: ", "gentle.py", "in one word", "SyntaxError", "write elif"),
            short("        target_mps", "        if self.hover > 1:\n            pass\n        else if self.hover > 2:\n            pass\n        target_mps")),
    Mistake(416, "the thesis' package", ("line 3: ", "'snr'", "No module named", "'snr'", "did you mean 'snr_sim'"),
            short("from snr_sim", "from snr")),
    Mistake(417, "the root of a negative number", ("line 16: ", r"on_radar\(\)", "no value for every number", "math domain error", "test it before"),
            short("import msgspec\n", "import math, msgspec\n", "        target_mps", '        math.sqrt(-radar["altitude_m"])\n        target_mps'), is_before=False),
    Mistake(418, "a run of no scenario", ("snr run", "scenario", "name it first", "Missing argument 'scenario'", "snr run lander_vertical"),
            words=("run", "--controller", "./gentle.py")),
    Mistake(419, "a rate in an Endpoint", ("line 11: ", "Gentle is an Endpoint", "a Loop has one", "nothing uses its max_tick_rate_hz", r"class Gentle\(Loop\)"),
            short("    hover = 0.28\n", "    hover = 0.28\n    max_tick_rate_hz = 10\n")),
    Mistake(420, "a key with a blank", ("line 18: ", "'engine '", "its actuators take: engine", "Nothing in this robot takes", "did you mean 'engine'"),
            short('_task("engine"', '_task("engine "', "Engine(min(max(throttle, 0.0), 1.0))", '{"throttle": 0.5}')),
    Mistake(421, "a page read in begin()", ("line 15: ", r"begin\(\) of component 'gentle'", "test it first", "'NoneType' object", "if page is None"),
            short("    hover = 0.28\n", '    hover = 0.28\n\n    def begin(self):\n        self.start_m = self.get_data("radar")["altitude_m"]\n'), is_before=False),
    Mistake(422, "loop(self, dt_s)", ("line 24: ", r"loop\(\) of Beat", "without arguments", r"takes \(dt_s\)", r"def loop\(self\)"),
            beat("    max_tick_rate_hz = 10\n\n    def loop(self, dt_s):\n        pass\n")),
    Mistake(433, "task_handlers in the class is a list", ("line 11: ", "'?Gentle'? has task_handlers|Component 'Gentle'", "is a dict", "of type list", r"\{\(TaskType"),
            short('    @handles("radar")\n', '    task_handlers = [("process_data", "radar")]\n')),
    Mistake(434, "task_handlers is a method", ("line 11: ", "Component 'Gentle'", "is a dict", "of type function", r"\{\(TaskType"),
            short('    @handles("radar")\n', '    def task_handlers(self):\n        return {}\n\n')),
    Mistake(435, "@handles of a kind of tasks", ("line 14: ", "@handles", "but no page and no event", "TaskType.process_data", r'@handles\("radar"\)'),
            short('@handles("radar")', "@handles(TaskType.process_data)", "import Endpoint,", "import Endpoint, TaskType,")),
    Mistake(436, "a component in place of its factory", ("line 22: ", "Gentle|Endpoint", "factory", "missing 3 required", r"Gentle\.factory\(\): the node makes"),
            short("Gentle.factory(hover=0.28)", "Gentle()")),
    Mistake(437, "a component with a setting in place of its factory", ("line 22: ", "Gentle|Endpoint", "factory", "unexpected keyword argument 'hover'", r"Gentle\.factory\(\): the node makes"),
            short("Gentle.factory(hover=0.28)", "Gentle(hover=0.28)")),
    Mistake(439, "a setting that the class has not", ("line 22: ", "Gentle", "One of: hover, optional_events\\. A setting", "no setting 'hovr'", "did you mean 'hover'"),
            short("factory(hover=", "factory(hovr=")),
    Mistake(440, "super().__init__ forgotten in the short form", ("line 14: ", "Gentle of role", "its parent's __init__", "has not called", r"super\(\).__init__\("),
            short("    hover = 0.28\n", "    hover = 0.28\n\n    def __init__(self, factory, parent, name):\n        self.hover = 0.3\n")),
    Mistake(441, "__init__(self) in the short form", ("line 14: ", "Gentle", r"def __init__\(self, factory, parent, name\)", "takes 1 positional argument but 4", r"super\(\).__init__\("),
            short("    hover = 0.28\n", "    hover = 0.28\n\n    def __init__(self):\n        self.hover = 0.3\n")),
    Mistake(442, "a rate that is a text", ("line 21: ", "'beat'", "0 or more", "max_tick_rate_hz='10'", "such as 50"),
            beat("    max_tick_rate_hz = '10'\n\n    def loop(self):\n        pass\n")),
    Mistake(443, "an event that nothing handles", ("line 18: ", "event 'go'", "Nothing in this robot handles", "'go'", r"@handles\(event='go'\)"),
            short("self.store_data_task(", 'tasks.event("go"), self.store_data_task(', "import Endpoint,", "import Endpoint, tasks,")),
    Mistake(444, "an event and its handler that are spelt differently", ("line 18: ", "event 'lande'", "Nothing in this robot handles", "'lande'", "did you mean 'landed'"),
            short("self.store_data_task(", 'tasks.event("lande"), self.store_data_task(', "import Endpoint,", "import Endpoint, tasks,",
                  "def factories", '    @handles(event="landed")\n    def on_landed(self, task):\n        pass\n\n\ndef factories')),
    Mistake(445, "an assertion without a word", ("line 16: ", r"on_radar\(\)", "what it asserts is false", "AssertionError", "print the values"),
            short("        target_mps", '        assert radar["altitude_m"] < 500\n        target_mps'), is_before=False),
    Mistake(446, "optional_events is a number", ("line 11: ", "Gentle", "not a tuple of names", "optional_events = 5", r"optional_events = \("),
            short("    hover = 0.28\n", "    hover = 0.28\n    optional_events = 5\n")),
    Mistake(447, "optional_events is a text", ("line 11: ", "Gentle", "not a tuple of names", "optional_events = 'go'", r"optional_events = \('go',\)"),
            short("    hover = 0.28\n", "    hover = 0.28\n    optional_events = 'go'\n")),
    Mistake(448, "wakes_on is a text", ("line 21: ", "Beat", "not a tuple of names", "wakes_on = 'radar'", r"wakes_on = \('radar',\)"),
            beat("    wakes_on = 'radar'\n\n    def loop(self):\n        pass\n")),
    Mistake(449, "wakes_on a page that is not there", ("line 21: ", "page 'rader'", "Stored are: .*radar", "Nothing in this robot stores", "did you mean 'radar'"),
            beat("    wakes_on = ('rader',)\n    max_tick_rate_hz = 1\n\n    def loop(self):\n        pass\n")),
    Mistake(450, "a setting without its name", ("line 22: ", r"factory", "settings have names", "but 3 were given", "as hover=0.3"),
            short("factory(hover=0.28)", "factory('gentle', 0.28)")),
    Mistake(451, "the name of a component of the robot", ("line 11: ", "'engine_actuator'", "a name of its own", "two components", "give each component"),
            short("factory(hover=0.28)", "factory('engine_actuator')")),
    Mistake(452, "two pages in one @handles", ("line 14: ", "@handles", "does not name one page", r"@handles\('radar', 'engine'\)", "write one for each"),
            short('@handles("radar")', '@handles("radar", "engine")')),
    Mistake(453, "a list of pages in @handles", ("line 14: ", "@handles", "does not name one page", r"@handles\(\['radar', 'engine'\]\)", "write one for each"),
            short('@handles("radar")', '@handles(["radar", "engine"])')),
    Mistake(454, "an event whose name is a number", ("line 18: ", r"on_radar\(\)", "not text", "name is 5", r'tasks\.event\("measured", \[5\]\)'),
            short("self.store_data_task(", "tasks.event(5), self.store_data_task(", "import Endpoint,", "import Endpoint, tasks,"), is_before=False),
    Mistake(455, "the end without a reason", ("line 18: ", r"on_radar\(\)", "not text", "reason to end is None", r'tasks\.terminate\("landed"\)'),
            short("self.store_data_task(", "tasks.terminate(None), self.store_data_task(", "import Endpoint,", "import Endpoint, tasks,"), is_before=False),
    Mistake(456, "super() of a handler that the base has not", ("line 16: ", r"on_radar\(\)", "has no on_radar", "'super' object has no attribute 'on_radar'", "leave it out"),
            short("        target_mps", "        super().on_radar(radar)\n        target_mps"), is_before=False),
    Mistake(457, "an attribute that is called parent", ("line 16: ", "Gentle of role", "node, belongs", r"self\.parent to 3", "another name"),
            short("    hover = 0.28\n", "    hover = 0.28\n\n    def __init__(self, factory, parent, name):\n        super().__init__(factory, parent, name)\n        self.parent = 3\n")),
    Mistake(458, "a name that is a number", ("line 16: ", "Gentle of role", "name, a text, belongs", r"self\.name to 5", "another name"),
            short("    hover = 0.28\n", "    hover = 0.28\n\n    def __init__(self, factory, parent, name):\n        super().__init__(factory, parent, name)\n        self.name = 5\n")),
    Mistake(459, "the component's name in its class", ("line 11: ", "Gentle", "its factory names", "has no effect", r"Gentle\.factory\(name='pilot'\)"),
            short("    hover = 0.28\n", "    hover = 0.28\n    name = 'pilot'\n")),
    Mistake(460, "a thread that stores pages", ("line 23: ", "'gentle'", "simulation's clock", "differ in each run", "a Loop in place"),
            short("import msgspec\n", "import threading, msgspec\n", "        target_mps", "        threading.Thread(target=self.send).start()\n        target_mps",
                  "def factories", "    def send(self):\n        self.store_data('extra', 1.0)\n\n\ndef factories"), is_before=False, is_slow=True),
    Mistake(213, "a handler of the short form that stores its own trigger without end", ("line 14: ", "gentle.on_radar", "a Loop bring in", "executed 10000 tasks", "only when something has changed"),
            short('"engine", Engine(min(max(throttle, 0.0), 1.0))', '"radar", {**radar}'), is_before=False),
    Mistake(214, "a handler of the short form that returns a number", ("line 14: ", "gentle.on_radar", "not a task", "returned 0.", "a Task or a list"),
            short('self.store_data_task("engine", Engine(min(max(throttle, 0.0), 1.0)))', "throttle"), is_before=False),
    Mistake(212, "an attribute that is not set", ("line 17: ", "'gentle'", "nothing sets it", "'hoover'", "hover"),
            short("self.hover", "self.hoover")),
]  # fmt: skip
