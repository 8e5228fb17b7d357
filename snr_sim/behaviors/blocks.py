"""Blocks of an LRP program: Python that is checked, bound to variables, and compiled.

A block is an expression or a few statements. It may compute, read and write variables of the program, and read and
command parts of the robot; nothing else. It ends: loops and large values are counted, see `block_bounds.py`. This
guards a robot against mistakes, and a node against text from an unknown client; it does not isolate a graded program.
"""

from __future__ import annotations

import ast
import re
import warnings
from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from typing import Any, TypeAlias

from snr_sim.behaviors.block_bounds import HELPERS, MAX_CODE, MIN_WORK
from snr_sim.behaviors.block_checks import (
    FUNCTIONS,
    BlockChecker,
    Found,
    Kind,
    Tree,
    dedented,
    is_name,
    part_of,
    stored_names,
)
from snr_sim.behaviors.bridge import DRIVE_FUNCTIONS, READ_FUNCTIONS
from snr_sim.behaviors.program import Bindings, Block, Place, Problem

Actions: TypeAlias = tuple[tuple[str, Callable[..., Any]], ...]
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


@dataclass(frozen=True, eq=False)
class Definition:
    """A helper, with what its expression may name: keys of variables, helpers, and actions, by name."""

    parameters: tuple[str, ...]
    text: str
    variables: tuple[tuple[str, str], ...]
    definitions: tuple[tuple[str, Definition], ...]
    actions: Actions
    cost: int  # of its code, and that of the helpers which it calls


@lru_cache(maxsize=4096)
def define(
    parameters: tuple[str, ...],
    text: str,
    variables: tuple[tuple[str, str], ...],
    definitions: tuple[tuple[str, Definition], ...],
    actions: Actions = (),
) -> Definition:
    """Return a helper. Equal ones are one object: so a block that calls it is not compiled again after an edit."""
    cost = cost_of(_expression(text), {name: one.cost for name, one in definitions})
    return Definition(parameters, text, variables, definitions, actions, cost)


@dataclass(frozen=True)
class Scope:
    """What the text of a block may name.

    Args:
        variables: of the program, as seen from the block: the key of each by its name.
        definitions: helpers by name.
        parts: of the robot: names of the functions of each; None if any part may be named.
        actions: functions of a Python file, by name.
    """

    variables: Mapping[str, str]
    definitions: Mapping[str, Definition]
    parts: Mapping[str, frozenset[str]] | None
    actions: Mapping[str, Callable[..., Any]] = field(default_factory=dict)

    def of(self, text: str) -> Scope:
        """Return what a text names of it, in one order: other names then make no other block of the text."""
        if not text.isascii():  # Python takes some other letters for those of ASCII
            return self
        named = sorted(set(_NAME.findall(text)))
        variables = {name: self.variables[name] for name in named if name in self.variables}
        definitions = {name: self.definitions[name] for name in named if name in self.definitions}
        return Scope(variables, definitions, self.parts, self.actions)


def compile_block(text: str, place: Place, kind: Kind, scope: Scope) -> tuple[Block | None, list[Problem]]:
    """Return a block, and what is wrong with it or doubtful; None with an error."""
    parts = (
        None if scope.parts is None else tuple((name, tuple(sorted(one))) for name, one in sorted(scope.parts.items()))
    )
    at = place.column if "\n" in text else 1  # its lines are aligned with the first one
    shift = place.column - at
    for seen in (scope.of(text), scope):  # all that it may name is needed to suggest a name
        variables, definitions = tuple(sorted(seen.variables.items())), tuple(seen.definitions.items())
        block, found = _compile(text, at, kind, variables, definitions, parts, tuple(scope.actions.items()))
        if block is not None:
            break
    problems = [
        Problem(Place(place.line + line, shift + column, place.line + end_line, shift + end), message, fix, is_error)
        for line, column, end_line, end, message, fix, is_error in found
    ]
    if block is None:
        return None, problems
    return replace(
        block, place=place, parts=partial(_parts, text, place, scope) if kind == "condition" else None
    ), problems


