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
    forms = []
    for kind in kinds:
        field_infos = {
            info.alias or name: info
            for name, info in kind.model_fields.items()
            if name not in OF_ALL and edits.Asked.NOT not in info.metadata
        }
        fields = [field_of(name, info) for name, info in field_infos.items()]
        if all(field is not None for field in fields):
            (edit_name,) = get_args(kind.model_fields["what"].annotation)
            forms.append({"what": edit_name, "says": (kind.__doc__ or "").split("\n")[0], "fields": fields})
    return forms


def field_of(name: str, info: FieldInfo) -> Form | None:
    """Return how a field is asked for, as JSON: `name`, `says`, `kind`, `needed` and what goes with its kind; None when
    it cannot be asked for."""
    needed = info.is_required()
    kind_form = _kind_of(info.annotation, tuple(info.metadata))
    if kind_form is None:
        return None
    start = None if needed or not isinstance(info.default, str | int | float | bool) else info.default
    if not needed and (word := WITHOUT.get(kind_form["kind"])) is not None:
        needed, kind_form = True, {**kind_form, "choices": [*kind_form.get("choices", ()), word]}
    return {"name": name, "says": info.description or "", "needed": needed, "start": start, **kind_form}


def _kind_of(annotation: Any, metadata: tuple[Any, ...]) -> Form | None:
    if get_origin(annotation) is Annotated:
        inner, *further_metadata = get_args(annotation)
        return _kind_of(inner, (*metadata, *further_metadata))
    asked_kind = next((each for each in metadata if isinstance(each, edits.Asked)), None)
    if asked_kind is not None:
        return {"kind": asked_kind.value}
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
        is_class = any(isinstance(each, AfterValidator) and each in get_args(edits.ClassName) for each in metadata)
        return {"kind": "class" if is_class else "text"}
    return None


def _kind_of_union(members: list[Any], metadata: tuple[Any, ...]) -> Form | None:
    """Of a thing or a word (`floor`), a choice of which the thing is one."""
    if len(members) == 1:
        return _kind_of(members[0], metadata)
    words = [word for part in members if get_origin(part) is Literal for word in get_args(part)]
    others = [part for part in members if get_origin(part) is not Literal]
    if len(others) == 1 and others[0] is edits.Anchor:
        return {"kind": "thing", "choices": words}
    return None


def _kind_of_tuple(members: tuple[Any, ...], metadata: tuple[Any, ...]) -> Form | None:
    if members == (edits.Anchor, ...):
        fewest = next((each.min_length for each in metadata if hasattr(each, "min_length")), 1)
        return {"kind": "things", "fewest": fewest}
    if len(members) == 2 and members[0] == Point and members[1] is Ellipsis:
        fewest = next((each.min_length for each in metadata if hasattr(each, "min_length")), 1)
        return {"kind": "points", "fewest": fewest}
    if Ellipsis not in members and all(part is float or _is_number(part) for part in members):
        return {"kind": "numbers", "count": len(members)}
    return None


def _is_number(part: Any) -> bool:
    return get_origin(part) is Annotated and get_args(part)[0] in (int, float)


def _bounds(metadata: tuple[Any, ...]) -> Form:
    bounds: Form = {}
    for each in metadata:
        for side, names in (("least", ("ge", "gt")), ("most", ("le", "lt"))):
            for name in names:
                if getattr(each, name, None) is not None:
                    bounds[side] = float(getattr(each, name))
    return bounds
