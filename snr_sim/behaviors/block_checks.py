"""What the Python in a block of an LRP program may contain, and what is wrong with one that contains more."""

from __future__ import annotations

import ast
import re
import textwrap
import warnings
from collections.abc import Callable, Iterator, Mapping
from keyword import kwlist
from typing import Any, Literal, TypeAlias

from snr_sim.prelude.errors import suggest
from snr_sim.prelude.sums import number_sum

MAX_BLOCK = 4096  # characters of one block
MAX_NESTING = 50  # of expressions in expressions
MAX_WIDTH = 1000  # in a format

Kind: TypeAlias = Literal["condition", "block"]
Tree: TypeAlias = "ast.Module | ast.Expression"
# Lines from 0 and columns from 1 of beginning and end; message, fix, whether it is an error.
Found: TypeAlias = tuple[int, int, int, int, str, str, bool]

# Not factorial, comb and perm: they can run for hours.
_MATH = frozenset((
    "pi", "e", "tau", "inf", "nan", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh",
    "sqrt", "exp", "log", "log10", "log2", "hypot", "floor", "ceil", "trunc", "isfinite", "isnan", "isinf", "degrees",
    "radians", "fabs", "fmod", "copysign", "dist",
))  # fmt: skip
FUNCTIONS: dict[str, Callable[..., Any]] = {
    "abs": abs, "all": all, "any": any, "bool": bool, "divmod": divmod, "enumerate": enumerate, "float": float,
    "int": int, "len": len, "max": max, "min": min, "sorted": sorted, "str": str, "sum": number_sum, "tuple": tuple,
    "zip": zip, "list": tuple, "reversed": reversed,
}  # fmt: skip
_SPECIAL = ("robot", "now_ms", "in_state_ms", "signal", "random", "log", "math", "range", "round")
RESERVED = frozenset((*_SPECIAL, *FUNCTIONS, *kwlist))  # which a program cannot declare
# How many values the functions of parts take.
_COUNTS = {"read": 0, "age_ms": 0, "read_since_entry": 0, "start": 1, "stop": 0}
_STATEMENTS = (ast.Assign, ast.AugAssign, ast.If, ast.For, ast.Pass, ast.Expr)
_EXPRESSIONS = (
    ast.Constant, ast.Name, ast.BinOp, ast.UnaryOp, ast.BoolOp, ast.Compare, ast.IfExp, ast.Call, ast.Attribute,
    ast.Subscript, ast.Slice, ast.Tuple, ast.List, ast.ListComp, ast.GeneratorExp, ast.JoinedStr, ast.FormattedValue,
)  # fmt: skip
_ALLOWED_WAY = {
    ast.While: "repeat it in each step of the state: (running [...]).",
    ast.Lambda: "write it as (def name argument [expression]).",
    ast.FunctionDef: "write it as (def name argument [expression]).",
    ast.Import: '`math` is there already; functions of a Python file: (actions "file.py").',
    ast.ImportFrom: '`math` is there already; functions of a Python file: (actions "file.py").',
    ast.Try: "a block that fails is noted, and the machine continues.",
    ast.Dict: "use several variables, or a tuple.",
    ast.Set: "use a tuple: the order of a set differs between runs.",
    ast.SetComp: "use a list: [... for ... in ...].",
    ast.DictComp: "use a list: [... for ... in ...].",
    ast.NamedExpr: "assign in a line of its own: name = value.",
}