def _parts(text: str, place: Place, scope: Scope) -> list[Block]:
    """Return the parts of an expression whose values explain it, each once: calls, variables, what is compared."""
    found: dict[str, None] = {}
    left: list[ast.AST] = [_expression(text)]
    while left:
        node = left.pop(0)
        if isinstance(node, (ast.BoolOp, ast.Compare, ast.UnaryOp, ast.BinOp, ast.IfExp)):
            left += [child for child in ast.iter_child_nodes(node) if isinstance(child, ast.expr)]
        elif not isinstance(node, ast.Constant) and not _names_any(node, ("random", "log")):
            found[ast.unparse(node)] = None
    blocks = (compile_block(one, place, "condition", scope)[0] for one in found)
    return [one for one in blocks if one is not None]


@dataclass(frozen=True)
class _Make:
    """Binds a block to its place. Equal ones do the same: their texts mean the same, and draw no random number."""

    meaning: object
    make: Callable[..., Callable[[Any], Any]] = field(compare=False)
    keys: tuple[str, ...]
    code: str = field(compare=False)  # with that of the helpers that it calls
    reads: frozenset[str] = field(compare=False)
    polls: str = field(compare=False)

    def __call__(self, bindings: Bindings) -> Callable[[Any], Any]:
        """Return the function of the context."""
        return self.make(bindings.slots, bindings.robot, *(bindings.index[key] for key in self.keys))


@lru_cache(maxsize=4096)
def _compile(
    text: str,
    column: int,
    kind: Kind,
    variables: tuple[tuple[str, str], ...],
    definitions: tuple[tuple[str, Definition], ...],
    parts: tuple[tuple[str, tuple[str, ...]], ...] | None,
    actions: Actions,
) -> tuple[Block | None, tuple[Found, ...]]:
    """Compile a text once for all places where it means the same; lines of problems count from its first one."""
    arguments = {name: one.parameters for name, one in definitions}
    known = None if parts is None else {name: set(verbs) for name, verbs in parts}
    checker = BlockChecker(frozenset(dict(variables)), arguments, known, frozenset(dict(actions)))
    tree = checker.parse(text, column, kind)
    if tree is None or checker.has_errors:
        return None, tuple(checker.problems)
    if cost_of(tree, {name: one.cost for name, one in definitions}) > MAX_CODE:
        large = 0, column, 0, column, "The block and the helpers that it calls are too large.", "simplify them.", True
        return None, (*checker.problems, large)
    written = dedented(" " * (column - 1) + text).strip()
    keys = dict(variables)
    writes = frozenset(keys[name] for name in stored_names(tree) if name in keys)
    is_atomic = _is_atomic(tree) and not definitions  # before it is rewritten; a helper may command
    make = _make(tree, variables, definitions, actions)
    drives = frozenset(part for part, verb in checker.called if part and verb in DRIVE_FUNCTIONS)
    block = Block(written, Place(), make, drives, writes, make.keys, is_atomic, make.reads, make.polls)
    return block, tuple(checker.problems)


def _is_atomic(tree: Tree) -> bool:
    """Return whether a block that raises has changed nothing: its one assignment or command comes after all else."""
    changes = [one for one in ast.walk(tree) if isinstance(one, (ast.Assign, ast.AugAssign, ast.For)) or _commands(one)]
    if not changes:
        return True
    last: Any = tree.body[-1] if isinstance(tree, ast.Module) else None
    last = last.value if isinstance(last, ast.Expr) else last
    targets = last.targets if isinstance(last, ast.Assign) else []
    return changes == [last] and not isinstance(last, ast.For) and all(isinstance(one, ast.Name) for one in targets)


def _commands(node: ast.AST) -> bool:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in DRIVE_FUNCTIONS


_HELPER_OF: dict[type[ast.operator], str] = {
    ast.Mult: "_multiply", ast.Pow: "_power", ast.LShift: "_shift", ast.Mod: "_modulo",
}  # fmt: skip


