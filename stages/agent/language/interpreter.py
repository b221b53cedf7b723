"""Runs checked programs: our own walk over the white list, with bounds on steps, loops and time."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any

from scenewright.schemas.plan import Failure
from scenewright.stages.agent.language.program import PlanError, Program
from scenewright.stages.agent.language.tools import BY_NAME, sort_of
from scenewright.stages.agent.language.values import ObjectMap, Observation, Outcome, SceneObject, Value, as_text, truth
from scenewright.stages.kit.language.actions import quoted

MOST_STEPS, MOST_ROUNDS, MOST_CALLS = 2_000, 50, 100
"""Statements, rounds of one loop and calls of tools in one program."""
SEEN_OF = {
    SceneObject: ("key", "label", "place", "color", "used", "door", "opened", "on"),
    Observation: ("subject", "labels", "used"),
    Outcome: ("ok", "kind", "message"),
    ObjectMap: (),
}
"""What a program may read of a value."""
COMPARISONS: dict[type[ast.cmpop], Callable[[Any, Any], bool]] = {
    ast.Eq: lambda a, b: a == b,
    ast.NotEq: lambda a, b: a != b,
    ast.Lt: lambda a, b: a < b,
    ast.LtE: lambda a, b: a <= b,
    ast.Gt: lambda a, b: a > b,
    ast.GtE: lambda a, b: a >= b,
    ast.In: lambda a, b: a in (b.objects if isinstance(b, ObjectMap) else b),
    ast.NotIn: lambda a, b: a not in (b.objects if isinstance(b, ObjectMap) else b),
    ast.Is: lambda a, b: a == b,
    ast.IsNot: lambda a, b: a != b,
}
OTHER_CALLS = ("print", "len", "range")
METHODS = ("find", "get")


class Ended(Exception):
    """The program ended the session: `how` is `done`, `give_up` or `ask`, with what it says to the user."""

    def __init__(self, how: str, words: str = "") -> None:
        super().__init__(how)
        self.how, self.words = how, words


@dataclass(frozen=True)
class Called:
    """A call of a tool: its arguments as text, and what came back, or why it could not be made."""

    name: str
    arguments: tuple[str, ...]
    value: Value = None
    error: Failure | None = None


@dataclass
class Ran:
    """What a program came to."""

    calls: list[Called] = field(default_factory=list)
    printed: list[str] = field(default_factory=list)
    error: Failure | None = None
    ended: Ended | None = None


class Interpreter:
    """Keeps variables from one program of a session to the next. `call(name, arguments)` makes the robot do things."""

    def __init__(self, call: Callable[[str, tuple[Value, ...]], Value], out_of_time: Callable[[], bool]) -> None:
        self._call, self._out_of_time = call, out_of_time
        self.variables: dict[str, Value] = {}

    def run(self, program: Program) -> Ran:
        """Run a program to its end, its first error, or the end of the session."""
        self._ran, self._steps = Ran(), 0
        try:
            self._statements(program.body)
        except PlanError as error:
            self._ran.error = error.failure
        except Ended as ended:
            self._ran.ended = ended
        return self._ran

    def _statements(self, body: Iterable[ast.stmt]) -> None:
        for statement in body:
            self._steps += 1
            if self._steps > MOST_STEPS:
                raise PlanError("too_many_steps", f"more than {MOST_STEPS} steps", line=statement.lineno)
            match statement:
                case ast.Assign(targets=[ast.Name(id=name)], value=value):
                    self.variables[name] = self._value(value)
                case ast.Expr(value=value):
                    self._value(value)
                case ast.If(test=test, body=yes, orelse=no):
                    self._statements(yes if truth(self._value(test)) else no)
                case ast.For(target=ast.Name(id=name), iter=over, body=inner):
                    items = self._items(self._value(over), statement.lineno)
                    for item in items:
                        self.variables[name] = item
                        self._statements(inner)

    def _items(self, value: Value, line: int) -> list[Value]:
        if not isinstance(value, tuple | range | ObjectMap):
            raise PlanError("wrong_arguments", f"a loop goes over a list or a map, not a {sort_of(value)}", line=line)
        if len(value.objects if isinstance(value, ObjectMap) else value) > MOST_ROUNDS:
            raise PlanError("too_many_steps", f"a loop of more than {MOST_ROUNDS} rounds", line=line)
        return list(value)

    def _value(self, node: ast.expr) -> Value:
        match node:
            case ast.Constant(value=value):
                return value  # type: ignore[return-value]
            case ast.Name(id=name):
                return self._variable(name, node.lineno)
            case ast.List(elts=items) | ast.Tuple(elts=items):
                return tuple(self._value(item) for item in items)
            case ast.UnaryOp(op=ast.Not(), operand=inner):
                return not truth(self._value(inner))
            case ast.UnaryOp(operand=inner):
                number = self._value(inner)
                if isinstance(number, int | float):
                    return -number
                raise PlanError("wrong_arguments", f"- of a {sort_of(number)}", line=node.lineno)
            case ast.BoolOp(op=op, values=parts):
                deciding = isinstance(op, ast.Or)
                return next((deciding for part in parts if truth(self._value(part)) == deciding), not deciding)
            case ast.Compare(left=left, ops=ops, comparators=rights):
                return self._compare(left, ops, rights, node.lineno)
            case ast.Subscript(value=inner, slice=index):
                return self._item(self._value(inner), self._value(index), node.lineno)
            case ast.Attribute(value=inner, attr=name):
                return self._attribute(self._value(inner), name, node.lineno)
            case ast.Call(func=function, args=arguments):
                return self._call_function(function, tuple(self._value(a) for a in arguments), node.lineno)
        raise PlanError("not_in_language", "not in the language here", line=getattr(node, "lineno", 0))

    def _variable(self, name: str, line: int) -> Value:
        if name not in self.variables:
            raise PlanError(
                "unknown_name", f"there is no {quoted(name)}", line=line, nearest=nearest(name, self.variables)
            )
        return self.variables[name]

    def _compare(self, left: ast.expr, ops: list[ast.cmpop], rights: list[ast.expr], line: int) -> bool:
        first = self._value(left)
        for op, right in zip(ops, rights, strict=True):
            second = self._value(right)
            try:
                if not COMPARISONS[type(op)](first, second):
                    return False
            except TypeError:
                message = f"a {sort_of(first)} and a {sort_of(second)} cannot be compared so"
                raise PlanError("wrong_arguments", message, line=line) from None
            first = second
        return True

    def _item(self, value: Value, index: Value, line: int) -> Value:
        if isinstance(value, ObjectMap) and isinstance(index, str):
            entry = value.get(index)
            if entry is None:
                keys = [item.key for item in value]
                raise PlanError(
                    "unknown_object", f"no {quoted(index)} in the map", line=line, nearest=nearest(index, keys)
                )
            return entry
        if isinstance(value, tuple) and isinstance(index, int) and not isinstance(index, bool):
            if -len(value) <= index < len(value):
                return value[index]
            raise PlanError("unknown_object", f"the list has {len(value)} entries, none at {index}", line=line)
        raise PlanError("wrong_arguments", f"a {sort_of(value)} has no entry {as_text(index)}", line=line)

    def _attribute(self, value: Value, name: str, line: int) -> Value:
        names = next((names for kind, names in SEEN_OF.items() if isinstance(value, kind)), ())
        if name not in names:
            message = f"a {sort_of(value)} has no {quoted(name)}"
            raise PlanError("unknown_name", message, line=line, nearest=nearest(name, names))
        attribute: Value = getattr(value, name)
        return attribute

    def _call_function(self, function: ast.expr, arguments: tuple[Value, ...], line: int) -> Value:
        match function:
            case ast.Attribute(value=ast.Name(id="robot"), attr=name) if "robot" not in self.variables:
                return self._tool(name, arguments, line)
            case ast.Attribute(value=inner, attr=name):
                return self._method(self._value(inner), name, arguments, line)
            case ast.Name(id=name) if name in OTHER_CALLS:
                return self._other(name, arguments, line)
            case ast.Name(id=name):
                return self._tool(name, arguments, line)
        raise PlanError("unknown_call", "what is called has to be a name", line=line)

    def _method(self, value: Value, name: str, arguments: tuple[Value, ...], line: int) -> Value:
        if not isinstance(value, ObjectMap) or name not in METHODS:
            near = nearest(name, METHODS if isinstance(value, ObjectMap) else ())
            raise PlanError("unknown_call", f"a {sort_of(value)} has no {quoted(name)}()", line=line, nearest=near)
        words = [a for a in arguments if isinstance(a, str)]
        if len(words) != len(arguments) or not 1 <= len(words) <= (2 if name == "find" else 1):
            raise PlanError("wrong_arguments", 'write objects.find("cup", "blue") or objects.get("cup_0")', line=line)
        return value.find(*words) if name == "find" else value.get(words[0])

    def _other(self, name: str, arguments: tuple[Value, ...], line: int) -> Value:
        if name == "print":
            self._ran.printed.append(" ".join(a if isinstance(a, str) else as_text(a) for a in arguments)[:2_000])
            return None
        if len(arguments) == 1:
            (value,) = arguments
            if name == "len" and isinstance(value, tuple | range | ObjectMap):
                return len(value.objects if isinstance(value, ObjectMap) else value)
            if name == "range" and isinstance(value, int) and not isinstance(value, bool):
                return range(min(max(0, value), MOST_ROUNDS + 1))
        raise PlanError("wrong_arguments", f"{name} takes one {'number' if name == 'range' else 'list'}", line=line)

    def _tool(self, name: str, arguments: tuple[Value, ...], line: int) -> Value:
        tool = BY_NAME.get(name)
        try:
            if tool is None:
                near = nearest_call(name)
                raise PlanError("unknown_call", f"there is no call {quoted(name)}", line=line, nearest=near)
            fitting = len(arguments) == len(tool.takes) and all(
                sort_of(value) in sorts for value, sorts in zip(arguments, tool.takes, strict=True)
            )
            if not fitting:
                sorts_given = ", ".join(map(sort_of, arguments))
                raise PlanError(
                    "wrong_arguments", f"{name}({sorts_given}) cannot be called", line=line, nearest=tool.signature
                )
            if len(self._ran.calls) >= MOST_CALLS:
                raise PlanError("too_many_steps", f"more than {MOST_CALLS} calls in one program", line=line)
            if self._out_of_time():
                raise PlanError("out_of_time", "the session's time is over", line=line)
            if tool.ends:
                self._ran.calls.append(Called(name, tuple(map(as_text, arguments))))
                raise Ended(name, str(arguments[0])[:500] if arguments else "")
            value = self._call(name, arguments)
        except PlanError as error:
            self._ran.calls.append(Called(name[:80], tuple(map(_argument, arguments)), error=error.failure))
            raise
        self._ran.calls.append(Called(name, tuple(map(_argument, arguments)), value))
        return value


def _argument(value: Value) -> str:
    return value.key if isinstance(value, SceneObject) else as_text(value)[:200]


SYNONYMS = {
    "pick": "grasp",
    "pick_up": "grasp",
    "pickup": "grasp",
    "take": "grasp",
    "put": "place",
    "drop": "place",
    "release": "place",
    "goto": "navigate",
    "go_to": "navigate",
    "move_to": "navigate",
    "drive": "navigate",
    "look": "report_observation",
    "observe": "report_observation",
    "explore": "explore_local",
    "finish": "done",
    "shut": "close",
}
"""What other robots' interfaces call the same."""


def nearest_call(name: str) -> str:
    """Return the signature of the call that was probably meant, or nothing."""
    meant = SYNONYMS.get(name.lower()) or nearest(name, BY_NAME)
    return BY_NAME[meant].signature if meant else ""


def nearest(name: str, names: Iterable[str]) -> str:
    """Return the nearest of some names, or nothing."""
    return next(iter(get_close_matches(name[:80], sorted(names), n=1)), "")
