"""Masks and geometry agree: what is kept of a mask, what geometry adds, and the reason that each entity keeps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pytest
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.fuse.agreement import MOST, Agreement, agreed
from scenewright.stages.fuse.closing import told
from scenewright.stages.fuse.extraction import ExtractedEntity, LabelledSurface
from scenewright.stages.fuse.layout.evidence import Scene
from scenewright.stages.fuse.looks import Look, Looks
from scenewright.stages.fuse.relabelling import relabelled
from scenewright.stages.fuse.surface import Surface
from scenewright.stages.fuse.testimony import BOUND, BY_MASKS, BY_MOST_LOOKS, GROWN, PIECE
from scenewright.stages.fuse.votes import Votes
from scenewright.stages.kit.formats.map_files import cut_mesh, face_labels
from scenewright.stages.kit.geometry.point_clouds import vertex_areas, vertex_normals

from tests.unit.fuse.rooms import Corners, sheets
from tests.unit.fuse.scenes import THINGS, class_id

VOCABULARY = load_vocabulary()
FLOOR, WALL, CHAIR, CABINET, MONITOR, DOOR, OBJECT = (
    class_id(name) for name in ("floor", "wall", "chair", "cabinet", "monitor", "door", "object")
)
LOOKS, VOXEL = 20, 0.02
CHAIR_AT, COUNTER, ON_IT = (
    ((-1.2, -1.0, 0.0), (-0.7, -0.5, 0.8)),
    ((0.0, 1.4, 0.0), (1.5, 1.98, 0.9)),
    ((0.5, 1.6, 0.92), (0.8, 1.8, 1.2)),
)


@dataclass
class Masks:
    """What masks made of a room of sheets: by instance the vertices, the class, and mean scores by class."""

    boxes: tuple[Corners, ...]
    of: dict[int, tuple[np.ndarray, int, Mapping[int, float]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.vertices, self.faces, self.owner = sheets(*self.boxes)

    def add(self, instance: int, where: np.ndarray, class_name: int, scores: Mapping[int, float] | float) -> Masks:
        self.of[instance] = (where, class_name, {class_name: scores} if isinstance(scores, float) else scores)
        return self

    def labelled(self) -> LabelledSurface:
        """Each instance has a segment of its own; what no mask had is of segment 900 and up, by part."""
        segment, instance, class_of = 900 + self.owner, np.zeros_like(self.owner), np.zeros_like(self.owner)
        for number, (where, name, _) in self.of.items():
            segment, instance, class_of = (
                np.where(where, value, old) for value, old in ((number, segment), (number, instance), (name, class_of))
            )
        return LabelledSurface(*(row.astype(np.int32) for row in (segment, class_of, instance)))

    def surface(self) -> Surface:
        colors = np.zeros((len(self.vertices), 3), np.uint8)
        return Surface(self.vertices.astype(np.float32), self.faces, colors, self.labelled().segment)

    def entities(self) -> list[ExtractedEntity]:
        of_face, surface = face_labels(self.labelled().instance, self.faces), self.surface()
        return [
            ExtractedEntity(k, name, (k,), cut_mesh(surface, np.flatnonzero(of_face == k)), 0.9, LOOKS)
            for k, (_, name, _) in sorted(self.of.items())
        ]

    def votes(self) -> Votes:
        scores = {k: {c: s * LOOKS for c, s in said.items()} for k, (_, _, said) in self.of.items()}
        seen = np.unique(self.labelled().segment).tolist()
        return Votes(scores, dict.fromkeys(seen, LOOKS))

    def agreed(self, minimum_area: float = 0.05) -> Agreement:
        labelled, votes = self.labelled(), self.votes()
        bounds = [FLOOR, WALL, class_id("ceiling")]
        scene = Scene(
            self.vertices,
            vertex_normals(self.vertices, self.faces),
            vertex_areas(self.vertices, self.faces),
            votes.share(labelled.segment, bounds),
            votes.share(labelled.segment, THINGS),
            np.zeros((0, 3)),
            None,
        )
        return agreed(
            self.surface(),
            self.entities(),
            labelled,
            scene,
            votes,
            self.looks(),
            VOCABULARY,
            voxel=VOXEL,
            minimum_area=minimum_area,
        )

    def looks(self) -> Looks:
        """Looks from nowhere, each at all of it, in which every mask has its share."""
        cells, looks = np.floor(self.vertices / VOXEL).astype(np.int32), Looks(VOXEL)
        for number in range(LOOKS):
            mask, said = np.zeros(len(cells), np.uint16), list[tuple[int, float]]()
            for where, _, scores in self.of.values():
                starts = np.cumsum([0.0, *scores.values()])
                for class_name, start, end in zip(scores, starts[:-1], starts[1:], strict=True):
                    if round(LOOKS * start) <= number < round(LOOKS * end):
                        said.append((class_name, 1.0))
                        mask[where] = len(said)
            looks.kept += (Look(cells, mask, tuple(said)),)
        return looks


def check_whole(found: Agreement) -> dict[int, str]:
    """Entities, labels and reasons are of each other; return the class of every instance."""
    classes = {e.instance: VOCABULARY.by_id(e.class_id).name for e in found.entities}
    assert len(classes) == len(found.entities) and set(found.reasons) == set(classes)
    labels = found.labelled
    assert set(np.unique(labels.instance).tolist()) - {0} == set(classes)
    for entity in found.entities:
        assert set(labels.class_id[labels.instance == entity.instance].tolist()) == {entity.class_id}
        assert len(entity.mesh.faces)
    assert not labels.class_id[labels.instance == 0].any()
    return classes


def at(found: Agreement, where: np.ndarray) -> int:
    """The instance that most of these vertices are of."""
    return int(np.bincount(found.labelled.instance[where]).argmax())


def test_a_room_with_masks_of_two_things() -> None:
    masks = Masks((CHAIR_AT, COUNTER, ON_IT))
    masks.add(7, masks.owner >= 3, CABINET, 0.6).add(8, masks.owner == 2, CHAIR, 0.7)
    found = masks.agreed()
    classes = check_whole(found)
    floor, wall, chair, counter, on_it = (at(found, masks.owner == part) for part in range(5))
    assert [classes[k] for k in (floor, wall, chair, counter)] == ["floor", "wall", "chair", "cabinet"]
    assert (chair, counter) == (8, 7) and classes[on_it] == "object", "what stands on it is cut from it"
    shapes = {k: found.reasons[k].shape for k in (floor, wall, chair, counter, on_it)}
    assert list(shapes.values()) == [BOUND, BOUND, BY_MASKS, BY_MASKS, PIECE]
    naming = found.reasons[chair].naming
    assert (
        naming is not None and naming.posterior > 0.6 and found.reasons[chair].said.scores[CHAIR] == pytest.approx(0.7)
    )
    naming = found.reasons[on_it].naming
    assert naming is not None and naming.rule == "nobody named it", "what was said of the cabinet is the cabinet's"
    assert found.reasons[floor].naming is None and found.dropped == ()


def test_without_masks_all_is_found_and_nothing_named() -> None:
    masks = Masks((CHAIR_AT, COUNTER, ON_IT))
    found = masks.agreed()
    assert sorted(check_whole(found).values()) == ["floor", "object", "object", "object", "wall"]
    assert sorted(check_whole(masks.agreed(minimum_area=0.0)).values()) == ["floor", "wall"]


def test_a_part_of_a_chair_is_the_whole_chair() -> None:
    masks = Masks((CHAIR_AT, COUNTER))
    masks.add(8, (masks.owner == 2) & (masks.vertices[:, 2] > 0.4), CHAIR, 0.45)
    found = masks.agreed()
    assert check_whole(found)[8] == "chair" and found.reasons[8].shape == GROWN
    assert (found.labelled.instance[masks.owner == 2] == 8).mean() > 0.95


def test_a_mask_that_runs_over_a_plane_is_dropped_with_the_reason() -> None:
    masks = Masks((CHAIR_AT, COUNTER))
    patch = (masks.owner == 0) & (np.abs(masks.vertices[:, :2] - [1.0, -0.8]) < 0.4).all(axis=1)
    masks.add(8, masks.owner == 2, CHAIR, 0.8).add(9, patch, CHAIR, 0.3)
    found = masks.agreed()
    assert 9 not in check_whole(found)
    assert len(found.dropped) == 1 and found.dropped[0].startswith("flush along")
    assert check_whole(found)[at(found, patch)] == "floor"


@pytest.mark.parametrize(("score", "expected"), [(0.3, "wall"), (0.55, "monitor")])
def test_no_wall_takes_what_masks_are_as_sure_of_as_of_what_stands_free(score: float, expected: str) -> None:
    screen = ((-1.2, 1.96, 1.0), (-0.4, 2.0, 1.5))
    masks = Masks((screen, CHAIR_AT))
    masks.add(8, masks.owner == 3, CHAIR, 0.6).add(9, masks.owner == 2, MONITOR, score)
    found = masks.agreed()
    assert check_whole(found)[at(found, masks.owner == 2)] == expected


@pytest.mark.parametrize("score", [MOST - 0.1, MOST + 0.1])
def test_a_door_is_kept_where_most_looks_had_it(score: float) -> None:
    masks = Masks((COUNTER,))
    where = (masks.owner == 1) & (np.abs(masks.vertices - [-1.0, 2.0, 1.0]) < [0.4, 0.1, 1.0]).all(axis=1)
    masks.add(9, where, DOOR, score)
    found = masks.agreed()
    if score < MOST:
        assert found.dropped == (f"a window, door or curtain that masks had in few looks: {score:.2f}",)
        assert check_whole(found)[at(found, where)] == "wall"
    else:
        assert check_whole(found)[9] == "door" and found.reasons[9].shape == BY_MOST_LOOKS


def test_a_name_that_its_size_speaks_against_goes_and_the_thing_stays() -> None:
    masks = Masks((CHAIR_AT, COUNTER))
    masks.add(8, masks.owner == 2, class_id("cup"), 0.6)
    found = masks.agreed()
    assert check_whole(found)[8] == "object" and found.reasons[8].shape == BY_MASKS
    row = told(8, found.reasons[8], VOCABULARY)
    assert row.name == "no thing of its size has its name" and row.said == {"cup": 0.6}
    assert row.looks == LOOKS and row.posterior == 1.0 and row.runners_up == {}


def test_without_a_floor_and_without_any_surface() -> None:
    masks = Masks((CHAIR_AT, COUNTER))
    kept = masks.owner == 2
    index = np.cumsum(kept) - 1
    masks.faces = index[masks.faces[kept[masks.faces].all(axis=1)]]
    masks.vertices, masks.owner = masks.vertices[kept], masks.owner[kept]
    masks.add(8, masks.owner == 2, CHAIR, 0.7)
    found = masks.agreed()
    assert check_whole(found)[8] == "chair" and found.layout.floor is None
    masks.vertices, masks.faces, masks.owner, masks.of = np.zeros((0, 3)), np.zeros((0, 3), int), np.zeros(0, int), {}
    nothing = masks.agreed()
    assert nothing.entities == [] and nothing.labelled.instance.shape == (0,)


def test_same_masks_same_map() -> None:
    masks = Masks((CHAIR_AT, COUNTER, ON_IT))
    masks.add(7, masks.owner >= 3, CABINET, 0.6).add(8, masks.owner == 2, CHAIR, 0.7)
    first, second = masks.agreed(), masks.agreed()
    assert (first.labelled.instance == second.labelled.instance).all() and first.reasons == second.reasons
    assert [e.segments for e in first.entities] == [e.segments for e in second.entities]


def test_vertices_that_change_hands_take_faces_classes_and_entities_with_them() -> None:
    masks = Masks((CHAIR_AT, COUNTER))
    masks.add(7, masks.owner == 3, CABINET, 0.6).add(8, masks.owner == 2, CHAIR, 0.7)
    surface, entities, labelled = masks.surface(), masks.entities(), masks.labelled()
    same, unchanged = relabelled(surface, entities, labelled, labelled.instance, {})
    assert [e.mesh for e in same] == [e.mesh for e in entities] and (unchanged.class_id == labelled.class_id).all()
    moved = np.where(masks.owner == 2, 7, np.where(masks.owner == 0, 11, labelled.instance)).astype(np.int32)
    kept, labels = relabelled(surface, entities, labelled, moved, {11: FLOOR, 12: WALL})
    assert [(e.instance, e.class_id, e.segments) for e in kept] == [(7, CABINET, (7,)), (11, FLOOR, ())]
    assert (labels.class_id[masks.owner == 0] == FLOOR).all() and (labels.class_id[masks.owner == 2] == CABINET).all()
    assert len(kept[0].mesh.faces) == len(entities[0].mesh.faces) + len(entities[1].mesh.faces)
    lone = np.where(np.arange(len(moved)) == 5, 12, 0).astype(np.int32)
    kept, labels = relabelled(surface, entities, labelled, lone, {12: WALL})
    assert kept == [] and not labels.instance.any(), "no face, no entity"
