"""What a room has in files beside its things: its lamp, the sides of its walls that are drawn, and its doubts."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scenewright.schemas.base import as_transform
from scenewright.schemas.cad_scene import (
    CadCandidate,
    CadScene,
    CadSceneFile,
    Explained,
    Replacement,
    ShellFile,
    ShellPanel,
)
from scenewright.schemas.scene_parts import Box
from scenewright.stages.kit.formats.link_meshes import Surface
from scenewright.stages.kit.formats.scene_bundle import BundleBody
from scenewright.stages.kit.formats.scene_light import BELOW_CEILING, USUAL_HEIGHT, light_of
from scenewright.stages.urdf.doubts import ASSUMED, doubts_of
from scenewright.stages.urdf.exporters.glb import towards

FLOOR = ("floor", Box(center=(1.0, 2.0, -0.1), size=(4.0, 4.0, 0.2)))
WALL = ("wall", Box(center=(3.0, 2.0, 1.25), size=(0.1, 4.0, 2.5)))
CEILING = ("ceiling", Box(center=(1.0, 2.0, 2.5), size=(4.0, 4.0, 0.2)))


@pytest.mark.parametrize(
    ("bodies", "height"),
    [([FLOOR], USUAL_HEIGHT), ([FLOOR, WALL], 2.5 - BELOW_CEILING), ([FLOOR, WALL, CEILING], 2.4 - BELOW_CEILING)],
)
def test_the_lamp_hangs_over_the_middle_of_the_floor_below_the_ceiling(bodies, height):
    assert light_of(bodies).position == pytest.approx((1.0, 2.0, height))
    assert light_of([]).position == pytest.approx((0.0, 0.0, USUAL_HEIGHT))


def test_of_a_closed_wall_the_side_towards_the_room_is_drawn():
    plate = trimesh.creation.box((4.0, 0.1, 2.0))
    surface = Surface(plate.vertices.astype(np.float32), plate.faces.astype(np.uint32), (1.0, 1.0, 1.0, 1.0))
    drawn = towards(surface, np.array([0.0, 3.0, 0.0]))
    assert len(drawn.faces) == 2 and np.allclose(drawn.vertices[:, 1], 0.05) and len(drawn.vertices) == 4


def test_a_scene_lists_what_nobody_should_trust(tmp_path):
    candidate = CadCandidate(
        model_id="chair_01", scale=1.0, world_from_model=as_transform(np.eye(4)), matching_error=0, alignment_error=0
    )

    def stands(name: str, share: float) -> Replacement:
        told = Explained(area=1.0, by_model=share, by_mesh=0.0)
        return Replacement(node=name, decision="cad", chosen=candidate, explained=told)

    entries = (stands("chair_1", 0.9), stands("chair_2", 0.4), Replacement(node="heap_3", decision="mesh"))
    CadSceneFile(replacements=entries, conflicts_before=0, conflicts_after=0, iterations=0).write(
        tmp_path / "scene.json"
    )
    plates = [((0.0, 0.0, 3.0, 2.0), 1.0), ((0.0, 0.0, 1.0, 2.0), 0.5)]
    panels = tuple(
        ShellPanel(
            node="wall_4", world_from_panel=as_transform(np.eye(4)), thickness=0.1, boxes=(box,), open_area=0, seen=seen
        )
        for box, seen in plates
    )
    ShellFile(panels=panels).write(tmp_path / "shell.json")
    box = Box(center=(0, 0, 0), size=(1, 1, 1))
    bodies = [
        BundleBody(name, "object", None, "supports", np.eye(4), False, box, because=why)
        for name, why in (("chair_1", ""), ("chair_2", ""), ("heap_3", "held: it lies in chair_1"), ("wall_4", ""))
    ]
    told = [(doubt.name, doubt.says) for doubt in doubts_of(CadScene(tmp_path), bodies)]
    assert told == [
        ("chair_2", "its model lies near 40% of what was seen of it"),
        ("heap_3", "held: it lies in chair_1"),
        ("heap_3", "its shape is what was mapped: what nobody saw of it is missing"),
        ("wall_4", "inferred: nobody saw 12% of its face"),
        *(("scene", text) for text in ASSUMED),
    ]
