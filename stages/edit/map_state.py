"""A panoptic map while it is edited: its surface, what each vertex is part of, and what is known of each thing."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.errors import BadInput
from scenewright.schemas.panoptic_map import EntitiesFile, Entity, PanopticMap
from scenewright.schemas.scene_parts import Box
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.formats.map_files import cut_mesh, face_labels, mesh_name
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.kit.formats.ply_files import ColoredMesh
from scenewright.stages.kit.geometry.boxes import minimum_box
from scenewright.stages.kit.geometry.transforms import apply
from scipy.spatial import cKDTree

GREY = 128
"""Grey value, of 255, of surfaces without a colour."""
HINT = "make the panoptic map again"


@dataclass(frozen=True)
class Thing:
    """A thing as anchors see it."""

    instance: int
    class_name: str
    box: Box
    surface: cKDTree | None = None
    """Of its vertices [m]; None in a graph, which knows boxes."""
    node: str = ""
    """Id of its node, where a graph says one."""

    @property
    def name(self) -> str:
        """What its node is called."""
        return self.node or f"{self.class_name}_{self.instance}"


@dataclass
class MapState:
    """Arrays are replaced, never written into."""

    surface: ColoredMesh
    instance: np.ndarray
    """(V,) int32, 0 none."""
    segment: np.ndarray
    """(V,) int32."""
    entities: dict[int, Entity]
    """By instance. Counts of meshes and bounds are those of before the edits until `finished`."""
    voxel_size: float
    """[m]"""
    touched: set[int] = field(default_factory=set)
    """Instances whose surface is no longer that of the map that was read."""
    renamed: set[int] = field(default_factory=set)
    """Instances whose class a person gave."""
    next_instance: int = 1
    turned: np.ndarray | None = None
    """(4, 4) from the world in which the map was read, where it was turned."""
    _things: dict[int, Thing] = field(default_factory=dict)
    _tree: tuple[ColoredMesh, cKDTree] | None = None

    def things(self) -> list[Thing]:
        """Return the things that have a surface, ascending by instance."""
        missing = [instance for instance in self.entities if instance not in self._things]
        if missing:
            order = np.argsort(self.instance, kind="stable")
            ends = np.searchsorted(self.instance[order], [(instance, instance + 1) for instance in missing])
            for instance, (start, end) in zip(missing, ends, strict=True):
                if end > start:
                    points = self.surface.vertices[order[start:end]].astype(float)
                    class_name = self.entities[instance].class_name
                    self._things[instance] = Thing(instance, class_name, minimum_box(points), cKDTree(points))
        return [self._things[instance] for instance in sorted(self._things) if instance in self.entities]

    def name_of(self, instance: int) -> str:
        """Return what a thing is called."""
        return f"{self.entities[instance].class_name}_{instance}"

    def called(self, points: np.ndarray, reach: float) -> np.ndarray:
        """Return the instance (N,) of the vertex that is nearest to each point (N, 3), -1 beyond `reach` [m]."""
        if self._tree is None or self._tree[0] is not self.surface:
            self._tree = (self.surface, cKDTree(self.surface.vertices.astype(float)))
        distance, nearest = self._tree[1].query(points, distance_upper_bound=reach)
        return np.where(np.isfinite(distance), np.append(self.instance, 0)[nearest], -1)

    def relabel(self, chosen: np.ndarray, instance: int) -> None:
        """Give the chosen vertices (V,) bool to an instance, 0 for none."""
        changed = {int(k) for k in np.unique(self.instance[chosen])} | {instance}
        self.instance = np.where(chosen, np.int32(instance), self.instance)
        for k in changed - {0}:
            self.touched.add(k)
            self._things.pop(k, None)

    def rename(self, instance: int, class_name: str) -> None:
        """Give a thing another class, of which a person is sure."""
        self.entities[instance] = self.entities[instance].model_copy(
            update={"class_name": class_name, "confidence": 1.0}
        )
        self.renamed.add(instance)
        if instance in self._things:
            self._things[instance] = replace(self._things[instance], class_name=class_name)

    def remove(self, instance: int) -> None:
        """Drop a thing whose surface was given away."""
        self.entities.pop(instance)
        self._things.pop(instance, None)

    def new_entity(self, class_name: str, observations: int) -> int:
        """Enter a thing that a person named, without surface so far, and return its instance."""
        instance = self.next_instance
        self.next_instance += 1
        self.entities[instance] = Entity(
            instance=instance,
            class_name=class_name,
            mesh=mesh_name(instance),
            vertices=0,
            triangles=0,
            box_minimum=(0.0, 0.0, 0.0),
            box_maximum=(0.0, 0.0, 0.0),
            confidence=1.0,
            observations=observations,
            segments=(),
        )
        return instance

    def add_surface(self, vertices: np.ndarray, faces: np.ndarray, instance: int) -> None:
        """Add grey triangles (F, 3) between vertices (N, 3) [m] to the map, of an instance and of no segment."""
        first, count = len(self.surface.vertices), len(vertices)
        self.surface = ColoredMesh(
            np.concatenate([self.surface.vertices, vertices.astype(np.float32)]),
            np.concatenate([self.surface.faces, (faces + first).astype(np.int32)]),
            np.concatenate([self.surface.colors, np.full((count, 3), GREY, np.uint8)]),
        )
        self.instance = np.concatenate([self.instance, np.full(count, instance, np.int32)])
        self.segment = np.concatenate([self.segment, np.zeros(count, np.int32)])
        self.touched.add(instance)
        self._things.pop(instance, None)

    def turn(self, motion: np.ndarray) -> None:
        """Move the whole map by (4, 4)."""
        vertices = apply(motion, self.surface.vertices.astype(float)).astype(np.float32)
        self.surface = replace(self.surface, vertices=vertices)
        self.turned = motion if self.turned is None else motion @ self.turned
        self.touched |= set(self.entities)
        self._things.clear()

    def class_ids(self) -> np.ndarray:
        """Return the class id (V,) int32 of every vertex."""
        vocabulary = load_vocabulary()
        table = np.zeros(int(self.instance.max(initial=0)) + 1, dtype=np.int32)
        for instance, entity in self.entities.items():
            if instance < len(table):
                table[instance] = vocabulary.by_name(entity.class_name).id
        return table[self.instance]

    def finished(self) -> tuple[list[Entity], dict[int, ColoredMesh]]:
        """Return the entities, ascending, and the meshes of those whose surface was touched.

        Touched things that are left without a triangle are dropped, and their vertices are of none.
        """
        of_face = face_labels(self.instance, self.surface.faces)
        meshes = {}
        for instance in sorted(self.touched & set(self.entities)):
            mesh = cut_mesh(self.surface, np.flatnonzero(of_face == instance))
            if not len(mesh.faces):
                self.instance = np.where(self.instance == instance, np.int32(0), self.instance)
                self.remove(instance)
                continue
            meshes[instance] = mesh
            self.entities[instance] = self.entities[instance].model_copy(
                update={
                    "vertices": len(mesh.vertices),
                    "triangles": len(mesh.faces),
                    "box_minimum": as_vector(mesh.vertices.min(axis=0)),
                    "box_maximum": as_vector(mesh.vertices.max(axis=0)),
                }
            )
        return [self.entities[instance] for instance in sorted(self.entities)], meshes


def read_state(panoptic_map: PanopticMap) -> tuple[MapState, EntitiesFile]:
    """Read a map for editing. Raises BadInput when its files do not fit each other."""
    info = panoptic_map.info
    mesh = read_mesh(panoptic_map.path("mesh.ply"), may_be_empty=True, hint=HINT)
    vertices = np.asarray(mesh.vertices, dtype=np.float32).reshape(-1, 3)
    painted = getattr(mesh.visual, "vertex_colors", None)
    colors = np.full((len(vertices), 3), GREY, np.uint8) if painted is None else np.asarray(painted)[:, :3]
    path = panoptic_map.path("mesh_labels.npz")
    instance, segment = read_arrays(path, "instance", "segment", shapes=("V", "V"), hint=HINT)
    if len(instance) != len(vertices):
        raise BadInput(f"{path}: {len(instance)} labels for {len(vertices)} vertices", hint=HINT)
    entities = {entity.instance: entity for entity in info.entities}
    if len(entities) != len(info.entities):
        raise BadInput(f"{panoptic_map.root}: an instance label is used twice", hint=HINT)
    surface = ColoredMesh(vertices, np.asarray(mesh.faces, np.int32).reshape(-1, 3), colors.astype(np.uint8))
    highest = max([0, *entities, int(instance.max(initial=0))])
    return MapState(
        surface,
        instance.astype(np.int32),
        segment.astype(np.int32),
        entities,
        info.voxel_size,
        next_instance=highest + 1,
    ), info
