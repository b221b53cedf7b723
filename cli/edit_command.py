"""`scenewright edit rename | merge | support | move ...`: a line more in edits.toml, which `edit map`, `edit graph` or
`edit scene` applies. The commands come out of the declaration of the edits (schemas/edits.py), as a page's forms do."""

from __future__ import annotations

import getpass
import inspect
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Optional

import typer
from scenewright.cli.edit_forms import Form, field_of, forms_of, kinds_of
from scenewright.cli.output import out, say
from scenewright.schemas.artifact import Artifact
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import ContactGraph
from scenewright.schemas.edits import AnyEdit, Edit, GraphEdit, MapEdit, SceneEdit
from scenewright.schemas.errors import UsageError
from scenewright.schemas.hand_written import UprightBox
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.plain_text import cleaned
from scenewright.stages.kit.open_words.reading.names import class_named

if TYPE_CHECKING:
    from scenewright.cli.viewing.desk.subject import Subject

EDITED: dict[type[Artifact], tuple[str, Any]] = {
    PanopticMap: ("map", MapEdit),
    ContactGraph: ("graph", GraphEdit),
    CadScene: ("scene", SceneEdit),
}
"""What edits are applied to -> by which `edit` command, and which edits."""
ARGUMENTS = {
    "thing": "A thing: its node's name (cup_7), or its instance number.",
    "things": "Things: names of their nodes, or instance numbers; the first gives its class.",
    "joint": "Name of a joint of its model.",
    "model": "",
    "as": "",
}
"""Kind or name of a needed field that is typed without an option -> help, where its declaration has none."""
FILE = "edits.toml; it is made where there is none."
FLAGS = {"surface": "drawn"}
"""Choice of two that is typed as a flag, which means the second."""
ORDINALS = ("first", "second", "third")
Triple = tuple[float, float, float]
TYPED = {"number": float, "yes": bool, "things": list[str], **dict.fromkeys(("point", "direction", "numbers"), Triple)}
"""Kind of a field -> type of what is typed; a word where it is not here."""


def _parameter(name: str, annotation: Any, declared: Any) -> inspect.Parameter:
    """Return a parameter of a command. The underscore is for names that Python keeps to itself: `class`, `as`."""
    return inspect.Parameter(f"{name}_", inspect.Parameter.KEYWORD_ONLY, default=declared, annotation=annotation)


def _option(name: str, annotation: Any, text: str | None, default: Any = ..., **bounds: Any) -> inspect.Parameter:
    """Return an option, which is needed when it has no default."""
    annotation = Optional[annotation] if default is None else annotation  # noqa: UP045
    return _parameter(name, annotation, typer.Option(default, f"--{name.replace('_', '-')}", help=text, **bounds))


def _typed(field: Form) -> list[inspect.Parameter]:
    """Return what is typed for a field: an argument, an option, or several."""
    name, kind, text, words = _short(field["name"]), field["kind"], field["says"], field.get("choices", ())
    if kind == "box":
        parts = [field_of(part, info) or {} for part, info in UprightBox.model_fields.items()]
        return [parameter for part in parts for parameter in _typed(part)]
    if kind == "points":
        return [_option(ordinal, Triple, text) for ordinal in ORDINALS[: field["fewest"]]]
    if kind == "place":
        return [_option(name, Triple, text, None), _option("shift", Triple, "Or how far it goes: x y z [m].", None)]
    if name in FLAGS:
        return [_option(FLAGS[name], bool, text, False)]
    annotation: Any = Literal[tuple(words)] if kind == "choice" else TYPED.get(kind, str)
    called = name if name in ARGUMENTS else kind
    if called in ARGUMENTS and not (kind == "thing" and words):
        metavar = "|".join(words) if kind == "choice" else called.upper()
        return [_parameter(name, annotation, typer.Argument(..., metavar=metavar, help=text or ARGUMENTS[called]))]
    default = ... if field["needed"] else field["start"]
    return [_option(name, annotation, text, default, min=field.get("least"), max=field.get("most"))]


