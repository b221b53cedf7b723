"""What a step's code is: every definition that its `run` reaches through our modules, in a form in which only meaning
counts.

Definitions are followed, not files: from `run` and the parameters' class to every function, class and constant that
they name, through imports at the top, imports inside functions, and modules imported by name. Where a name cannot be
followed, everything it may be is taken. What is hashed knows no names of modules, definitions and local variables, no
imports, comments, docstrings, type annotations (those of class bodies count: pydantic and dataclasses read them), log
lines, nor descriptions in declarations. So moving, splitting and renaming change nothing; a constant or a line does.
Nothing is imported or run: the tree read may be that of another commit.
"""

from __future__ import annotations

import ast
import hashlib
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from scenewright.stages.engine.code.places import OURS, Places

DECLARED_IN = {"Field", "Stage", "External"}
"""Calls whose `description`, `summary` and `example` are for people."""
FOR_PEOPLE = {"description", "summary", "example", "title"}
LOGGERS = {"logger", "_logger", "log", "logging"}
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)
DEFINING = (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef, ast.Assign, ast.AnnAssign)
COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)

Imported = tuple[str, str | None]
"""Module, and the name taken from it; None for the module itself."""


@dataclass(frozen=True)
class Definition:
    """A name of a module: `scenewright.stages.fuse.mapping`, `PanopticMapper`."""

    module: str
    name: str


@dataclass
class Module:
    """One file: which statement defines a name, what is imported as which name, and what runs besides."""

    name: str
    definitions: dict[str, ast.stmt] = field(default_factory=dict)
    imports: dict[str, list[Imported]] = field(default_factory=lambda: defaultdict(list))
    libraries: dict[str, str] = field(default_factory=dict)
    """Name -> what it is of other people's libraries (`np`: `numpy`, `label`: `scipy.ndimage.label`)."""
    loose: list[ast.stmt] = field(default_factory=list)
    """What runs when the module is loaded: statements at the top that are no plain definition, import or docstring."""


@dataclass(frozen=True)
class Whole:
    """A module whose every definition may be meant."""

    module: str


@dataclass(frozen=True)
class Written:
    """A statement as it is hashed: text, and between it the definitions and modules that it names."""

    parts: tuple[str | Definition | Whole | None, ...]
    """None: modules that cannot be known, so all of the step's folder."""
    shown: str
    """Digest with the names of our definitions, by which a change is found again."""
    texts: frozenset[str]
    """Its short texts that look like the name of a file."""


@dataclass(frozen=True)
class Code:
    """Digest of all that is reached, and digests of what is reached in each module, by which a change is named."""

    digest: str
    modules: dict[str, str]
    texts: frozenset[str]
    """Texts in it that look like the name of a file."""


