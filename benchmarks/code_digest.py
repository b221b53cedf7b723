"""A digest of the code that a measurement runs: syntax trees without docstrings of every module that is reached.

Of the module in which the measuring function stands only that function counts with what it names, so that another
column in a table measures nothing anew. Imports inside functions count; what is found by its place counts where its
folder is named (`folders`).
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).resolve().parents[1]
OURS = ("benchmarks", "stages", "schemas", "cli", "tests")
NOT_MEASURING = ("benchmarks.experiment", "benchmarks.results", "benchmarks.tabulation")
"""What the framework does with records changes none."""
Definitions = dict[str, ast.stmt]


def code_digest(
    function: Callable[..., Any] | None, *, modules: Sequence[str] = (), folders: Sequence[str] = ()
) -> str:
    """Return the sha256 of the function with all it reaches, of further modules, and of whole packages (`folders`)."""
    parts: dict[str, str] = {}
    start = set(modules)
    for folder in folders:
        start |= {_name_of(path) for path in Path(REPOSITORY, *folder.split(".")).rglob("*.py")}
    if function is not None:
        statements = _reached_statements(function.__module__, function.__name__)
        parts[f"{function.__module__}:"] = _dump(statements)
        start |= {name for statement in statements for name in _imports(statement)}
    for module in _closure(start):
        parts[module] = _dump(_tree(module).body)
    return hashlib.sha256(repr(sorted(parts.items())).encode()).hexdigest()


def _closure(start: Iterable[str]) -> set[str]:
    found: set[str] = set()
    waiting = list(start)
    while waiting:
        module = waiting.pop()
        if module not in found and module not in NOT_MEASURING and _path_of(module) is not None:
            found.add(module)
            waiting += _imports_of(module)
    return found


@cache
def _path_of(module: str) -> Path | None:
    if module.split(".")[0] not in OURS:
        return None
    path = Path(REPOSITORY, *module.split("."))
    return next((p for p in (path.with_suffix(".py"), path / "__init__.py") if p.is_file()), None)


def _name_of(path: Path) -> str:
    parts = path.relative_to(REPOSITORY).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def _tree(module: str) -> ast.Module:
    path = _path_of(module)
    assert path is not None
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):  # docstrings, and those below attributes
            node.body = [s for s in body if not _is_text(s)] or [ast.Pass()]  # type: ignore[attr-defined]
    return tree


def _is_text(statement: ast.AST) -> bool:
    return (
        isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    )


def _dump(statements: Sequence[ast.stmt]) -> str:
    return hashlib.sha256("\n".join(map(ast.dump, statements)).encode()).hexdigest()


@cache
def _imports_of(module: str) -> tuple[str, ...]:
    return tuple(_imports(_tree(module)))


def _imports(node: ast.AST) -> Iterator[str]:
    for found in ast.walk(node):
        if isinstance(found, ast.Import):
            yield from (alias.name for alias in found.names)
        elif isinstance(found, ast.ImportFrom) and found.module:
            yield found.module
            yield from (f"{found.module}.{alias.name}" for alias in found.names)


def _reached_statements(module: str, name: str) -> list[ast.stmt]:
    """Return the top-level statements of a module that a name in it needs, imports cut down to what is named."""
    defined: Definitions = {}
    for statement in _tree(module).body:
        for bound in _bound(statement):
            defined[bound] = statement
    found: dict[int, ast.stmt] = {}
    waiting, seen = [name], set()
    while waiting:
        wanted = waiting.pop()
        if wanted in seen or wanted not in defined:
            continue
        seen.add(wanted)
        statement = defined[wanted]
        if isinstance(statement, ast.Import | ast.ImportFrom):
            alias = next(a for a in statement.names if (a.asname or a.name).split(".")[0] == wanted)
            named = ast.Import([alias])
            cut = ast.ImportFrom(statement.module, [alias], 0) if isinstance(statement, ast.ImportFrom) else named
            found[hash((wanted, "import"))] = cut
            continue
        found[id(statement)] = statement
        waiting += [node.id for node in ast.walk(statement) if isinstance(node, ast.Name)]
        waiting += [n.value for n in ast.walk(statement) if isinstance(n, ast.Constant) and isinstance(n.value, str)]
    return sorted(found.values(), key=ast.dump)


def _bound(statement: ast.stmt) -> Iterator[str]:
    if isinstance(statement, ast.FunctionDef | ast.ClassDef):
        yield statement.name
    elif isinstance(statement, ast.Import | ast.ImportFrom):
        yield from ((alias.asname or alias.name).split(".")[0] for alias in statement.names)
    else:
        yield from (n.id for n in ast.walk(statement) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store))
