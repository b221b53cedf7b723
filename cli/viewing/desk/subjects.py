"""What can be put right of an artifact, for each kind that edits are of: a map, a graph, a CAD scene.

Each is held as the edits leave it, as every edit is applied to what those before it left: who clicks on a thing means
it as it is now.
"""

from __future__ import annotations

import math
import shutil
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

import trimesh

from cli.edit_node_command import NO_MODEL, NOTHING
from cli.viewing.cad_scene_view import draw_cad_scene_of
from cli.viewing.inputs import input_artifact
from schemas.artifact import Artifact
from schemas.cad_library import CadLibrary
from schemas.cad_scene import CadScene
from schemas.contact_graph import ContactGraph, GraphNode
from schemas.edits import Anchor, AnyEdit, AppliedEdit, Edit
from schemas.errors import BadInput, UsageError
from schemas.panoptic_map import PanopticMap
from stages.edit.anchoring import Conflict, Fitting, anchor_of, anchor_of_node, written_box
from stages.edit.applying import State, Table, apply_edits
from stages.edit.graph_edits import GRAPH_EDITS, GraphState
from stages.edit.map_edits import MAP_EDITS
from stages.edit.map_state import MapState, Thing, read_state
from stages.edit.parameters import EditMapParameters
from stages.edit.scene_edits import SCENE_EDITS, asked_move, joint_anchors
from stages.edit.scene_state import SceneState
from stages.kit.formats.cad_models import read_model
from stages.kit.measurement.cad_candidates import candidates_of
from stages.kit.viewing.canvas import Canvas
from stages.kit.viewing.graphs import draw_graph_over
from stages.kit.viewing.maps import ShownThing, draw_map

FITTING = Fitting(**EditMapParameters.model_validate({}).model_dump())
"""As the steps take it unless they are told otherwise."""
MOST_GENERATIONS = 20
"""Artifacts between one and what it was made from."""
Held = TypeVar("Held", bound=State)


class Subject(ABC, Generic[Held]):
    """An artifact that edits are of, and what they come to."""

    all_edits: ClassVar[Table[Any]]
    option: ClassVar[str]
    """Of the step that applies them, as it is typed."""

    def __init__(self, artifact: Artifact, taken: frozenset[type[Edit]]) -> None:
        self.artifact = artifact
        self.table: Table[Held] = {kind: change for kind, change in self.all_edits.items() if kind not in taken}
        self.state = self.begun()
        self.first = {thing.name: thing.instance for thing in self.state.things()}
        """What things were called before all edits: what is shown may call them so still."""

    @abstractmethod
    def begun(self) -> Held:
        """Return the state before all edits."""

    @abstractmethod
    def draw(self, canvas: Canvas) -> None:
        """Draw it as the edits leave it."""

    @abstractmethod
    def anchor_of(self, thing: Thing) -> Anchor:
        """Return the anchor of a thing as it is now."""

    def restart(self) -> None:
        """Forget the edits."""
        self.state = self.begun()

    def apply(self, edits: Sequence[AnyEdit]) -> list[AppliedEdit]:
        """Apply edits to what those before them left."""
        return apply_edits(self.state, edits, FITTING, self.table)

    def thing(self, name: object) -> Thing:
        """Return the thing that is, or was called so. Raises UsageError."""
        things = self.state.things()
        called = next((thing.instance for thing in things if thing.name == name), self.first.get(str(name)))
        if called is None:
            raise UsageError(f"there is no thing {str(name)!r:.80} here", hint="click on one")
        found = next((thing for thing in things if thing.instance == called), None)
        if found is None:
            raise UsageError(f"{name} is not there any more: an edit took it away", hint="delete that edit first")
        return found

    def fields(self, what: str, form: Sequence[Mapping[str, Any]], asked: Mapping[str, Any]) -> dict[str, Any]:
        """Return the fields of an edit out of what a page asks for, where things are named. Raises UsageError."""
        values: dict[str, Any] = {"what": what}
        for field in form:
            name, kind, given = field["name"], field["kind"], asked.get(field["name"])
            if given is None or (given in (NOTHING, NO_MODEL) and given in field.get("choices", ())):
                continue
            if kind == "thing" and given not in field.get("choices", ()):
                given = self._said(self.thing(given))
            elif kind == "things" and isinstance(given, list):
                given = [self._said(self.thing(one)) for one in given]
            values[name] = given
        return values

    def _said(self, thing: Thing) -> dict[str, Any]:
        return self.anchor_of(thing).model_dump(mode="json", by_alias=True)

    def facts(self) -> dict[str, Any]:
        """Return what a page asks for edits with, as JSON: `things`, by name, and `models`."""
        return {"things": {}, "models": []}

    def command(self) -> str:
        """Return the command that applies the edits, without their file."""
        return f"scenewright edit {self.option} {self.artifact.root}"