class Program:
    """The modules of some places, read when they are asked for."""

    def __init__(self, places: Places) -> None:
        self.places = places
        self.module = cache(self._read)
        self.file = cache(places.file)
        self.beneath = cache(places.beneath)
        self._written: dict[int, Written] = {}

    def is_ours(self, name: str) -> bool:
        """Whether a dotted name is a module or package that is followed."""
        return self.file(name) is not None

    def _read(self, name: str) -> Module:
        file = self.file(name)
        assert file is not None, name
        module = Module(name)
        try:
            tree = ast.parse(file.read_text(encoding="utf-8"))
        except SyntaxError:  # an installed package that cannot be imported either, and is left out
            return module
        package = name if file.name == "__init__.py" else name.rpartition(".")[0]
        self._enter(module, tree.body, package)
        return module

    def _enter(self, module: Module, statements: list[ast.stmt], package: str) -> None:
        for statement in statements:
            if isinstance(statement, (ast.Import, ast.ImportFrom)):
                self.add_imports(module, statement, package)
            elif isinstance(statement, ast.If) and _for_types_only(statement):
                for inner in statement.body:
                    self.add_imports(module, inner, package)
                self._enter(module, statement.orelse, package)
            elif not _is_docstring(statement):
                bound = _bound_at_top(statement)
                again = not bound or bool(bound.keys() & module.definitions.keys())
                for name in bound:
                    module.definitions.setdefault(name, statement)
                if again or not isinstance(statement, DEFINING) or self._decorated_by_us(module, statement):
                    module.loose.append(statement)

    def _decorated_by_us(self, module: Module, statement: ast.stmt) -> bool:
        """A decorator of ours may enter the definition somewhere, so that nobody has to name it."""
        names = {
            inner.id
            for decorator in getattr(statement, "decorator_list", ())
            for inner in ast.walk(decorator)
            if isinstance(inner, ast.Name)
        }
        return bool(names & (module.definitions.keys() | module.imports.keys()))

    def add_imports(self, module: Module, node: ast.AST, package: str) -> None:
        """Enter what an import statement binds."""
        if isinstance(node, ast.Import):
            for alias in node.names:
                bound = alias.asname or alias.name.split(".")[0]
                whole = alias.name if alias.asname else bound
                if self.is_ours(alias.name):
                    module.imports[bound].append((whole, None))
                else:
                    module.libraries[bound] = whole
        elif isinstance(node, ast.ImportFrom):
            source = node.module or ""
            if node.level:
                above = package.split(".")[: len(package.split(".")) - node.level + 1]
                source = ".".join([*above, *([source] if source else [])])
            for alias in node.names:
                bound, whole = alias.asname or alias.name, f"{source}.{alias.name}"
                if self.is_ours(source):
                    module.imports[bound].append((whole, None) if self.is_ours(whole) else (source, alias.name))
                else:
                    module.libraries[bound] = whole

    def written(self, module: str, statement: ast.stmt) -> Written:
        """Write a statement out, once."""
        if id(statement) not in self._written:
            self._written[id(statement)] = _Writer(self, self.module(module), statement).written()
        return self._written[id(statement)]

    def code_of(self, roots: list[Definition | Whole]) -> Code:
        """Digest everything that definitions, or whole modules, reach. Raises KeyError for one that does not exist."""
        for root in roots:
            if not self.is_ours(root.module):
                raise KeyError(f"no module {root.module}")
            if isinstance(root, Definition) and root.name not in self.module(root.module).definitions:
                raise KeyError(f"{root.module} defines no {root.name}")
        reach = _Reach(self, roots[0].module.rpartition(".")[0])
        for root in roots:
            reach.text(root)
        whole = hashlib.sha256()
        per_module: dict[str, list[str]] = defaultdict(list)
        texts: set[str] = set()
        for module, statement in reach.statements():
            written = self.written(module, statement)
            whole.update(" ".join(reach.text(part) for part in written.parts).encode())
            per_module[module].append(written.shown)
            texts |= written.texts
        return Code(
            whole.hexdigest(),
            {
                name: hashlib.sha256("".join(sorted(parts)).encode()).hexdigest()[:12]
                for name, parts in sorted(per_module.items())
            },
            frozenset(texts),
        )


class _Reach:
    """The definitions found so far, numbered in the order in which they are first named."""

    def __init__(self, program: Program, home: str) -> None:
        self._program, self._home = program, home
        self._numbers: dict[int, int] = {}
        self._waiting: list[tuple[str, ast.stmt]] = []
        self._modules: set[str] = set()

    def statements(self) -> Iterator[tuple[str, ast.stmt]]:
        """Every statement reached; reading the text of one may add more."""
        place = 0
        while place < len(self._waiting):
            yield self._waiting[place]
            place += 1

    def text(self, part: str | Definition | Whole | None) -> str:
        """What is hashed of a part; what it names is reached."""
        if isinstance(part, str):
            return part
        if isinstance(part, Definition):
            return "#" + self.number(part)
        self._everything(part.module if part else self._home)
        return "#module"

    def number(self, definition: Definition) -> str:
        """Reach a definition: the number of its statement, and which of that statement's names it is."""
        module = self._program.module(definition.module)
        if definition.name not in module.definitions:  # passed on by a module, or not there (then Python would say so)
            passed = module.imports.get(definition.name, [])
            return "".join(self.text(Definition(m, name) if name else Whole(m)) for m, name in passed) or "?"
        statement = module.definitions[definition.name]
        self._enter(definition.module)
        self._add(definition.module, statement)
        names = list(_bound_at_top(statement))
        return f"{self._numbers[id(statement)]}.{names.index(definition.name)}"

    def _add(self, module: str, statement: ast.stmt) -> None:
        if id(statement) not in self._numbers:
            self._numbers[id(statement)] = len(self._numbers)
            self._waiting.append((module, statement))

    def _everything(self, module: str) -> None:
        """Reach all that a module and those below it define."""
        for name in self._program.beneath(module):
            if self._program.is_ours(name):
                self._enter(name)
                for defined in self._program.module(name).definitions:
                    self.number(Definition(name, defined))

    def _enter(self, module: str) -> None:
        """What runs when a module is loaded, and when its packages are, belongs to it."""
        parts = module.split(".")
        for name in (".".join(parts[:depth]) for depth in range(1, len(parts) + 1)):
            if name not in self._modules and self._program.is_ours(name):
                self._modules.add(name)
                for statement in self._program.module(name).loose:
                    self._add(name, statement)


