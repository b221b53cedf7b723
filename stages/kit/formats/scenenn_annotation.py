"""The XML half of SceneNN's annotation (Hua et al. 2016): what each label of the mesh is.

`<annotation><label id="8844" text="chair" nyu_class="chair" obbox="..." aabbox="..."/>...</annotation>`: `id` is the
value of the mesh's vertex property `label`; `text` is what the annotator wrote, often empty; `nyu_class` stands in the
later files of a part of the scenes only. `obbox` (centre, edge lengths, quaternion x y z w) and `aabbox` (minimum,
maximum) are not read, as the mesh gives both.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import file_content
from scenewright.stages.kit.formats.xml_files import parse_xml

LARGEST_FILE = 64 * 2**20
"""Largest annotation [bytes]. A scene has a few hundred labels."""
LARGEST_ID = 2**31 - 1
"""Largest id of an annotation: a signed 32-bit number."""
HINT = "give the <scene>.xml that SceneNN has beside the mesh"


@dataclass(frozen=True)
class AnnotatedLabel:
    """One label of the mesh."""

    id: int
    text: str
    """What the annotator wrote, lower case without white space around; may be empty."""
    nyu_class: str = ""


def read_annotation(path: Path) -> dict[int, AnnotatedLabel]:
    """Return the labels of an annotation by id.

    Raises BadInput when the file is missing, too large, no XML, declares entities, is no annotation, holds no label, or
    has an id that is no positive number or occurs twice.
    """
    root = parse_xml(file_content(path, LARGEST_FILE, hint=HINT), str(path))
    if root.tag != "annotation":
        raise BadInput(f"{path}: the root is <{root.tag[:40]}>, expected <annotation>", hint=HINT)
    labels: dict[int, AnnotatedLabel] = {}
    for number, element in enumerate(root.findall("label"), start=1):
        identity = (element.get("id") or "").strip()
        if not (identity.isascii() and identity.isdigit() and len(identity) < 11 and int(identity) <= LARGEST_ID):
            raise BadInput(f"{path}: label {number}: id {identity[:40]!r} is not a label of a mesh", hint=HINT)
        if int(identity) in labels:
            raise BadInput(f"{path}: label {number}: id {identity} occurs twice", hint=HINT)
        text, nyu_class = ((element.get(name) or "").strip().lower() for name in ("text", "nyu_class"))
        labels[int(identity)] = AnnotatedLabel(int(identity), text, nyu_class)
    if not labels:
        raise BadInput(f"{path}: holds no label", hint=HINT)
    return labels


def class_by_substring(label: AnnotatedLabel, words: Mapping[str, str]) -> str | None:
    """Return the class of the first word (in the order of `words`) that occurs in the text, or None.

    As the thesis's evaluation code decides: `nyu_class` never counts there, and `garbage bag` or `table lamp` are a bag
    and a table.
    """
    return next((name for word, name in words.items() if word in label.text), None)


def class_by_last_word(label: AnnotatedLabel, words: Mapping[str, str]) -> str | None:
    """Return the class that the last word of the text names, else the last of `nyu_class`, or None."""
    for text in (label.text, label.nyu_class):
        letters = "".join(character if character.isalpha() else " " for character in text).split()
        if letters and letters[-1] in words:
            return words[letters[-1]]
    return None
