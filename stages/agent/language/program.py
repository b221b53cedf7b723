"""Programs as they are written: a white list of Python's syntax, read by `ast` and never executed as Python."""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass

from scenewright.schemas.plan import Failure

LONGEST, MOST_NODES, DEEPEST = 20_000, 2_000, 30
"""Characters, nodes and nesting of one program."""
ALLOWED = (
    *(ast.Module, ast.Expr, ast.Assign, ast.If, ast.For, ast.Call, ast.Name, ast.Constant, ast.Load, ast.Store),
    *(ast.Compare, ast.Eq, ast.NotEq, ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.In, ast.NotIn, ast.Is, ast.IsNot),
    *(ast.BoolOp, ast.And, ast.Or, ast.UnaryOp, ast.Not, ast.USub, ast.Subscript, ast.Attribute, ast.List, ast.Tuple),
)
NAMES = {
    "While": "while: loops are `for` over a list, a map or range(n)",
    "FunctionDef": "def",
    "Lambda": "lambda",
    "Import": "import",
    "ImportFrom": "import",
    "BinOp": "arithmetic",
    "JoinedStr": "f-strings: give print several arguments",
    "Try": "try: a failed call returns False",
    "keyword": "named arguments",
    "ListComp": "comprehensions",
}
FENCE = re.compile(r"\A\s*```(?:python)?\n(.*?)\n?```\s*\Z", re.DOTALL)


class PlanError(Exception):
    """A program that is not in the language, or a call that cannot be made: typed, and said back to the brain."""

    def __init__(self, kind: str, message: str, *, line: int = 0, nearest: str = "") -> None:
        meant = f"; did you mean {nearest}?" if nearest else ""
        super().__init__(message + meant)
        self.nearest = nearest
        numbers = {"line": float(line)} if line else {}
        self.failure = Failure(kind=kind, message=(f"line {line}: " if line else "") + message + meant, numbers=numbers)


@dataclass(frozen=True)
class Program:
    """A program that keeps to the white list."""

    text: str
    body: list[ast.stmt]


def parse_program(text: str) -> Program:
    """Read a program; a fence around it is dropped. Raises PlanError: `too_long`, `syntax`, `not_in_language`."""
    fenced = FENCE.match(text)
    text = fenced[1] if fenced else text
    if len(text) > LONGEST:
        raise PlanError("too_long", f"the program has {len(text)} characters, more than {LONGEST}")
    try:
        tree = ast.parse(text)
    except SyntaxError as error:
        raise PlanError("syntax", f"no program: {error.msg}", line=error.lineno or 0) from None
    except (ValueError, RecursionError, MemoryError) as error:
        raise PlanError("syntax", f"no program: {str(error)[:80] or type(error).__name__}") from None
    _check(tree)
    return Program(text, tree.body)


def _check(tree: ast.Module) -> None:
    """Raise PlanError at the first node that is not in the language."""
    waiting: list[tuple[ast.AST, int]] = [(tree, 0)]
    count = 0
    while waiting:
        node, depth = waiting.pop(0)
        line = getattr(node, "lineno", 0)
        count += 1
        if count > MOST_NODES or depth > DEEPEST:
            raise PlanError("too_long", "the program is too large or nested too deeply", line=line)
        if not isinstance(node, ALLOWED):
            name = NAMES.get(type(node).__name__, type(node).__name__.lower())
            raise PlanError("not_in_language", f"not in the language: {name}", line=line)
        if isinstance(node, ast.Assign) and not (len(node.targets) == 1 and isinstance(node.targets[0], ast.Name)):
            raise PlanError("not_in_language", "an assignment is `name = value`", line=line)
        if isinstance(node, ast.For) and (not isinstance(node.target, ast.Name) or node.orelse):
            raise PlanError("not_in_language", "a loop is `for name in list:`", line=line)
        if isinstance(node, ast.Constant) and not isinstance(node.value, bool | int | float | str | None):
            raise PlanError("not_in_language", f"not in the language: {type(node.value).__name__}", line=line)
        waiting += [(child, depth + 1) for child in ast.iter_child_nodes(node)]
