"""Find the messages of the program that name an option or a command."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from scenewright.cli import housekeeping
from scenewright.stages.engine.discovery import all_stages

ROOT = Path(__file__).resolve().parents[2]
PLACES = ("cli", "stages", "schemas")
COMMANDS = {
    *(function.__name__.replace("_", "-") for function, _ in housekeeping.COMMANDS),
    *(name for name, *_ in housekeeping.GROUPS),
    *(name.split()[0] for name in all_stages()),
    "train",
}
"""First words of all commands."""
ADVISES = re.compile(
    r"(?<![\w-])--[a-z][a-z0-9-]+|`scenewright |\bscenewright (?:" + "|".join(sorted(COMMANDS)) + r")\b|\bpip install\b"
    r"|\bexport [A-Z{]"
)
DECLARATIONS = {
    *("Argument", "Option", "option", "Field", "Stage", "External", "Extra", "BackendDeclaration"),
    *("TrainingDeclaration", "add_argument", "add_parser", "ArgumentParser", "compile", "add_typer", "command"),
    "_script",
}
"""Calls whose strings are help texts or names, which `tests/contract/test_docs.py` reads, or scripts."""


@dataclass(frozen=True)
class Message:
    """A string of the source, `{}` where a value stands."""

    path: str
    line: int
    text: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.text}"


def messages() -> list[Message]:
    """Return the messages of `cli`, `stages` and `schemas`, in order of place."""
    files = [path for place in PLACES for path in sorted((ROOT / place).rglob("*.py"))]
    return [message for path in files for message in messages_of(path.read_text(), str(path.relative_to(ROOT)))]


def messages_of(source: str, path: str) -> Iterator[Message]:
    """Yield the messages of one file: no docstrings, help texts, scripts, or words that stand alone."""
    tree = ast.parse(source)
    passed_over = {id(inner) for node in ast.walk(tree) for inner in _not_messages(node)}
    for node in ast.walk(tree):
        text = None if id(node) in passed_over else _text(node)
        if text is not None and ADVISES.search(text) and " " in text.strip() and not text.startswith("#!"):
            yield Message(path, node.lineno, text)  # type: ignore[attr-defined]


def _not_messages(node: ast.AST) -> Iterator[ast.AST]:
    """Yield what below a node is no message of its own."""
    if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
        strings = [entry for entry in node.body if isinstance(entry, ast.Expr)]
        yield from (entry.value for entry in strings if isinstance(entry.value, ast.Constant))
    elif isinstance(node, ast.Call) and ast.unparse(node.func).rsplit(".", 1)[-1] in DECLARATIONS:
        yield from ast.walk(node)
    elif isinstance(node, ast.JoinedStr | ast.BinOp | ast.Call) and _text(node) is not None:
        inner = ast.iter_child_nodes(node)
        yield from (each.value if isinstance(each, ast.keyword) else each for each in inner)


def _text(node: ast.AST) -> str | None:
    """Return the text of a string, a formatted string, a sum of them, or an error that is made of two of them (a
    message and its hint); None for anything else."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else None
    if isinstance(node, ast.JoinedStr):
        return "".join(str(part.value) if isinstance(part, ast.Constant) else "{}" for part in node.values)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        parts = _text(node.left), _text(node.right)
        return None if parts == (None, None) else "".join("{}" if part is None else part for part in parts)
    if isinstance(node, ast.Call) and node.args and [keyword.arg for keyword in node.keywords] == ["hint"]:
        message, hint = _text(node.args[0]), _text(node.keywords[0].value)
        return None if message is None or hint is None else f"{message} ({hint})"
    return None
