"""Blocks of an LRP program: Python that is checked, bound to variables, and compiled.

A block is an expression or a few statements. It may compute, read and write variables of the program, and read and
command parts of the robot; nothing else. It ends: loops and large values are counted, see `block_bounds.py`. This
guards a robot against mistakes, and a node against text from an unknown client; it does not isolate a graded program.
"""

from __future__ import annotations

import ast
import warnings
from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, field
from functools import lru_cache, partial
from typing import Any, TypeAlias

from snr_sim.behaviors.block_bounds import HELPERS, MAX_TURNS, MAX_WORK
from snr_sim.behaviors.block_checks import FUNCTIONS, BlockChecker, Found, Kind, Tree, is_name, part_of, stored_names
from snr_sim.behaviors.program import Bindings, Block, Place, Problem

# A helper: its parameters, its expression, and the keys of the variables that it sees, by name.
Definition: TypeAlias = tuple[tuple[str, ...], str, tuple[tuple[str, str], ...]]


@dataclass(frozen=True)
class Scope:
    """What the text of a block may name.

    Args:
        variables: of the program, as seen from the block: the key of each by its name.
        definitions: helpers by name; each may call those before it.
        parts: of the robot: names of the functions of each; None if any part may be named.
        actions: functions of a Python file, by name.
    """

    variables: Mapping[str, str]
    definitions: Mapping[str, Definition]
    parts: Mapping[str, frozenset[str]] | None
    actions: Mapping[str, Callable[..., Any]] = field(default_factory=dict)


def compile_block(text: str, place: Place, kind: Kind, scope: Scope) -> tuple[Block | None, list[Problem]]:
    """Return a block, and what is wrong with it or doubtful; None with an error."""
    compiled = _compile(
        text,
        place.column,
        kind,
        tuple(sorted(scope.variables.items())),
        tuple(scope.definitions.items()),
        None if scope.parts is None else tuple((name, tuple(sorted(one))) for name, one in sorted(scope.parts.items())),
        tuple(scope.actions.items()),
    )
    problems = [
        Problem(Place(place.line + line, column, place.line + end_line, end_column), message, fix, is_error)
        for line, column, end_line, end_column, message, fix, is_error in compiled.problems
    ]
    if compiled.make is None:
        return None, problems
    parts = partial(_parts, text, place, scope) if kind == "condition" else None
    return Block(" ".join(text.split()), place, compiled.make, compiled.drives, parts), problems


def _parts(text: str, place: Place, scope: Scope) -> list[Block]:
    """Return the parts of an expression whose values explain it, each once: calls, variables, what is compared."""
    found: dict[str, None] = {}
    left: list[ast.AST] = [ast.parse(f"({text}\n)", mode="eval").body]
    while left:
        node = left.pop(0)
        if isinstance(node, (ast.BoolOp, ast.Compare, ast.UnaryOp, ast.BinOp, ast.IfExp)):
            left += [child for child in ast.iter_child_nodes(node) if isinstance(child, ast.expr)]
        elif not isinstance(node, ast.Constant) and not _names_any(node, ("random", "log")):
            found[ast.unparse(node)] = None
    blocks = (compile_block(one, place, "condition", scope)[0] for one in found)
    return [one for one in blocks if one is not None]


@dataclass(frozen=True)
class _Compiled:
    make: Callable[[Bindings], Callable[[Any], Any]] | None
    problems: tuple[Found, ...]
    drives: frozenset[str] = frozenset()


@lru_cache(maxsize=4096)
def _compile(
    text: str,
    column: int,
    kind: Kind,
    variables: tuple[tuple[str, str], ...],
    definitions: tuple[tuple[str, Definition], ...],
    parts: tuple[tuple[str, tuple[str, ...]], ...] | None,
    actions: tuple[tuple[str, Callable[..., Any]], ...],
) -> _Compiled:
    """Compile a text once for all places where it means the same; lines of problems count from its first one."""
    arguments = {name: given for name, (given, _, _) in definitions}
    known = None if parts is None else {name: set(verbs) for name, verbs in parts}
    checker = BlockChecker(frozenset(dict(variables)), arguments, known, frozenset(dict(actions)))
    tree = checker.parse(text, column, kind)
    if tree is None or checker.has_errors:
        return _Compiled(None, tuple(checker.problems))
    drives = frozenset(part for part, verb in checker.called if verb in ("start", "stop"))
    return _Compiled(_make(tree, dict(variables), definitions, dict(actions)), tuple(checker.problems), drives)


