# ruff: noqa: E501 (a table: a line a mistake)
"""The table of students' mistakes: each is a small change of the README's controller, or a command line.

Each message must state, for one point each: the student's own line; the class, handler, page or argument; what was
expected; what was found; the fix. A sixth point is for at most six lines. `test_student_mistakes.py` scores them.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

_README = (Path(__file__).parents[2] / "README.md").read_text()
_FOUND = re.search(r"`gentle\.py`:\n\n```python\n(.*?)```", _README, re.DOTALL)
assert _FOUND is not None
GENTLE = _FOUND[1]

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
        said: patterns of line, name, what was expected, what was found, the fix; "" if there is none.
        files: changes by file; gentle.py is the README's, others are initially empty.
        words: of the command line.
        then: words of a second command line; {run} is the run folder.
        is_before: whether it is reported before there is a run.
        elsewhere: the test that covers it, if it needs its own process, port or disk.
    """

    number: int
    what: str
    said: tuple[str, str, str, str, str]
    files: Mapping[str, Change] = field(default_factory=dict)
    words: tuple[str, ...] = RUN
    then: tuple[str, ...] = ()
    is_before: bool = True
    elsewhere: str = ""


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


def in_flight(old: str, new: str) -> dict[str, Change]:
    """Return changes by which the controller saves another version of itself 20 s into the run."""
    edit = f"""        path = __import__("pathlib").Path(__file__)
        if self.get_time_s() > 20.0 and "saved" not in vars(self.factory):
            self.factory.saved = True
            path.write_text({new!r}.join(path.read_text().rsplit({old!r}, 1)))
"""
    return put(RADAR, edit + RADAR)


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
            elsewhere="tests/core/test_watchdog.py::test_a_handler_that_sleeps_a_little_each_time_is_told_once_with_its_line"),
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
            put("        wanted_mps", "       wanted_mps")),
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
            elsewhere="tests/core/test_page_data.py::test_a_list_that_grows_is_in_prev_in_trace_and_in_replay_as_it_was_stored"),
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
            elsewhere="tests/console/test_command_receiver.py::test_a_port_in_use_is_said_at_the_start_and_everything_halted"),
    Mistake(43, "a full disk", ("", "", "", "", ""), is_before=False,
            elsewhere="tests/cli/test_signals.py::test_a_full_disk_stops_the_run_with_a_sentence_and_a_whole_trace"),
    Mistake(44, "no display: snr view", ("snr view", "window", "a display|a browser", "no display", "--web"), then=("view", "{run}")),
    Mistake(45, "no display: snr run --view", ("--view", "window", "a display|a browser", "no display", "--web-view"), words=(*RUN, "--view")),
    Mistake(47, "teleoperation without a terminal", ("pilot=hands", "keyboard|keys", "a terminal|a game controller", "no terminal|nobody can steer", "Try: "),
            elsewhere="tests/cli/test_roles.py::test_a_pilot_without_terminal_is_told_that_nobody_can_steer"),
    Mistake(48, "division by zero", ("line 16: ", r"on_radar\(\)", "other than 0", "division by zero", "before you divide"),
            put("-1.0 - 0.05 *", "1.0 / (2 - 2) - 0.05 *"), is_before=False),
    Mistake(49, "task_handlers misspelt", ("line 12: ", "'gentle'", r"self.task_handlers = ", "no handlers", "not self.task_handler\\."),
            put("self.task_handlers", "self.task_handler")),
    Mistake(51, "sys.exit() in a handler", ("line 16: ", r"on_radar\(\) of Gentle", "ends the run as an error", "leaves the program", "tasks.terminate"),
            put("class GentleFactory", "import sys\nclass GentleFactory", RADAR, "        sys.exit()\n" + RADAR)),
    Mistake(52, "a handler that asks for itself for ever", ("line 14: ", "gentle.on_radar", "a Loop bring in", "executed 100000 tasks", "only when something has changed"),
            put(COMMAND, "return task"), is_before=False),
    Mistake(53, "throttle 7.0", ("line 18: ", "'engine'", "from 0 to 1", "throttle = 7", "store what is from"),
            put(COMMAND, COMMAND.replace("min(max(throttle, 0.0), 1.0)", "7.0"))),
    Mistake(55, "a loop() without an end", ("line ", "loop", "return", "not returned", "Try: "), is_before=False,
            elsewhere="tests/core/test_watchdog.py::test_what_runs_in_begin_in_a_loop_and_in_halt_is_watched_too"),
    Mistake(56, "a misspelt attribute in begin()", ("line 15: ", "'gentle', a Gentle", "set it in __init__|did you mean", "no attribute 'gian'", "Try: "),
            put("    def on_radar", "    def begin(self):\n        self.gain = self.gian\n\n    def on_radar")),
    Mistake(57, "a page that is not there", ("line 16: ", "page 'wind'", "stored are: engine, radar", "'wind'", "Try: "),
            put("        wanted_mps", '        wind = self.get_data("wind")["speed_mps"]\n        wanted_mps')),
    Mistake(59, "Python 3.10", ("", "", "", "", ""), elsewhere="pip: Package 'snr-sim' requires a different Python: 3.10 not in '>=3.11'"),
    Mistake(60, "--seed abc", ("--seed", "--seed", "whole number", "abc", "--seed 3"), words=(*RUN, "--seed", "abc")),
    Mistake(61, "--speed fsat", ("--speed fsat", "--speed", "--speed real", "fsat is no speed", "--speed fast"), words=(*RUN, "--speed", "fsat")),
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
]  # fmt: skip