class _Rewriter(ast.NodeTransformer):
    """Replaces variables by places in a list, and what could take long by calls that count it."""

    def __init__(self) -> None:
        self.variables: Mapping[str, str] = {}
        self.definitions: Mapping[str, Definition] = {}
        self.actions: Mapping[str, Callable[..., Any]] = {}
        self.costs: Mapping[str, int] = {}
        self.places: dict[str, str] = {}  # name of the index of each variable that is used, by key
        self.calls: set[tuple[str, str]] = set()  # functions of parts that are used
        self.helpers: dict[Definition, str] = {}  # names of those that are called, in order of their first call
        self.known: dict[str, Any] = {**FUNCTIONS, **HELPERS, "__builtins__": {}}
        self.is_counting = False
        self.is_random = False
        self.polls = ""  # what changes without a page

    def enter(
        self, variables: Mapping[str, str], definitions: tuple[tuple[str, Definition], ...], actions: Actions
    ) -> None:
        """Begin with a piece of code that may name these."""
        self.variables, self.definitions, self.actions = variables, dict(definitions), dict(actions)
        self.costs = {name: one.cost for name, one in definitions}

    def visit_Name(self, node: ast.Name) -> ast.expr:
        if node.id in self.variables:
            index = self.places.setdefault(self.variables[node.id], f"_at_{len(self.places)}")
            return ast.Subscript(ast.Name("_v", ast.Load()), ast.Name(index, ast.Load()), node.ctx)
        if node.id in ("now_ms", "in_state_ms"):
            self.polls = node.id
        if node.id == "now_ms":
            return ast.BinOp(_attribute("now_ns"), ast.Div(), ast.Constant(1e6))
        if node.id in ("in_state_ms", "signal"):
            return _attribute(node.id)
        return node

    def visit_Assign(self, node: ast.Assign) -> ast.AST:
        node.value = self._kept(node.targets, self.visit(node.value))
        node.targets = [self.visit(one) for one in node.targets]
        return node

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST:
        read = ast.copy_location(ast.Name(getattr(node.target, "id", ""), ast.Load()), node.target)
        value = self.visit(ast.copy_location(ast.BinOp(read, node.op, node.value), node))
        return ast.Assign([self.visit(node.target)], self._kept([node.target], value))

    def _kept(self, targets: list[ast.expr], value: ast.expr) -> ast.expr:
        """Return a value as it is kept: of a program's variable, a plain one."""
        names = [one.id for target in targets for one in ast.walk(target) if isinstance(one, ast.Name)]
        if any(name in self.variables for name in names):
            helper = "_plain" if len(names) == 1 else "_plain_each"
            return _helper(helper, ast.Constant(" and ".join(names)), value)
        return value

    def visit_For(self, node: ast.For) -> ast.AST:
        cost = sum(cost_of(one, self.costs) for one in node.body)  # exact: integers
        node.iter = self._turns(cost, self.visit(node.iter))
        inner = ast.Name("_each", ast.Store()) if _names_any(node.target, self.variables) else None
        if inner is not None:  # a program's variable is assigned as in an assignment
            first = ast.Assign([node.target], ast.Name("_each", ast.Load()))
            node.target, node.body = inner, [first, *node.body]
        node.body = [self.visit(one) for one in node.body]
        node.orelse = [self.visit(one) for one in node.orelse]
        return node

    def visit_ListComp(self, node: ast.ListComp) -> ast.expr:
        return self._comprehension(node)

    def visit_GeneratorExp(self, node: ast.GeneratorExp) -> ast.expr:
        return self._comprehension(ast.ListComp(node.elt, node.generators))

    def _comprehension(self, node: ast.ListComp) -> ast.expr:
        cost = cost_of(node, self.costs)
        outer, own = self.variables, {name for one in node.generators for name in stored_names(one.target)}
        for one in node.generators:
            one.iter = self._turns(cost, self.visit(one.iter))
            # Its own names hide variables, as in Python: everywhere but where the first values come from.
            self.variables = {key: place for key, place in outer.items() if key not in own}
            one.ifs = [self.visit(test) for test in one.ifs]
        node.elt = self.visit(node.elt)
        self.variables = outer
        return self._counting("_made", _helper("tuple", node))

    def _turns(self, cost: int, iterable: ast.expr) -> ast.expr:
        return self._counting("_turns", ast.Constant(cost), iterable)

    def _counting(self, name: str, *arguments: ast.expr) -> ast.expr:
        self.is_counting = True
        return _helper(name, ast.Name("_m", ast.Load()), *arguments)

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        left, right, kind = self.visit(node.left), self.visit(node.right), type(node.op)
        made = ast.BinOp(left, node.op, right)
        constants = [type(one.value) for one in (node.left, node.right) if isinstance(one, ast.Constant)]
        if kind in _HELPER_OF and float not in constants:
            return self._counting(_HELPER_OF[kind], left, right)
        # Of a number and anything else than a number there is no sum.
        return made if kind is not ast.Add or float in constants or int in constants else self._counting("_made", made)

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        values = [node.left, *node.comparators]
        is_search = any(isinstance(one, (ast.In, ast.NotIn)) for one in node.ops)
        is_plain = not is_search and any(_is_number_or_reading(one) for one in values)
        left, *right = (
            one if is_plain else self._counting("_looked_at", one) for one in [self.visit(one) for one in values]
        )
        return ast.Compare(left, node.ops, right)

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        made = ast.Subscript(self.visit(node.value), self.visit(node.slice), node.ctx)
        return self._counting("_made", made) if isinstance(node.slice, ast.Slice) else made

    def visit_JoinedStr(self, node: ast.JoinedStr) -> ast.expr:
        for one in node.values:
            if isinstance(one, ast.FormattedValue):
                one.value = self._counting("_looked_at", self.visit(one.value))
        return self._counting("_made", node)

    def visit_List(self, node: ast.List) -> ast.expr:
        return self.visit_Tuple(ast.Tuple(node.elts, node.ctx))

    def visit_Tuple(self, node: ast.Tuple) -> ast.expr:
        made = ast.Tuple([self.visit(one) for one in node.elts], node.ctx)
        is_made = isinstance(node.ctx, ast.Load) and not all(isinstance(one, ast.Constant) for one in node.elts)
        return self._counting("_made", made) if is_made else made

    def visit_Call(self, node: ast.Call) -> ast.expr:
        arguments = [self.visit(one) for one in node.args]
        keywords = [ast.keyword(one.arg, self.visit(one.value)) for one in node.keywords]
        function = node.func
        if isinstance(function, ast.Attribute):
            part = part_of(function)
            if part is not None:
                self.calls.add(part)
                if part[1] == "age_ms":
                    self.polls = f"robot.{part[0]}.age_ms()"
                return ast.Call(ast.Name(f"_{part[0]}_{part[1]}", ast.Load()), arguments, [])
            if is_name(function.value, "robot"):
                return ast.Call(ast.Attribute(ast.Name("_robot", ast.Load()), "stop", ast.Load()), arguments, [])
            if function.attr == "dist":
                arguments = [self._counting("_looked_at", one) for one in arguments]
            return ast.Call(function, arguments, [])
        assert isinstance(function, ast.Name)
        if function.id == "random":
            self.is_random, self.polls = True, "random()"
            return ast.Call(_attribute(function.id), arguments, [])
        if function.id == "log":
            return ast.Call(_attribute(function.id), [self._counting("_looked_at", one) for one in arguments], [])
        if function.id in self.definitions:
            name = self.helpers.setdefault(self.definitions[function.id], f"_def_{len(self.helpers)}")
            return _helper(name, ast.Name("_m", ast.Load()), *arguments)
        if function.id in self.actions:
            name = f"_act_{function.id}"
            while self.known.setdefault(name, self.actions[function.id]) is not self.actions[function.id]:
                name += "_"  # another file has one of this name
            return _helper(name, *arguments)
        if function.id in ("abs", "bool", "len"):  # take no longer for what is large
            return ast.Call(function, arguments, [])
        made = self._counting("_counted", ast.Name(function.id, ast.Load()), *arguments)
        assert isinstance(made, ast.Call)
        made.keywords = keywords
        return made


