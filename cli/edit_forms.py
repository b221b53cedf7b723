"""What a page and a command ask for of each kind of edit, out of the declaration of the kind (schemas/edits.py).

A new kind has a form as soon as it is declared, if its fields are things, classes, boxes, points, choices, numbers,
words or yes and no; one that has others is left to whoever writes edits.toml.
"""

from __future__ import annotations

import types
from collections.abc import Iterable
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import AfterValidator
from pydantic.fields import FieldInfo
from scenewright.schemas import edits
from scenewright.schemas.hand_written import Point, UprightBox

OF_ALL = frozenset({*edits.Edit.model_fields, "what"})
"""Fields that every edit has: who, when and why are asked for once."""
WITHOUT = {"thing": "nothing", "model": "none"}
"""Kind of a field -> the word for leaving it out, where that says something: who edits has to choose it."""
Form = dict[str, Any]


def kinds_of(union: Any) -> tuple[type[edits.Edit], ...]:
    """Return the kinds of edits that a (tagged) union is of."""
    if get_origin(union) is Annotated:
        union = get_args(union)[0]
    return get_args(union) or (union,)


def forms_of(kinds: Iterable[type[edits.Edit]]) -> list[Form]:
    """Return the forms of the kinds that can be asked for, as JSON: `what`, `says`, and `fields`."""
    found = []
    for kind in kinds:
        asked = {
            info.alias or name: info
            for name, info in kind.model_fields.items()
            if name not in OF_ALL and edits.Asked.NOT not in info.metadata
        }
        fields = [field_of(name, info) for name, info in asked.items()]
        if all(field is not None for field in fields):
            (what,) = get_args(kind.model_fields["what"].annotation)
            found.append({"what": what, "says": (kind.__doc__ or "").split("\n")[0], "fields": fields})
    return found


def field_of(name: str, info: FieldInfo) -> Form | None:
    """Return how a field is asked for, as JSON: `name`, `says`, `kind`, `needed` and what goes with its kind; None when
    it cannot be asked for."""
    needed = info.is_required()
    asked = _kind_of(info.annotation, tuple(info.metadata))
    if asked is None:
        return None
    start = None if needed or not isinstance(info.default, str | int | float | bool) else info.default
    if not needed and (word := WITHOUT.get(asked["kind"])) is not None:
        needed, asked = True, {**asked, "choices": [*asked.get("choices", ()), word]}
    return {"name": name, "says": info.description or "", "needed": needed, "start": start, **asked}


def _kind_of(annotation: Any, metadata: tuple[Any, ...]) -> Form | None:
    if get_origin(annotation) is Annotated:
        inner, *more = get_args(annotation)
        return _kind_of(inner, (*metadata, *more))
    said = next((one for one in metadata if isinstance(one, edits.Asked)), None)
    if said is not None:
        return {"kind": said.value}
    if annotation == Point:
        return {"kind": "point"}
    if get_origin(annotation) in (Union, types.UnionType):
        return _kind_of_union([part for part in get_args(annotation) if part is not type(None)], metadata)
    if get_origin(annotation) is Literal:
        return {"kind": "choice", "choices": list(get_args(annotation))}
    if get_origin(annotation) is tuple:
        return _kind_of_tuple(get_args(annotation), metadata)
    if annotation is edits.Anchor:
        return {"kind": "thing"}
    if annotation is edits.JointAnchor:
        return {"kind": "joint"}
    if annotation is UprightBox:
        return {"kind": "box"}
    if annotation is bool:
        return {"kind": "yes"}
    if annotation in (int, float):
        return {"kind": "number", **_bounds(metadata)}
    if annotation is str:
        is_class = any(isinstance(one, AfterValidator) and one in get_args(edits.ClassName) for one in metadata)
        return {"kind": "class" if is_class else "text"}
    return None


def _kind_of_union(parts: list[Any], metadata: tuple[Any, ...]) -> Form | None:
    """Of a thing or a word (`floor`), a choice of which the thing is one."""
    if len(parts) == 1:
        return _kind_of(parts[0], metadata)
    words = [word for part in parts if get_origin(part) is Literal for word in get_args(part)]
    others = [part for part in parts if get_origin(part) is not Literal]
    if len(others) == 1 and others[0] is edits.Anchor:
        return {"kind": "thing", "choices": words}
    return None


def _kind_of_tuple(parts: tuple[Any, ...], metadata: tuple[Any, ...]) -> Form | None:
    if parts == (edits.Anchor, ...):
        fewest = next((one.min_length for one in metadata if hasattr(one, "min_length")), 1)
        return {"kind": "things", "fewest": fewest}
    if len(parts) == 2 and parts[0] == Point and parts[1] is Ellipsis:
        fewest = next((one.min_length for one in metadata if hasattr(one, "min_length")), 1)
        return {"kind": "points", "fewest": fewest}
    if Ellipsis not in parts and all(part is float or _is_number(part) for part in parts):
        return {"kind": "numbers", "count": len(parts)}
    return None


def _is_number(part: Any) -> bool:
    return get_origin(part) is Annotated and get_args(part)[0] in (int, float)


def _bounds(metadata: tuple[Any, ...]) -> Form:
    found: Form = {}
    for one in metadata:
        for side, names in (("least", ("ge", "gt")), ("most", ("le", "lt"))):
            for name in names:
                if getattr(one, name, None) is not None:
                    found[side] = float(getattr(one, name))
    return found