class _Rewriter(ast.NodeTransformer):
    """Replaces variables by places in a list, and what could take long by calls that count it."""

    def __init__(
        self,
        variables: Mapping[str, str],
        definitions: frozenset[str],
        places: dict[str, str],
        actions: Container[str],
    ) -> None:
        self.variables, self.definitions, self.actions = variables, definitions, actions
        self.places = places  # name of the index of each variable that is used, by key
        self.calls: set[tuple[str, str]] = set()  # functions of parts that are used
        self.is_counting = False

    def visit_Name(self, node: ast.Name) -> ast.expr:
        if node.id in self.variables:
            index = self.places.setdefault(self.variables[node.id], f"_at_{len(self.places)}")
            return ast.Subscript(ast.Name("_v", ast.Load()), ast.Name(index, ast.Load()), node.ctx)
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
            return _helper("_plain", ast.Constant(" and ".join(names)), value)
        return value

    def visit_For(self, node: ast.For) -> ast.AST:
        node.iter = self._turns(self.visit(node.iter))
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
        outer, own = self.variables, {name for one in node.generators for name in stored_names(one.target)}
        for one in node.generators:
            one.iter = self._turns(self.visit(one.iter))
            # Its own names hide variables, as in Python: everywhere but where the first values come from.
            self.variables = {key: place for key, place in outer.items() if key not in own}
            one.ifs = [self.visit(test) for test in one.ifs]
        node.elt = self.visit(node.elt)
        self.variables = outer
        return _helper("_weighed", ast.Name("_m", ast.Load()), _helper("tuple", node))

    def _turns(self, iterable: ast.expr) -> ast.expr:
        self.is_counting = True
        return _helper("_turns", ast.Name("_m", ast.Load()), iterable)

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        left, right = self.visit(node.left), self.visit(node.right)
        name = {ast.Mult: "_multiply", ast.Pow: "_power", ast.LShift: "_shift", ast.Add: "_add", ast.Mod: "_modulo"}
        used = name.get(type(node.op))
        is_plain = type(node.op) in (ast.Mult, ast.Mod) and any(
            isinstance(one, ast.Constant) and type(one.value) is float for one in (node.left, node.right)
        )
        if type(node.op) is ast.Add:  # a number and anything else than a number cannot be added
            is_plain = any(
                isinstance(one, ast.Constant) and type(one.value) in (int, float) for one in (node.left, node.right)
            )
        if used is None or is_plain:
            return ast.BinOp(left, node.op, right)
        self.is_counting = True
        return _helper(used, ast.Name("_m", ast.Load()), left, right)

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        simple = (ast.Constant, ast.Call)
        left, right = self.visit(node.left), [self.visit(one) for one in node.comparators]
        if any(isinstance(one, simple) and _is_number_or_reading(one) for one in (node.left, *node.comparators)):
            return ast.Compare(left, node.ops, right)
        self.is_counting = True
        return ast.Compare(self._sized(left), node.ops, [self._sized(one) for one in right])

    def _sized(self, value: ast.expr) -> ast.expr:
        return _helper("_sized", ast.Name("_m", ast.Load()), value)

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        value, index = self.visit(node.value), self.visit(node.slice)
        made = ast.Subscript(value, index, node.ctx)
        if not isinstance(node.slice, ast.Slice):
            return made
        self.is_counting = True
        return self._sized(made)

    def visit_JoinedStr(self, node: ast.JoinedStr) -> ast.expr:
        self.is_counting = True
        made = [
            ast.FormattedValue(self._sized(self.visit(one.value)), one.conversion, one.format_spec)
            if isinstance(one, ast.FormattedValue)
            else one
            for one in node.values
        ]
        return self._sized(ast.JoinedStr(made))

    def visit_List(self, node: ast.List) -> ast.expr:
        return self.visit_Tuple(ast.Tuple(node.elts, node.ctx))

    def visit_Tuple(self, node: ast.Tuple) -> ast.expr:
        made = ast.Tuple([self.visit(one) for one in node.elts], node.ctx)
        if not isinstance(node.ctx, ast.Load) or not node.elts:
            return made
        self.is_counting = True
        return _helper("_weighed", ast.Name("_m", ast.Load()), made)

    def visit_Call(self, node: ast.Call) -> ast.expr:
        arguments = [self.visit(one) for one in node.args]
        keywords = [ast.keyword(one.arg, self.visit(one.value)) for one in node.keywords]
        function = node.func
        if isinstance(function, ast.Attribute):
            part = part_of(function)
            if part is not None:
                self.calls.add(part)
                return ast.Call(ast.Name(f"_{part[0]}_{part[1]}", ast.Load()), arguments, [])
            if is_name(function.value, "robot"):
                return ast.Call(ast.Attribute(ast.Name("_robot", ast.Load()), "stop", ast.Load()), arguments, [])
            return ast.Call(function, arguments, [])
        assert isinstance(function, ast.Name)
        if function.id in ("random", "log"):
            return ast.Call(_attribute(function.id), arguments, [])
        if function.id in self.definitions:
            return _helper(f"_def_{function.id}", ast.Name("_m", ast.Load()), *arguments)
        if function.id in self.actions:
            return _helper(f"_act_{function.id}", *arguments)
        if function.id in ("abs", "bool", "float", "len"):  # take no longer for what is large
            return ast.Call(function, arguments, [])
        self.is_counting = True
        called = ast.Name(function.id, ast.Load())
        return ast.Call(ast.Name("_counted", ast.Load()), [ast.Name("_m", ast.Load()), called, *arguments], keywords)


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
    variables: Mapping[str, str],
    definitions: tuple[tuple[str, Definition], ...],
    actions: Mapping[str, Callable[..., Any]],
) -> Callable[[Bindings], Callable[[Any], Any]]:
    """Return what binds a block to its place: `make(_v, _robot, indices)` returns the function of the context `_m`."""
    names = frozenset(name for name, _ in definitions)
    places = dict[str, str]()
    rewriter = _Rewriter(variables, names, places, actions)
    used = _called(tree, names)
    body: list[ast.stmt]
    if isinstance(tree, ast.Expression):
        body = [ast.Return(rewriter.visit(tree.body))]
    else:
        body = [rewriter.visit(one) for one in tree.body]
    helpers: list[ast.stmt] = []
    for name, (given, text, seen) in reversed(definitions):  # one may call those before it
        if name in used:
            expression = ast.parse(f"({text}\n)", mode="eval").body
            used |= _called(expression, names)
            inner = _Rewriter({key: place for key, place in seen if key not in given}, names, places, actions)
            made = ast.Return(inner.visit(expression))
            helpers.insert(0, _function(f"_def_{name}", ["_m", *given], [made]))
            rewriter.calls |= inner.calls
            rewriter.is_counting = rewriter.is_counting or inner.is_counting
    if rewriter.is_counting:
        body = [*ast.parse(f"_m.turns = {MAX_TURNS}; _m.work = {MAX_WORK}").body, *body]
    prepared = [ast.parse(f"_{part}_{verb} = _robot.{part}.{verb}").body[0] for part, verb in sorted(rewriter.calls)]
    block = _function("block", ["_m"], body)
    result = ast.Return(ast.Name("block", ast.Load()))
    outer = _function("make", ["_v", "_robot", *places.values()], [*prepared, *helpers, block, result])
    module = ast.fix_missing_locations(ast.Module([outer], []))
    called = {f"_act_{name}": function for name, function in actions.items()}
    known: dict[str, Any] = {**FUNCTIONS, **HELPERS, **called, "__builtins__": {}}
    with warnings.catch_warnings():  # such as of (-1)[0], which fails when it is executed
        warnings.simplefilter("ignore")
        code = compile(module, "<block>", "exec")
    exec(code, known)
    make = known["make"]
    return lambda bindings: make(bindings.slots, bindings.robot, *(bindings.index[key] for key in places))


def _called(tree: ast.AST, names: frozenset[str]) -> set[str]:
    return {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and node.id in names}


def _function(name: str, parameters: list[str], body: list[ast.stmt]) -> ast.FunctionDef:
    template = ast.parse("def f(): pass").body[0]
    assert isinstance(template, ast.FunctionDef)
    template.name, template.body = name, body
    template.args.args = [ast.arg(one) for one in parameters]
    return template