def _said(field: Form, given: Mapping[str, Any]) -> Any:
    """Return what was typed for a field as a page says it; None where it was left out."""
    if field["kind"] == "box":
        return {part: given[f"{_short(part)}_"] for part in UprightBox.model_fields}
    if field["kind"] == "points":
        return [given[f"{ordinal}_"] for ordinal in ORDINALS[: field["fewest"]]]
    if (flag := FLAGS.get(field["name"])) is not None:
        return field["choices"][given[f"{flag}_"]]
    typed = given[f"{_short(field['name'])}_"]
    return (class_named(typed) or typed) if field["kind"] == "class" and isinstance(typed, str) else typed


def _short(name: str) -> str:
    return name.removesuffix("_degrees")


def make_command(form: Form) -> Callable[..., int]:
    """Return a function with the signature that typer reads for a kind of edit, out of its form."""
    what, fields = form["what"], form["fields"]
    edited = [kind for kind, (_, edits) in EDITED.items() if what in {one["what"] for one in forms_of(kinds_of(edits))}]
    sources = {_flag(kind): kind for kind in edited if any(field["kind"] in ("thing", "things") for field in fields)}

    def command(**given: Any) -> int:
        named = [kind for kind in sources.values() if given[f"{kind.kind}_"] is not None]
        if sources and len(named) != 1:
            raise UsageError(
                f"edit {what}: nothing, or too much, says where it is", hint=f"give {' or '.join(sources)}"
            )
        asked = {field["name"]: _said(field, given) for field in fields}
        values = {"what": what, **asked}
        if named:
            subject = _subject(named[0], given[f"{named[0].kind}_"])
            if given.get("shift_") is not None:
                asked["to"] = _shifted(subject, given)
            values = subject.fields(what, fields, asked)
        return _append(given, values, (named or edited)[0])

    parameters = [_parameter("file", Path, typer.Argument(..., metavar="FILE", help=FILE))]
    parameters += [parameter for field in fields for parameter in _typed(field)]
    needed = ... if len(sources) == 1 else None
    parameters += [_option(kind.kind, Path, f"The {kind.kind}, edited or not.", needed) for kind in sources.values()]
    parameters += [_option(name, str, Edit.model_fields[name].description, "") for name in ("by", "note")]
    parameters.append(_option("debug", bool, "Show the traceback of an error.", False))
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    command.__name__, command.__doc__ = what, form["says"]
    return command


def _subject(kind: type[Artifact], path: Path) -> Subject[Any]:
    from scenewright.cli.viewing.desk.subjects import SUBJECTS
    from scenewright.stages.engine.reading import open_artifact

    return dict(SUBJECTS)[kind](open_artifact(path, kind), frozenset())


def _shifted(subject: Subject[Any], given: Mapping[str, Any]) -> list[float]:
    """Return where the middle of a thing's box goes when it is shifted. Raises UsageError when that is said too."""
    if given["to_"] is not None:
        raise UsageError("edit move: --to and --shift both say where", hint="give one of them")
    middle = subject.anchor_of(subject.thing(given["of_"])).box.center
    return [start + way for start, way in zip(middle, given["shift_"], strict=True)]


def _flag(kind: type[Artifact]) -> str:
    return f"--{kind.kind.replace('_', '-')}"


def _append(given: Mapping[str, Any], values: Mapping[str, Any], kind: type[Artifact]) -> int:
    """Add the edit that somebody asks for now to the file, and say what to do next."""
    from scenewright.stages.edit.edits_file import append_edits

    file = given["file_"]
    edits = append_edits(file, [asked_edit(given["by_"], given["note_"], values)])
    apply = f"scenewright edit {EDITED[kind][0]} {_flag(kind)} ... --edits {file} --out ..."
    say(f"edit {len(edits.edits)} of {file}; next: {apply}")
    out(str(file))
    return 0


def asked_edit(by: str, note: str, values: Mapping[str, Any]) -> AnyEdit:
    """Return the edit that somebody asks for now; `values` are its fields. Raises UsageError for what is none."""
    from pydantic import TypeAdapter, ValidationError

    said = {"by": cleaned(by or _account()), "when": f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}", "note": cleaned(note)}
    try:
        edit: AnyEdit = TypeAdapter(AnyEdit).validate_python({**values, **said})
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"][1:])
        raise UsageError(f"edit {values.get('what')}: {where:.200}: {first['msg']:.200}", hint="see --help") from None
    return edit


def _account() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):
        return ""


COMMANDS = tuple(make_command(form) for form in forms_of(kinds_of(AnyEdit)))