class _Writer:
    """Writes one statement out, twice: as it counts for a step, and as it is shown when it changed."""

    def __init__(self, program: Program, module: Module, statement: ast.stmt) -> None:
        self._program, self._module, self._statement = program, module, statement
        file = program.file(module.name)
        assert file is not None
        package = self._package = module.name if file.name == "__init__.py" else module.name.rpartition(".")[0]
        self._inside = Module(module.name)
        for node in ast.walk(statement):
            program.add_imports(self._inside, node, package)
        self._top = list(_bound_at_top(statement))
        self._parameters = {node.arg for node in ast.walk(statement) if isinstance(node, ast.arg)}
        self._locals: dict[str, str] = {}
        self._in_function = False
        self._parts: list[str | Definition | Whole | None] = []
        self._shown: list[str] = []
        self._texts: set[str] = set()

    def written(self) -> Written:
        """Write all of it."""
        self._write(self._statement)
        joined: list[str | Definition | Whole | None] = []
        for part in self._parts:
            if isinstance(part, str) and joined and isinstance(joined[-1], str):
                joined[-1] += f" {part}"
            else:
                joined.append(part)
        return Written(
            tuple(joined), hashlib.sha256(" ".join(self._shown).encode()).hexdigest(), frozenset(self._texts)
        )

    def _put(self, part: str | Definition | Whole | None, shown: str | None = None) -> None:
        self._parts.append(part)
        self._shown.append(shown or (part if isinstance(part, str) else "module"))

    def _write(self, node: ast.AST) -> None:
        if isinstance(node, ast.stmt) and _says_nothing(node):
            return
        if isinstance(node, (*FUNCTIONS, *COMPREHENSIONS)) and not self._in_function:
            self._locals, self._in_function = self._locals_of(node), True
            self._node(node)
            self._locals, self._in_function = {}, False
        else:
            self._node(node)

    def _node(self, node: ast.AST) -> None:
        if isinstance(node, ast.Name):
            self._name(node.id)
        elif isinstance(node, ast.Attribute):
            self._attribute(node)
        elif isinstance(node, ast.Constant):
            self._constant(node.value)
        elif isinstance(node, ast.AnnAssign) and (self._in_function or node is self._statement):
            self._assigned(node)
        else:
            if isinstance(node, (ast.Call, ast.JoinedStr)):
                self._imported_by_name(node)
            self._fields(node)

    def _fields(self, node: ast.AST) -> None:
        self._put(f"({type(node).__name__}")
        for name, value in ast.iter_fields(node):
            if value in (None, []) or name in ("ctx", "kind", "type_comment", "type_ignores", "returns", "type_params"):
                continue
            if isinstance(node, ast.arg) and name == "annotation":
                continue
            self._put(f":{name}")
            for item in value if isinstance(value, list) else [value]:
                if isinstance(item, ast.keyword) and _for_people(node, item):
                    continue
                if isinstance(item, ast.AST):
                    self._write(item)
                elif item is None:
                    self._put("None")
                else:
                    self._field(node, name, item)
        self._put(")")

    def _field(self, node: ast.AST, name: str, value: object) -> None:
        """A plain value: mostly a name that is written as text."""
        if node is self._statement and name == "name":
            self._put("@0", str(value))
        elif isinstance(value, str) and name in ("name", "rest") and value in self._locals:
            self._put(self._locals[value])
        else:
            self._put(repr(value))

    def _assigned(self, node: ast.AnnAssign) -> None:
        """`x: int = 1` in a function or at the top is `x = 1`; without a value it is nothing."""
        if node.value is not None:
            self._put("(Assign :targets")
            self._write(node.target)
            self._put(":value")
            self._write(node.value)
            self._put(")")

    def _name(self, name: str) -> None:
        if name in self._locals:
            self._put(self._locals[name])
        elif name == "__package__":
            self._put(Whole(self._package))
        elif name in self._top and not self._in_function and not isinstance(self._statement, (ast.ClassDef,)):
            self._put(f"@{self._top.index(name)}", name)
        else:
            for target in self._targets(name):
                self._reached(target, name)
            if not self._targets(name):
                self._put(f"={self._library(name)}")

    def _targets(self, name: str) -> list[Imported]:
        """What of ours a name may stand for in this statement."""
        if name in self._inside.imports:
            return self._inside.imports[name]
        if name in self._module.definitions:
            return [(self._module.name, name)]
        return self._module.imports.get(name, [])

    def _library(self, name: str) -> str:
        """What a name is of other people's libraries; itself when it is none."""
        return self._inside.libraries.get(name) or self._module.libraries.get(name, name)

    def _reached(self, target: Imported, shown: str) -> None:
        module, name = target
        self._put(Definition(module, name) if name else Whole(module), shown)

    def _attribute(self, node: ast.Attribute) -> None:
        """`module.name` is the definition; anything else an attribute."""
        chain: list[str] = []
        base: ast.expr = node
        while isinstance(base, ast.Attribute):
            chain.insert(0, base.attr)
            base = base.value
        modules = [m for m, name in self._targets(base.id) if name is None] if isinstance(base, ast.Name) else []
        if not modules or (isinstance(base, ast.Name) and base.id in self._locals):
            self._fields(node)
            return
        for module in modules:
            rest = list(chain)
            while rest and self._program.is_ours(f"{module}.{rest[0]}"):
                module = f"{module}.{rest.pop(0)}"
            if rest and not rest[0].startswith("__"):
                self._put(Definition(module, rest[0]), rest[0])
                for name in rest[1:]:
                    self._put(f".{name}")
            else:
                self._put(Whole(module))

    def _constant(self, value: object) -> None:
        """A text that is the name of one of our modules is an import, and so is that of a group of entry points."""
        if isinstance(value, str):
            for module in self._program.places.plugins.get(value, ()):
                self._put(Whole(module))
        if isinstance(value, str) and "." in value and self._program.is_ours(value):
            self._put(Whole(value))
        else:
            shown = value.removeprefix(f"{OURS}.") if isinstance(value, str) else value
            self._put(f"{type(value).__name__}={shown!r}")
            if isinstance(value, str) and Path(value[:200]).suffix and "\n" not in value:
                self._texts.add(value)

    def _imported_by_name(self, node: ast.Call | ast.JoinedStr) -> None:
        """Modules whose names are put together: all below what the text begins with; else all of the step's folder, and
        of the package in which this stands."""
        if isinstance(node, ast.JoinedStr):
            first = node.values[0] if node.values else None
            if isinstance(first, ast.Constant) and isinstance(first.value, str) and "." in first.value:
                for group, modules in self._program.places.plugins.items():
                    for module in modules if group.startswith(first.value) else ():
                        self._put(Whole(module))
                package = first.value.rpartition(".")[0]
                if self._program.is_ours(package) and "." in package:
                    self._put(Whole(package))
        elif _called(node) in ("import_module", "iter_modules", "walk_packages") and not self._is_followed(node):
            if len(self._module.name.split(".")) > 4:
                self._put(Whole(self._module.name.rpartition(".")[0]))
            self._put(None)

    def _is_followed(self, call: ast.Call) -> bool:
        """Whether the argument says by itself where it points: a text, or one that begins with a text, a constant, or
        a parameter (then who calls the function names the module, and is followed)."""
        argument: ast.expr | None = call.args[0] if call.args else None
        if isinstance(argument, ast.JoinedStr) and argument.values:
            argument = argument.values[0]
        if isinstance(argument, ast.FormattedValue):
            argument = argument.value
        if isinstance(argument, ast.Attribute) and argument.attr in ("__name__", "__path__"):
            argument = argument.value
            while isinstance(argument, ast.Attribute) and isinstance(argument.value, (ast.Attribute, ast.Name)):
                argument = argument.value  # `import a.b`, then `a.b.__path__`
                if isinstance(argument, ast.Name):
                    return argument.id not in self._locals and bool(self._targets(argument.id))
        if isinstance(argument, ast.Call):
            return _called(argument) == "import_module"  # looked at by itself
        if isinstance(argument, ast.Constant):
            return _called(call) == "import_module"
        if not isinstance(argument, ast.Name):
            return False
        return argument.id in self._parameters or (argument.id not in self._locals and bool(self._targets(argument.id)))

    def _locals_of(self, function: ast.AST) -> dict[str, str]:
        """Number the local variables of a function with all inside it. A name that is also a definition, import or
        parameter keeps its name: which is meant would need Python's scopes."""
        bound: dict[str, None] = {}
        kept: set[str] = set()
        for node in ast.walk(function):
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                bound[node.id] = None
            elif isinstance(node, (ast.ExceptHandler, ast.MatchAs, ast.MatchStar)) and node.name:
                bound[node.name] = None
            elif isinstance(node, ast.MatchMapping) and node.rest:
                bound[node.rest] = None
            elif isinstance(node, ast.FunctionDef) and node is not function:
                bound[node.name] = None
            elif isinstance(node, ast.arg):
                kept.add(node.arg)
            elif isinstance(node, (ast.Global, ast.Nonlocal)):
                kept.update(node.names)
            elif isinstance(node, ast.ClassDef):
                kept.update(inner.id for inner in ast.walk(node) if isinstance(inner, ast.Name))
        names = [name for name in bound if name not in kept and not self._targets(name) and self._library(name) == name]
        return {name: f"%{number}" for number, name in enumerate(names)}


