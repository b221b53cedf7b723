"""Definitions of ROS messages, as logs embed them (`.msg` and `.idl` text) -> fields of each type.

The type system of rosbags turns definitions into Python source and executes it, and its parser of `.idl` takes 40 times
as long for each nested parenthesis. Definitions come out of logs, so they are read here, in linear time, into plain
data. Its bundled definitions serve where a log embeds none.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

LARGEST_DEFINITION = 1 << 18
"""Bytes of the definition of one type with all it refers to; those of the types read here have under 10,000."""

PRIMITIVES = {
    "bool": "B",
    "boolean": "B",
    "byte": "B",
    "octet": "B",
    "char": "B",
    "int8": "b",
    "uint8": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
    "float": "f",
    "double": "d",
    "short": "h",
    "unsigned short": "H",
    "long": "i",
    "unsigned long": "I",
    "long long": "q",
    "unsigned long long": "Q",
}
"""Name in `.msg` or `.idl` -> code of the struct module."""
TEXT = "string"
SEQUENCE = -1
"""Count of a field that is a sequence: any number of values."""
EMPTY_STRUCT_MEMBER = "structure_needs_at_least_one_member"
"""The one byte that ROS 2 gives a struct without fields, as C has no empty structs; ROS 1 gives it none."""


class UnreadableDefinition(Exception):
    """A definition that makes no sense here. The text says which line or word, for people."""


@dataclass(frozen=True)
class Field:
    """One field of a message."""

    name: str
    """Lower case: ROS 1 has K where ROS 2 has k."""
    kind: str
    """Code of the struct module, `string`, or the name of a type as `package/Type`."""
    count: int | None = None
    """None: one value; SEQUENCE: any number; else that many."""


Definitions = dict[str, tuple[Field, ...]]
"""Type (`package/Type`) -> its fields."""


def short_name(type_name: str) -> str:
    """Return `package/Type` of `package/Type`, `package/msg/Type` or `package::msg::Type`."""
    return type_name.replace("::", "/").replace("/msg/", "/")


def definitions_of(type_name: str, schema_encoding: str, schema: bytes) -> Definitions:
    """Return the definitions of a type and of what it refers to. Raises UnreadableDefinition.

    `schema_encoding` is `ros1msg`, `ros2msg`, `ros2idl`, `omgidl` or empty; types that the schema does not define are
    taken from those that come with rosbags.
    """
    if len(schema) > LARGEST_DEFINITION:
        raise UnreadableDefinition(f"its definition has {len(schema)} bytes, more than {LARGEST_DEFINITION}")
    text = schema.decode("utf-8", "replace").replace("\r\n", "\n")
    definitions: Definitions = {}
    if text.strip():
        definitions = parse_idl(text) if schema_encoding in ("ros2idl", "omgidl") else parse_msg(text, type_name)
    name = short_name(type_name)
    if name in definitions and schema_encoding == "ros1msg":
        definitions |= {"builtin_interfaces/Time": ROS1_TIME, "builtin_interfaces/Duration": ROS1_TIME}
    return _collect_needed(name, definitions, "ros1" if schema_encoding == "ros1msg" else "ros2")


ROS1_TIME = (Field("sec", "I"), Field("nanosec", "I"))


def _collect_needed(name: str, definitions: Definitions, version: str) -> Definitions:
    """Keep what `name` refers to, directly or not; take missing types from the bundled ones."""
    needed: Definitions = {}
    waiting = [name]
    while waiting:
        current = waiting.pop()
        if current in needed:
            continue
        fields = definitions.get(current)
        if fields is None:
            fields = bundled_definitions(version).get(current)
        if fields is None:
            raise UnreadableDefinition(f"the log has no definition of {current}")
        needed[current] = fields
        waiting += [field.kind for field in fields if "/" in field.kind]
    return needed


@cache
def bundled_definitions(version: str) -> Definitions:
    """Return the definitions of the common packages of ROS, `ros1` (Noetic) or `ros2` (the newest) as rosbags has
    them."""
    from rosbags.interfaces import Nodetype

    if version == "ros1":
        from rosbags.typesys.stores.ros1_noetic import FIELDDEFS
    else:
        from rosbags.typesys.stores.latest import FIELDDEFS

    def field(name: str, description: tuple) -> Field:
        node, detail = description
        if node in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            inner, count = detail
            return Field(name, field(name, inner).kind, count if node == Nodetype.ARRAY else SEQUENCE)
        if node == Nodetype.BASE:
            return Field(name, PRIMITIVES.get(detail[0], detail[0]))
        return Field(name, short_name(detail))

    transforms = (Field("transforms", "geometry_msgs/TransformStamped", SEQUENCE),)
    definitions: Definitions = {"tf2_msgs/TFMessage": transforms, "tf/tfMessage": transforms}
    for type_name, (_, fields) in FIELDDEFS.items():
        definitions[short_name(type_name)] = tuple(
            field(name.lower(), description) for name, description in fields if name != EMPTY_STRUCT_MEMBER
        )
    if version == "ros1":
        definitions |= {"builtin_interfaces/Time": ROS1_TIME, "builtin_interfaces/Duration": ROS1_TIME}
    return definitions


# --- .msg ------------------------------------------------------------------------------------------------------

_SEPARATOR = re.compile(r"={20,}\s*")
_FIELD = re.compile(
    r"(?P<kind>[A-Za-z][\w/]*)(?:<=\d{1,10})?(?P<array>\[(?:<=)?(?P<count>\d{0,10})\])?\s+"
    r"(?P<name>[A-Za-z]\w*)\s*(?P<rest>.*)"
)
_SHORTHANDS = {
    "time": "builtin_interfaces/Time",
    "duration": "builtin_interfaces/Duration",
    "Header": "std_msgs/Header",
}


def parse_msg(text: str, type_name: str) -> Definitions:
    """Return the types of concatenated `.msg` text, the first of which is `type_name`. Raises UnreadableDefinition."""
    fields_of: dict[str, list[Field]] = {}
    name = short_name(type_name)
    fields = fields_of.setdefault(name, [])
    for number, line in enumerate(text.split("\n"), start=1):
        line = line.strip()
        if line.startswith("MSG: "):
            name = short_name(line.removeprefix("MSG: ").strip())
            fields = fields_of[name] = []
            continue
        if not line or line.startswith(("#", "@")) or _SEPARATOR.fullmatch(line):
            continue
        match = _FIELD.match(line)
        if match is None:
            raise UnreadableDefinition(f"line {number} of its definition is not understood: {line[:60]!r}")
        if not match["rest"].startswith("="):  # else a constant
            fields.append(Field(match["name"].lower(), _msg_kind(match["kind"], name), _msg_count(match)))
    return {name: tuple(fields) for name, fields in fields_of.items()}


def _msg_kind(kind: str, owner: str) -> str:
    if kind in PRIMITIVES:
        return PRIMITIVES[kind]
    if kind in (TEXT, "wstring"):
        return kind
    if kind in _SHORTHANDS:
        return _SHORTHANDS[kind]
    return short_name(kind) if "/" in kind else f"{owner.rpartition('/')[0]}/{kind}"


def _msg_count(match: re.Match[str]) -> int | None:
    if match["array"] is None:
        return None
    return SEQUENCE if "<=" in match["array"] or not match["count"] else int(match["count"])


# --- .idl ------------------------------------------------------------------------------------------------------

_TOKEN = re.compile(
    r"\s+|//[^\n]*|/\*(?:.*?\*/|.*)|\#[^\n]*|(?<!=)={20,}+\s*IDL:[^\n]*"  # nothing; what has no end goes to the end
    r"|(?P<token>(?:::)?[A-Za-z_]\w*+(?:::[A-Za-z_]\w*+)*+|\d[\w.+]*"
    r"|\"(?:[^\"\\]|\\.)*+(?:\"|\\?\Z)|'(?:[^'\\]|\\.)*+(?:'|\\?\Z)|[^\s])",
    re.DOTALL,
)


def parse_idl(text: str) -> Definitions:
    """Return the types of concatenated `.idl` text. Raises UnreadableDefinition."""
    return _IdlReader(text).read()


class _IdlReader:
    """Reads the part of IDL that rosidl writes: modules, constants, typedefs, structs, enums."""

    def __init__(self, text: str) -> None:
        self._tokens: Iterator[str] = (match["token"] for match in _TOKEN.finditer(text) if match["token"])
        self._next: str = next(self._tokens, "")
        self._scope: list[str] = []
        self._constants: dict[str, int] = {}
        self._type_of_name: dict[str, tuple[str, int | None]] = {}
        """Path of a typedef, enum or struct -> kind and count."""
        self._definitions: Definitions = {}

    def read(self) -> Definitions:
        while self._next:
            word = self._take()
            if word == "@":
                self._skip_annotation()
            elif word == "module":
                self._scope.append(self._take())
                self._expect("{")
            elif word == "}" and self._scope:
                self._scope.pop()
                self._expect(";")
            elif word == "const":
                self._constant()
            elif word == "typedef":
                kind = self._kind()
                for name, dimensioned in self._declarators(kind):
                    self._type_of_name[self._path(name)] = dimensioned
            elif word == "enum":
                self._type_of_name[self._path(self._take())] = ("I", None)
                self._skip_to(";")
            elif word == "struct":
                self._struct()
            else:
                raise UnreadableDefinition(f"{word[:40]!r} in its definition is not understood")
        return self._definitions

    def _struct(self) -> None:
        path = self._path(self._take())
        name = short_name(path)
        self._type_of_name[path] = (name, None)
        self._expect("{")
        fields: list[Field] = []
        while self._next != "}":
            if self._next == "@":
                self._take()
                self._skip_annotation()
                continue
            kind = self._kind()
            fields += [Field(field.lower(), *dimensioned) for field, dimensioned in self._declarators(kind)]
        self._expect("}")
        self._expect(";")
        self._definitions[name] = tuple(fields)

    def _constant(self) -> None:
        words = []
        while (word := self._take()) != ";":
            words.append(word)
        if len(words) >= 3 and words[-2] == "=" and words[-1].isascii() and words[-1].isdigit() and len(words[-1]) < 11:
            self._constants[words[-3]] = int(words[-1])

    def _kind(self) -> tuple[str, int | None]:
        word = self._take()
        if word == "sequence":
            self._expect("<")
            kind, count = self._kind() if self._next != "sequence" else ("", SEQUENCE)
            if count is not None:
                raise UnreadableDefinition("its definition has a sequence of arrays")
            if self._next == ",":
                self._take()
                self._bound()
            self._expect(">")
            return kind, SEQUENCE
        if word in (TEXT, "wstring"):
            if self._next == "<":
                self._take()
                self._bound()
                self._expect(">")
            return word, None
        while word in ("unsigned", "long", "unsigned long") and self._next in ("short", "long", "double"):
            word = f"{word} {self._take()}"
        if word in PRIMITIVES:
            return PRIMITIVES[word], None
        return self._resolve(word)

    def _resolve(self, name: str) -> tuple[str, int | None]:
        path = name.removeprefix("::").replace("::", "/")
        if not re.fullmatch(r"[A-Za-z_][\w/]*", path):
            raise UnreadableDefinition(f"{name[:40]!r} in its definition is not a type")
        for depth in range(0 if name.startswith("::") else len(self._scope), -1, -1):
            candidate = "/".join([*self._scope[:depth], path])
            if candidate in self._type_of_name:
                return self._type_of_name[candidate]
        return (short_name(path) if "/" in path else short_name(self._path(path))), None

    def _declarators(self, kind: tuple[str, int | None]) -> list[tuple[str, tuple[str, int | None]]]:
        declarators = []
        while True:
            name, dimensioned = self._take(), kind
            if self._next == "[":
                self._take()
                if kind[1] is not None:
                    raise UnreadableDefinition("its definition has an array of arrays")
                dimensioned = (kind[0], self._bound())
                self._expect("]")
            declarators.append((name, dimensioned))
            separator = self._take()
            if separator == ";":
                return declarators
            if separator != ",":
                raise UnreadableDefinition(f"{separator[:40]!r} in its definition is not understood")

    def _bound(self) -> int:
        word = self._take()
        if word.isascii() and word.isdigit() and len(word) < 11:
            return int(word)
        if word.rpartition("::")[2] in self._constants:
            return self._constants[word.rpartition("::")[2]]
        raise UnreadableDefinition(f"{word[:40]!r} in its definition is not a size")

    def _skip_annotation(self) -> None:
        self._take()
        if self._next == "(":
            depth = 0
            while True:
                word = self._take()
                depth += (word == "(") - (word == ")")
                if depth == 0:
                    return

    def _skip_to(self, end: str) -> None:
        while self._take() != end:
            pass

    def _path(self, name: str) -> str:
        return "/".join([*self._scope, name])

    def _expect(self, expected: str) -> None:
        word = self._take()
        if word != expected:
            raise UnreadableDefinition(f"{word[:40]!r} in its definition where {expected!r} is due")

    def _take(self) -> str:
        word = self._next
        if not word:
            raise UnreadableDefinition("its definition ends too early")
        self._next = next(self._tokens, "")
        return word