def cost_of(node: ast.AST, costs: Mapping[str, int]) -> int:
    """Return the size of a piece of code, with that of the helpers that it calls."""
    own = [one for one in ast.walk(node) if isinstance(one, (ast.expr, ast.stmt))]
    return sum(4 * isinstance(one, ast.Call) + costs.get(getattr(one, "id", ""), 1) for one in own)  # exact: integers


def _attribute(name: str) -> ast.expr:
    return ast.Attribute(ast.Name("_m", ast.Load()), name, ast.Load())


def _helper(name: str, *arguments: ast.expr) -> ast.expr:
    return ast.Call(ast.Name(name, ast.Load()), list(arguments), [])


def _names_any(node: ast.AST, names: Container[str]) -> bool:
    return any(isinstance(one, ast.Name) and one.id in names for one in ast.walk(node))


def _is_number_or_reading(node: ast.expr) -> bool:
    if isinstance(node, ast.Constant):
        return type(node.value) in (int, float, bool) or node.value is None
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)  # a reading


def _make(
    tree: Tree,
    variables: tuple[tuple[str, str], ...],
    definitions: tuple[tuple[str, Definition], ...],
    actions: Actions,
) -> _Make:
    """Return what binds a block to its place: `make(_v, _robot, indices)` returns the function of the context `_m`."""
    rewriter, text = _Rewriter(), ast.unparse(tree)
    rewriter.enter(dict(variables), definitions, actions)
    if isinstance(tree, ast.Expression):
        body: list[ast.stmt] = [ast.Return(rewriter.visit(tree.body))]
    else:
        body = [rewriter.visit(one) for one in tree.body]
    helpers: list[ast.stmt] = []
    while len(helpers) < len(rewriter.helpers):
        one, name = list(rewriter.helpers.items())[len(helpers)]
        seen = {key: place for key, place in one.variables if key not in one.parameters}
        rewriter.enter(seen, one.definitions, one.actions)
        helpers.append(_function(name, ["_m", *one.parameters], [ast.Return(rewriter.visit(_expression(one.text)))]))
    if rewriter.is_counting:
        body = [*ast.parse(f"if _m.work < {MIN_WORK}: _m.work = {MIN_WORK}").body, *body]
    prepared = [ast.parse(f"_{part}_{verb} = _robot.{part}.{verb}").body[0] for part, verb in sorted(rewriter.calls)]
    block = _function("block", ["_m"], body)
    result = ast.Return(ast.Name("block", ast.Load()))
    outer = _function("make", ["_v", "_robot", *rewriter.places.values()], [*prepared, *helpers, block, result])
    module = ast.Module([outer], [])
    _place(module)
    with warnings.catch_warnings():  # such as of (-1)[0], which fails when it is executed
        warnings.simplefilter("ignore")
        code = compile(module, "<block>", "exec")
    exec(code, rewriter.known)
    meaning = object() if rewriter.is_random else (text, variables, definitions, actions)
    whole = "; ".join([text, *(one.text for one in rewriter.helpers)])
    reads = frozenset(part for part, verb in rewriter.calls if verb in READ_FUNCTIONS)
    return _Make(meaning, rewriter.known["make"], tuple(rewriter.places), whole, reads, rewriter.polls)


def _expression(text: str) -> ast.expr:
    return ast.parse(f"({text}\n)", mode="eval").body


def _function(name: str, parameters: list[str], body: list[ast.stmt]) -> ast.FunctionDef:
    arguments = ast.arguments(
        posonlyargs=[], args=[ast.arg(one) for one in parameters], kwonlyargs=[], kw_defaults=[], defaults=[]
    )
    made: dict[str, Any] = {"name": name, "args": arguments, "body": body, "decorator_list": [], "type_params": []}
    return ast.FunctionDef(**made)


def _place(tree: ast.AST) -> None:
    """Give all nodes the place that `compile` needs, as `ast.fix_missing_locations` does, in a third of the time."""
    left = [tree]
    while left:
        node: Any = left.pop()
        node.lineno = node.end_lineno = 1
        node.col_offset = node.end_col_offset = 0
        for one in vars(node).values():
            if isinstance(one, list):
                left += [child for child in one if isinstance(child, ast.AST)]
            elif isinstance(one, ast.AST) and not isinstance(one, ast.expr_context | ast.operator):
                left.append(one)
