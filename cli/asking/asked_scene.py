"""A map, graph or scene that is asked: its things with names, what stands on what, and the images of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from scenewright.cli.viewing.desk.generations import behind
from scenewright.schemas.artifact import Artifact
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraph, ContactGraphFile
from scenewright.schemas.errors import BadInput
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.scene_parts import Box
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.vocabulary import UNNAMED
from scenewright.stages.kit.formats.entity_meshes import EntityMesh, load_entity_mesh
from scenewright.stages.kit.geometry.boxes import minimum_box
from scenewright.stages.kit.open_words.reading.evidence import ALONE, Names, colors_of, names_of_map
from scenewright.stages.kit.open_words.reading.matching import Thing, is_layout

KINDS = (PanopticMap, ContactGraph, CadScene, InteractiveScene)


@dataclass(frozen=True)
class AskedThing:
    """A thing with what it is called, where it is, and what it may be."""

    name: str
    class_name: str
    box: Box
    thing: Thing


class AskedScene:
    """An artifact that is asked. Raises BadInput for another kind, a map that is not at hand, and one without names."""

    def __init__(self, artifact: Artifact) -> None:
        if not isinstance(artifact, KINDS):
            kinds = ", ".join(kind.kind for kind in KINDS)
            raise BadInput(f"{artifact.root}: a {artifact.kind!r} cannot be asked", hint=f"give one of {kinds}")
        panoptic_map = next(behind(artifact, PanopticMap), None)
        if panoptic_map is None:
            raise BadInput(f"{artifact.root}: the map that it was made of is not there", hint="ask the map itself")
        self.artifact, self.map = artifact, panoptic_map
        self.graph = graph_of(artifact)
        self.things = self._things()
        if all(not each.thing.names.shares or each.thing.is_layout for each in self.things):
            raise BadInput(
                f"{artifact.root}: nothing in it has a name", hint="segment it with a network, or edit its names"
            )

    @cached_property
    def sequence(self) -> Sequence | None:
        """The images, where they are at hand."""
        return next(behind(self.map, Sequence), None)

    @cached_property
    def meshes(self) -> dict[int, EntityMesh]:
        """Instance -> surface of the map."""
        entities = [entity for entity in self.map.info.entities if entity.vertices]
        return {entity.instance: load_entity_mesh(self.map.path(entity.mesh)) for entity in entities}

    @property
    def names(self) -> dict[int, str]:
        """Instance -> what the thing is called."""
        return {each.thing.instance: each.name for each in self.things}

    def carrier(self, name: str) -> str:
        """Return what carries or holds a thing; "" where nobody knows."""
        link = None if self.graph is None else self.graph.parent_link(name)
        return "" if link is None or link.source == SCENE_NODE else link.source

    def _things(self) -> list[AskedThing]:
        names = names_of_map(self.map)
        nodes = {} if self.graph is None else {node.instance: node for node in self.graph.nodes if node.instance}
        found = []
        for entity in self.map.info.entities:
            mesh, node = self.meshes.get(entity.instance), nodes.get(entity.instance)
            if mesh is None or (nodes and node is None):
                continue
            class_name = entity.class_name if node is None else node.class_name
            box = node.box if node is not None and node.box is not None else minimum_box(mesh.vertices)
            thing = Thing(
                entity.instance,
                as_called(names[entity.instance], entity.class_name, class_name),
                colors_of(mesh.colors),
                max(box.size),
                is_layout(class_name),
            )
            found.append(
                AskedThing(f"{class_name}_{entity.instance}" if node is None else node.id, class_name, box, thing)
            )
        return found


def graph_of(artifact: Artifact) -> ContactGraphFile | None:
    """Return what stands on what; None of a map."""
    if isinstance(artifact, ContactGraph):
        return artifact.info
    return artifact.graph if isinstance(artifact, CadScene | InteractiveScene) else None


def as_called(names: Names, in_map: str, class_name: str) -> Names:
    """Return the names of a thing that a scene or a person calls otherwise than the map: that one is certain."""
    if class_name in (in_map, UNNAMED):
        return names
    return replace(names, shares={class_name: ALONE}, looks=0.0)