class MapSubject(Subject[MapState]):
    """A panoptic map."""

    all_edits = MAP_EDITS
    option = "map --panoptic-map"

    @cached_property
    def _seen(self) -> MapState:
        assert isinstance(self.artifact, PanopticMap)
        return read_state(self.artifact)[0]

    def begun(self) -> MapState:
        """See Subject."""
        seen = self._seen
        seen.things()
        return replace(seen, entities=dict(seen.entities), touched=set(seen.touched), _things=dict(seen._things))

    def anchor_of(self, thing: Thing) -> Anchor:
        """See Subject."""
        return anchor_of(self.state, thing.instance)

    def draw(self, canvas: Canvas) -> None:
        """See Subject."""
        state = self.state
        mesh = trimesh.Trimesh(
            state.surface.vertices, state.surface.faces, vertex_colors=state.surface.colors, process=False
        )
        things = [
            ShownThing(thing.instance, thing.class_name, state.entities[thing.instance].confidence, thing.box)
            for thing in state.things()
        ]
        draw_map(mesh, state.instance, things, canvas)


class GraphSubject(Subject[GraphState]):
    """A contact graph."""

    all_edits: ClassVar[Table[Any]] = GRAPH_EDITS
    option = "graph --contact-graph"

    def begun(self) -> GraphState:
        """See Subject."""
        assert isinstance(self.artifact, ContactGraph)
        return GraphState(self.artifact.info)

    def anchor_of(self, thing: Thing) -> Anchor:
        """See Subject."""
        return anchor_of_node(thing)

    def draw(self, canvas: Canvas) -> None:
        """See Subject."""
        draw_graph_over(self.state.graph, input_artifact(self.artifact, PanopticMap), canvas)

    def facts(self) -> dict[str, Any]:
        """See Subject."""
        nodes = self.state.graph.nodes
        return {"things": {nodes[k.instance].id: self._known(k, nodes[k.instance]) for k in self.state.things()}} | {
            "models": []
        }

    def _known(self, thing: Thing, node: GraphNode) -> dict[str, Any]:
        link = self.state.graph.parent_link(node.id)
        stands = "" if link is None else f"{link.source} {link.relation.replace('_', ' ')} it"
        said = [word for word in (stands, node.mark and f"marked {node.mark}", node.model_id) if word]
        return {"box": written_box(thing.box).model_dump(), "says": "; ".join(said)}


class SceneSubject(GraphSubject):
    """A CAD scene."""

    all_edits: ClassVar[Table[Any]] = SCENE_EDITS
    option = "scene --cad-scene"
    state: SceneState

    @cached_property
    def _folder(self) -> tempfile.TemporaryDirectory[str]:
        """Where models that edits make are written; gone with the desk."""
        return tempfile.TemporaryDirectory(prefix="scenewright-desk-")

    @cached_property
    def _library(self) -> CadLibrary | None:
        return input_artifact(self.artifact, CadLibrary)

    @cached_property
    def _map(self) -> PanopticMap | None:
        return next(behind(self.artifact, PanopticMap), None)

    def begun(self) -> SceneState:
        """See Subject."""
        assert isinstance(self.artifact, CadScene)
        return SceneState(
            self.artifact.graph,
            {entry.node: entry for entry in self.artifact.info.replacements},
            self.artifact,
            None if self._library is None else self._library.path("models"),
            None if self._map is None else self._map.root,
            Path(tempfile.mkdtemp(dir=self._folder.name)),
        )

    def draw(self, canvas: Canvas) -> None:
        """See Subject."""
        assert isinstance(self.artifact, CadScene)
        root = Path(self._folder.name) / "shown"
        shutil.rmtree(root, ignore_errors=True)
        self.state.write(root)
        self.artifact.info.model_copy(update={"replacements": tuple(self.state.replacements.values())}).write(
            root / "scene.json"
        )
        self.state.graph.write(root / "graph.json")
        draw_cad_scene_of(CadScene(root), self._library, self._map, canvas)

    def fields(self, what: str, form: Sequence[Mapping[str, Any]], asked: Mapping[str, Any]) -> dict[str, Any]:
        """See Subject. A joint is meant by its name, a turn is one from where the thing looks now."""
        values = super().fields(what, form, asked)
        kinds = {field["kind"]: field["name"] for field in form}
        node = self.state.graph.nodes[self.thing(asked.get("of")).instance]
        if (name := kinds.get("joint")) is not None:
            values[name] = self._joint(node, str(values.get(name)))
        if (name := kinds.get("place")) is not None:
            turn = values.pop("turn_degrees", 0.0)
            if not isinstance(turn, int | float) or not math.isfinite(turn):
                raise UsageError("turn_degrees: that is no number", hint="leave it out, or give degrees")
            to = values.get(name)
            if to is not None and not _is_place(to):
                raise UsageError(f"{name}: that is no place", hint="click where it goes")
            values |= asked_move(node, to, turn)
        return values

    def _joint(self, node: GraphNode, name: str) -> dict[str, Any]:
        try:
            joints = joint_anchors(self.state, node)
        except Conflict as conflict:
            raise UsageError(str(conflict), hint="a new joint can be cut out of it") from None
        if name not in joints:
            raise UsageError(f"{node.id} has no joint {name!r:.80}", hint=f"it has: {', '.join(joints) or 'none'}")
        return joints[name].model_dump(mode="json")

    def facts(self) -> dict[str, Any]:
        """See Subject."""
        ids = {node.model_id for node in self.state.graph.nodes if node.model_id is not None}
        ids |= set() if self._library is None else {model.id for model in self._library.info.models}
        return super().facts() | {"models": sorted(ids)}

    def _known(self, thing: Thing, node: GraphNode) -> dict[str, Any]:
        known, before = super()._known(thing, node), self.state.replacements.get(node.id)
        folder = None if node.model_id is None else self.state.model_folder(node.model_id)
        joints = [] if folder is None else list(read_model(folder).joints)
        held = set() if before is None else set(before.held)
        tried = [] if before is None else [candidate.model_id for _, candidate in candidates_of(before)]
        return known | {
            "joints": [
                {
                    "name": joint.name,
                    "says": f"{joint.type}, {joint.lower:.3g} to {joint.upper:.3g}, at "
                    f"{node.joints.get(joint.name, 0.0):.3g}" + (", held" if joint.name in held else ""),
                }
                for joint in joints
            ],
            "models": list(dict.fromkeys(tried)),
        }

    def command(self) -> str:
        """See Subject."""
        more = [("--library", self._library), ("--panoptic-map", self._map)]
        return super().command() + "".join(f" {option} {one.root}" for option, one in more if one is not None)


