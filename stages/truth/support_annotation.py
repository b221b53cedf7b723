"""Support annotations: small JSON files, written by hand, that say what carries what in a real scene (docs/FORMATS.md).

`nodes` are the things: a name, a class of the vocabulary, and how to find them, by their values in the label images or
by a box or a point in the world of the sequence. `relations` give each of them what carries it. What the annotator
could not tell is named too, so that nobody is measured against a guess.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field
from scenewright.schemas.base import Model, Name
from scenewright.schemas.contact_graph import SCENE_NODE
from scenewright.schemas.errors import BadInput
from scenewright.schemas.hand_written import Point, UprightBox
from scenewright.schemas.vocabulary import load_vocabulary

LARGEST_FILE = 4 * 2**20
"""Most bytes of an annotation. A scene has a few dozen things."""
HINT = 'docs/FORMATS.md, "Support annotations", shows one'


class Whereabouts(Model):
    """How a thing is found; exactly one of the three."""

    labels: tuple[Annotated[int, Field(ge=1, le=65535)], ...] = ()
    """Values of the label images that are this thing."""
    box: UprightBox | None = None
    """World of the sequence."""
    point: Point | None = None
    """A point on its surface, world of the sequence [m]: the thing is what a map holds there."""


class AnnotatedNode(Model):
    """One thing of the scene."""

    name: Name
    class_name: str = Field(alias="class")
    find: Whereabouts
    optional: bool = False
    """Finding it is no merit, missing it no fault (hardly seen, or cut off by the border of the images)."""
    note: str = ""


class AnnotatedRelation(Model):
    """What carries one thing."""

    child: Name
    parent: Name
    """A node, or `scene`."""
    relation: Literal["supports", "contains", "carries_on_wall", "hangs_from"] = "supports"
    also: tuple[Name, ...] = ()
    """Further carriers. Where they and the parent carry alike, which of them stands as parent means nothing."""
    leans_on: tuple[Name, ...] = ()
    """What keeps it from falling over."""
    uncertain: tuple[Name, ...] = ()
    """What may carry or hold it too: such an edge counts neither way."""
    note: str = ""

    def carriers(self) -> tuple[str, ...]:
        """The parent and the further carriers."""
        return (self.parent, *self.also)


class Making(Model):
    """Who made an annotation, and how."""

    by: str = Field(min_length=1)
    how: str = Field(min_length=1)
    date: str = Field(pattern=r"^\d{4}-\d{2}-\d{2}$")


class SupportAnnotation(Model):
    """The whole file."""

    format: Literal["scenewright-supports"]
    version: Literal[1]
    scene: str = Field(min_length=1)
    """Which recording it is about, in words or as a path within its data set."""
    made: Making
    note: str = ""
    nodes: tuple[AnnotatedNode, ...] = Field(min_length=1)
    relations: tuple[AnnotatedRelation, ...]

    def relation_of(self, name: str) -> AnnotatedRelation | None:
        """What carries the node `name`; None for layout that nothing is said about."""
        return next((relation for relation in self.relations if relation.child == name), None)


def read_support_annotation(path: Path) -> SupportAnnotation:
    """Read and check a support annotation.

    Raises BadInput when it is missing, too large, no JSON of this format and version, or says what cannot be: a name or
    label twice, an unknown class or node, an object that nothing carries or that carries itself by way of others.
    """
    annotation = SupportAnnotation.read(path, largest=LARGEST_FILE, hint=HINT)
    problem = next(contradictions(annotation), None)
    if problem is not None:
        raise BadInput(f"{path}: {problem}", hint=HINT)
    return annotation


def contradictions(annotation: SupportAnnotation) -> Iterator[str]:
    """Yield what an annotation says that cannot be, in words."""
    names = [node.name for node in annotation.nodes]
    yield from (f"node {name} is there twice" for name in _repeated_values(names))
    yield from ("a node may not be called scene, the root is" for name in names if name == SCENE_NODE)
    labels = [label for node in annotation.nodes for label in node.find.labels]
    yield from (f"label {label} is of two nodes" for label in _repeated_values(labels))
    classes = {entry.name: entry for entry in load_vocabulary().classes}
    for node in annotation.nodes:
        if node.class_name not in classes:
            yield f"node {node.name}: class {node.class_name!r:.60} is not in data/vocabulary.toml"
        if sum((bool(node.find.labels), node.find.box is not None, node.find.point is not None)) != 1:
            yield f"node {node.name}: find takes exactly one of labels, box and point"
    if labels and not all(node.find.labels for node in annotation.nodes):
        yield "some nodes are found by labels and some in the world; one file takes one way"
    yield from (
        f"{name} is the child of two relations" for name in _repeated_values(r.child for r in annotation.relations)
    )
    for relation in annotation.relations:
        others = (*relation.carriers(), *relation.leans_on, *relation.uncertain)
        for name in (relation.child, *others):
            if name not in names and not (name == SCENE_NODE and name != relation.child):
                yield f"relation of {relation.child}: there is no node {name}"
        if relation.child in others:
            yield f"{relation.child} is said to carry itself"
        yield from (f"relation of {relation.child}: {name} is named twice" for name in _repeated_values(others))
    layout = {
        node.name for node in annotation.nodes if node.class_name in classes and classes[node.class_name].is_layout
    }
    children = {relation.child for relation in annotation.relations}
    yield from (f"nothing is said to carry {name}" for name in names if name not in children | layout)
    circle = _circle({relation.child: relation.carriers() for relation in annotation.relations})
    if circle is not None:
        yield f"{circle} carries itself by way of others"


def _repeated_values(values: Iterable[str | int]) -> list[str | int]:
    """Values that come a second time, in order."""
    earlier: set[str | int] = set()
    return [value for value in values if value in earlier or earlier.add(value)]  # type: ignore[func-returns-value]


def _circle(carriers: dict[str, tuple[str, ...]]) -> str | None:
    """A node that is reached from itself by going from child to carriers, or None."""
    below = dict(carriers)
    while below:
        # What rests on nothing that still stands there can be taken away.
        free = [name for name, on in below.items() if not any(carrier in below for carrier in on)]
        if not free:
            return min(below)
        for name in free:
            del below[name]
    return None