class BlockChecker:
    """Finds what a block may not contain; `shift` of a column is what was cut off before its line was parsed."""

    def __init__(
        self,
        variables: frozenset[str],
        definitions: Mapping[str, Any],
        parts: Mapping[str, set[str]] | None,
        actions: frozenset[str] = frozenset(),
    ) -> None:
        self.variables: frozenset[str] = variables
        self.definitions: Mapping[str, Any] = definitions
        self.parts: Mapping[str, set[str]] | None = parts
        self.actions: frozenset[str] = actions
        self.problems: list[Found] = []
        self._shifts: tuple[int, int] = (0, 0)  # of the first line, and of the others
        self._local_names: set[str] = set()
        self.called: set[tuple[str, str]] = set()  # functions of parts of the robot

    @property
    def has_errors(self) -> bool:
        """Whether the block cannot be compiled."""
        return any(is_error for *_, is_error in self.problems)

    def parse(self, text: str, column: int, kind: Kind) -> Tree | None:
        """Return the syntax tree of a block, and collect what is wrong with it; None if it is not Python."""
        if len(text) > MAX_BLOCK:
            self._add(0, column, 0, column, f"The block has {len(text)} characters.", f"{MAX_BLOCK} are allowed.")
            return None
        if not text.strip():
            what = "an expression" if kind == "condition" else "statements, or `pass`"
            self._add(0, column, 0, column, "The brackets are empty.", f"write {what}.")
            return None
        tree = self._parse(text, column, kind)
        if tree is None:
            return None
        if not self._is_flat(tree):
            self._add(0, column, 0, column, "The block is nested too deeply.", f"at most {MAX_NESTING} levels.")
            return None
        self._local_names = stored_names(tree)
        if kind == "condition":
            assert isinstance(tree, ast.Expression)
            self._check(tree.body)
        else:
            assert isinstance(tree, ast.Module)
            for statement in tree.body:
                self._check_statement(statement)
        return tree

    def _parse(self, text: str, column: int, kind: Kind) -> Tree | None:
        first = re.compile(r"^([ \t]*[A-Za-z_][A-Za-z0-9_]*[ \t]*):=", re.MULTILINE)
        if kind == "block" and first.search(text):
            self._add(0, column, 0, column + 1, "':=' is read as '='.", "write '='.", is_error=False)
            text = first.sub(r"\1 =", text)
        failure: SyntaxError | None = None
        for source, shifts in _sources(text, column, kind):
            try:
                with warnings.catch_warnings():  # of a backslash that means nothing
                    warnings.simplefilter("ignore")
                    tree: Any = ast.parse(source, mode="eval" if kind == "condition" else "exec")
            except SyntaxError as error:
                if failure is None:
                    failure, self._shifts = error, shifts
            except (ValueError, RecursionError, MemoryError) as error:
                self._add(0, column, 0, column, f"Python: {error}.", "simplify the block.")
                return None
            else:
                self._shifts = shifts
                parsed: Tree = tree
                return parsed
        assert failure is not None
        at = self._at(failure.lineno or 1, (failure.offset or 1) - 1)
        fix = "this is an expression: one value, no statements." if kind == "condition" else ""
        self._add(*at, at[0], at[1] + 1, f"Python: {failure.msg.rstrip('?.')}.", fix)
        return None

    @staticmethod
    def _is_flat(tree: ast.AST) -> bool:
        level = [tree]
        for _ in range(3 * MAX_NESTING):
            level = [child for node in level for child in ast.iter_child_nodes(node)]
            if not level:
                return True
        return False

    def _at(self, line: int, offset: int) -> tuple[int, int]:
        """Return line, from 0, and column of a place in what was parsed."""
        return line - 1, max(1, offset + self._shifts[0 if line == 1 else 1])

    def _report(self, node: ast.AST, message: str, fix: str = "") -> None:
        line, offset = getattr(node, "lineno", 1), getattr(node, "col_offset", 0)
        end_line, end = getattr(node, "end_lineno", line), getattr(node, "end_col_offset", offset + 1)
        self._add(*self._at(line, offset), *self._at(end_line, end), message, fix)

    def _add(
        self, line: int, column: int, end_line: int, end_column: int, message: str, fix: str, is_error: bool = True
    ) -> None:
        self.problems.append((line, column, end_line, end_column, message, fix, is_error))

    # -- statements and expressions -----------------------------------------------------------------------------------

    def _check_statement(self, node: ast.stmt) -> None:
        if not isinstance(node, _STATEMENTS):
            self._refuse(node)
            return
        for target in (*getattr(node, "targets", ()), *([node.target] if hasattr(node, "target") else ())):
            self._check_target(target)
        for name in ("value", "test", "iter"):
            if hasattr(node, name):
                self._check(getattr(node, name))
        for one in (*getattr(node, "body", ()), *getattr(node, "orelse", ())):
            self._check_statement(one)

    def _check_target(self, node: ast.expr) -> None:
        if isinstance(node, ast.Tuple):
            for one in node.elts:
                self._check_target(one)
        elif not isinstance(node, ast.Name):
            self._report(node, "Only variables can be assigned.", "name = value; for a part, robot.part.start(value).")
        elif node.id.startswith("_") or node.id in (*RESERVED, *self.definitions, *self.actions):
            self._report(node, f"'{node.id}' cannot be assigned.", "choose another name.")

    def _check(self, node: ast.expr) -> None:
        if not isinstance(node, _EXPRESSIONS):
            self._refuse(node)
        elif isinstance(node, ast.Constant):
            if not (node.value is None or type(node.value) in (bool, int, float, str)):
                self._report(node, f"{node.value!r} is not a number, text, True, False or None.")
        elif isinstance(node, ast.Name):
            self._check_name(node)
        elif isinstance(node, ast.Attribute):
            self._check_attribute(node)
        elif isinstance(node, ast.Call):
            self._check_call(node)
        elif isinstance(node, ast.FormattedValue):
            self._check_format(node)
        elif isinstance(node, ast.Subscript) and _is_plain_constant(node.value):
            self._report(node, "Only text and tuples have elements.", "write a comma or an operator between the two.")
        elif isinstance(node, ast.Compare) and any(isinstance(one, (ast.Is, ast.IsNot)) for one in node.ops):
            self._check_identity(node)
        elif isinstance(node, (ast.ListComp, ast.GeneratorExp)):
            outer = self._local_names
            for one in node.generators:
                if one.is_async:
                    self._refuse(node)
                self._check(one.iter)
                self._check_target(one.target)
                self._local_names = self._local_names | stored_names(one.target)
                for test in one.ifs:
                    self._check(test)
            self._check(node.elt)
            self._local_names = outer
        else:
            for child in ast.iter_child_nodes(node):
                if isinstance(child, ast.expr):
                    self._check(child)

    def _check_identity(self, node: ast.Compare) -> None:
        for one in (node.left, *node.comparators):
            self._check(one)
        if not all(isinstance(one, ast.Constant) and one.value is None for one in node.comparators):
            self._report(node, "'is' compares with None only.", "compare values by ==.")

    def _check_name(self, node: ast.Name) -> None:
        name = node.id
        if name in self.variables or name in self._local_names or name in FUNCTIONS or name in self.definitions:
            return
        if name in ("now_ms", "in_state_ms", "signal"):
            return
        if name in ("robot", "math"):
            self._report(node, f"'{name}' alone is not a value.", f"name what of it: {name}.NAME.")
            return
        if name in _SPECIAL or name in self.actions:
            self._report(node, f"'{name}' must be called.", f"{name}(...).")
            return
        known = {*self.variables, *self._local_names, *self.definitions, *FUNCTIONS, *_SPECIAL}
        self._report(node, f"There is no '{name}' here.", suggest(name, known))

    def _check_attribute(self, node: ast.Attribute) -> None:
        if isinstance(node.value, ast.Name) and node.value.id == "math":
            if node.attr not in _MATH:
                self._report(node, f"There is no 'math.{node.attr}' here.", suggest(node.attr, _MATH))
        elif part_of(node) is not None or (is_name(node.value, "robot") and node.attr == "stop"):
            self._check_call(ast.copy_location(ast.Call(node, [ast.Constant(0)] * _COUNTS.get(node.attr, 0), []), node))
            values = "value" if node.attr == "start" else ""
            self._report(node, f"'{ast.unparse(node)}' must be called.", f"{ast.unparse(node)}({values}).")
        elif is_name(node.value, "robot") and (self.parts is None or node.attr in self.parts):
            self._report(node, f"'robot.{node.attr}' alone is not a value.", f"robot.{node.attr}.read(), for example.")
        elif is_name(node.value, "robot"):
            self._report(node, f"The robot has no '{node.attr}'.", suggest(node.attr, self.parts or ()))
        else:
            self._report(node, f"'.{node.attr}' cannot be used here.", "only parts of the robot and math have members.")

    def _check_call(self, node: ast.Call) -> None:
        function = node.func
        if isinstance(function, ast.Attribute) and part_of(function) is not None:
            part, verb = part_of(function) or ("", "")
            self.called.add((part, verb))
            if self.parts is None:
                pass  # any may be named
            elif part not in self.parts:
                self._report(function, f"The robot has no '{part}'.", suggest(part, self.parts))
            elif verb not in self.parts[part]:
                self._report(function, f"'robot.{part}' has no '{verb}'.", suggest(verb, self.parts[part]))
        elif isinstance(function, ast.Attribute) and is_name(function.value, "robot"):
            self.called.add(("", function.attr))
            if function.attr != "stop":
                self._report(function, f"'robot.{function.attr}()' cannot be called.", "robot.stop(), or a part's.")
        elif isinstance(function, ast.Attribute):
            self._check_attribute(function)
        elif isinstance(function, ast.Name):
            if function.id in self.definitions:
                expected_count = len(self.definitions[function.id])
                if len(node.args) != expected_count:
                    self._report(node, f"'{function.id}' takes {expected_count} values, and is given {len(node.args)}.")
            elif function.id not in (*FUNCTIONS, *self.actions, "random", "log", "range", "round"):
                known = {*FUNCTIONS, "random", "log", "range", "round", *self.definitions, *self.actions}
                self._report(function, f"'{function.id}' cannot be called.", suggest(function.id, known))
        else:
            self._report(function, "Only names, parts of the robot and math can be called.")
        name = function.attr if isinstance(function, ast.Attribute) and not is_name(function.value, "math") else ""
        if len(node.args) != _COUNTS.get(name, len(node.args)):
            example = f"{ast.unparse(function)}({'50' if _COUNTS[name] else ''})."
            self._report(node, f"'{name}' takes {_COUNTS[name]} values, and is given {len(node.args)}.", example)
        for argument in node.args:
            self._check(argument)
        is_sorting = is_name(function, "sorted") or is_name(function, "max") or is_name(function, "min")
        for keyword in node.keywords:
            if not (keyword.arg in ("reverse", "default") and is_sorting):
                self._report(keyword, f"'{keyword.arg}=' cannot be used here.", "give values by their order.")
            self._check(keyword.value)

    def _check_format(self, node: ast.FormattedValue) -> None:
        self._check(node.value)
        spec = node.format_spec
        if spec is None:
            return
        parts = spec.values if isinstance(spec, ast.JoinedStr) else [spec]
        for one in parts:
            if not isinstance(one, ast.Constant):
                self._report(node, "A format must be constant.", "write it out, such as {x:.2f}.")
            elif any(int(number) > MAX_WIDTH for number in re.findall(r"\d{1,9}", str(one.value))):
                self._report(node, f"A format wider than {MAX_WIDTH}.", "write a smaller one, such as {x:8.2f}.")

    def _refuse(self, node: ast.AST) -> None:
        words = {ast.Delete: "del", ast.FunctionDef: "def", ast.ClassDef: "class", ast.AnnAssign: "an annotation"}
        name = words.get(type(node), type(node).__name__.lower())
        self._report(node, f"'{name}' cannot be used in a block.", _ALLOWED_WAY.get(type(node), ""))