def _is_place(given: object) -> bool:
    return (
        isinstance(given, list)
        and len(given) == 3
        and all(isinstance(value, int | float) and math.isfinite(value) for value in given)
    )


SUBJECTS: tuple[tuple[type[Artifact], type[Subject[Any]]], ...] = (
    (CadScene, SceneSubject),
    (ContactGraph, GraphSubject),
    (PanopticMap, MapSubject),
)
"""The last made first: an edit that several can be asked for is of the first of them."""


def subjects_of(artifact: Artifact, edits: Path) -> list[Subject[Any]]:
    """Return what can be put right of an artifact and of what it was made from, the last made first. Of what the same
    file of edits was applied to, it is what was there before them.

    Raises BadInput where there is nothing, and what reading it raises.
    """
    found: list[Subject[Any]] = []
    taken: frozenset[type[Edit]] = frozenset()
    for kind, subject in SUBJECTS:
        one = next(behind(artifact, kind), None)
        if one is not None:
            found.append(subject(_before(one, edits), taken))
            taken |= found[-1].table.keys()
    if not found:
        raise BadInput(
            f"{artifact.root}: neither it nor anything it was made from can be edited, or that is not there any more",
            hint="give a panoptic map, a contact graph or a CAD scene",
        )
    return found


Kind = TypeVar("Kind", bound=Artifact)


def _before(artifact: Artifact, edits: Path) -> Artifact:
    """Return what an artifact was before the edits of a file were applied to it, where that is there still."""
    for _ in range(MOST_GENERATIONS):
        given = artifact.manifest.inputs if artifact.manifest is not None else ()
        if not any((artifact.root / record.path).resolve() == edits.resolve() for record in given):
            return artifact
        artifact = input_artifact(artifact, type(artifact)) or artifact
    return artifact


def behind(artifact: Artifact, wanted: type[Kind]) -> Iterator[Kind]:
    """Yield the artifact of a kind that one is, or was made from, the nearest first, as far as they are there still."""
    waiting = [artifact]
    for _ in range(MOST_GENERATIONS):
        below: list[Artifact] = []
        for one in waiting:
            if isinstance(one, wanted):
                yield one
                continue
            found = input_artifact(one, wanted)
            if found is not None:
                yield found
                continue
            kinds = {record.kind for record in one.manifest.inputs} if one.manifest is not None else set()
            below += [made for kind in sorted(kinds) if (made := _input_of(one, kind)) is not None]
        waiting = below


def _input_of(artifact: Artifact, kind: str) -> Artifact | None:
    from schemas.kinds import KINDS

    return input_artifact(artifact, KINDS[kind]) if kind in KINDS else None