def _bound_at_top(statement: ast.stmt) -> dict[str, None]:
    """Names that a statement at the top of a module defines, in order."""
    if isinstance(statement, (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
        return {statement.name: None}
    if isinstance(statement, (ast.Assign, ast.AnnAssign)):
        targets: list[ast.expr] = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
        nodes = [node for target in targets for node in ast.walk(target)]
    else:
        nodes = list(ast.walk(statement))
    return {node.id: None for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}


def _is_docstring(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)


def _for_types_only(statement: ast.stmt) -> bool:
    test = statement.test if isinstance(statement, ast.If) else None
    return isinstance(test, ast.Name) and test.id == "TYPE_CHECKING"


def _says_nothing(statement: ast.stmt) -> bool:
    """Docstrings, imports, log lines, what only a type checker reads."""
    if isinstance(statement, (ast.Import, ast.ImportFrom, ast.Pass)):
        return True
    if _is_docstring(statement) or (_for_types_only(statement) and not getattr(statement, "orelse", None)):
        return True
    call = statement.value if isinstance(statement, ast.Expr) else None
    if isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute):
        owner = call.func.value
        return (owner.attr if isinstance(owner, ast.Attribute) else getattr(owner, "id", "")) in LOGGERS
    return False


def _for_people(call: ast.AST, keyword: ast.keyword) -> bool:
    return isinstance(call, ast.Call) and _called(call) in DECLARED_IN and keyword.arg in FOR_PEOPLE


def _called(call: ast.Call) -> str:
    """Last word of what is called."""
    function = call.func
    return function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