def _sources(text: str, column: int, kind: Kind) -> Iterator[tuple[str, tuple[int, int]]]:
    """Yield what to parse, and what to add to the columns of its first line and of the others.

    An expression may have line ends anywhere. Statements begin in one column; but the first one follows a bracket, so
    it is also tried where the others begin, and four columns before them.
    """
    if kind == "condition":
        yield f"({text}\n)", (column - 1, 1)
        return
    padded = " " * (column - 1) + text
    lines = [line for line in padded.splitlines() if line.strip()]
    indent = len(lines[0]) - len(lines[0].lstrip())
    yield dedented(padded), (indent + 1, indent + 1)
    head, _, rest = text.partition("\n")
    if head.strip() and rest.strip():
        below = [line for line in rest.splitlines() if line.strip()]
        base = min(len(line) - len(line.lstrip()) for line in below)
        first = column + len(head) - len(head.lstrip())
        yield f"{head.strip()}\n{dedented(rest)}", (first, base + 1)
        yield f"{head.strip()}\n{textwrap.indent(dedented(rest), '    ')}", (first, base - 3)


def dedented(text: str) -> str:
    """Return a text without the blanks that all its lines begin with. `textwrap.dedent` takes long for many blanks."""
    lines = text.split("\n")
    margin = min((len(line) - len(line.lstrip()) for line in lines if line.strip()), default=0)
    return "\n".join(line[margin:] for line in lines)


def _is_plain_constant(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and not isinstance(node.value, str)


def stored_names(node: ast.AST) -> set[str]:
    """Return the names that a node assigns; those of a comprehension are its own."""
    found = {node.id} if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) else set()
    if not isinstance(node, (ast.ListComp, ast.GeneratorExp)):
        found.update(name for child in ast.iter_child_nodes(node) for name in stored_names(child))
    return found


def is_name(node: ast.AST, name: str) -> bool:
    """Return whether a node is a name."""
    return isinstance(node, ast.Name) and node.id == name


def part_of(node: ast.Attribute) -> tuple[str, str] | None:
    """Return part and function of `robot.part.function`."""
    if isinstance(node.value, ast.Attribute) and is_name(node.value.value, "robot"):
        return node.value.attr, node.attr
    return None
