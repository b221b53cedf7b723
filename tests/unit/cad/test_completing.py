"""From a map to a scene in physics: a top of which nobody saw the legs stands, and says what of it is inferred."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.stages.cad.completing import completed
from scenewright.stages.cad.free_space import NOTHING_KNOWN
from scenewright.stages.cad.obstacles import obstacles_of
from scenewright.stages.kit.formats.scene_links import INFERRED
from scenewright.stages.kit.formats.urdf_file import parse_urdf
from scenewright.stages.urdf.parameters import UrdfParameters
from scenewright.stages.urdf.stage import run

from tests.panoptic_maps import box_mesh, floor_mesh
from tests.unit.urdf.small_room import context

CLASSES = {1: "floor", 2: "object", 3: "cup"}


def top_in_the_air(replace_objects: Callable[..., CadScene]) -> CadScene:
    """A board at 0.7 m, 3 cm thick, over a floor, and a cup on it; neither has a model."""
    top = trimesh.creation.box((0.8, 0.5, 0.03)).subdivide_to_size(0.04).apply_translation([0, 0, 0.715])
    meshes = {1: floor_mesh((-2, -2), (2, 2)), 2: top, 3: box_mesh((-0.04, -0.04, 0.73), (0.04, 0.04, 0.83))}
    return replace_objects(meshes, CLASSES, built_ins=False, stretched=False, recognition_error=0.0)


def in_physics(scene: CadScene, folder: Path) -> InteractiveScene:
    return run(scene, parameters=UrdfParameters(), context=context(folder))


def test_a_top_that_floats_stands_on_inferred_legs(replace_objects: Callable[..., CadScene], tmp_path: Path) -> None:
    scene = top_in_the_air(replace_objects)
    [entry] = [entry for entry in scene.info.replacements if entry.node == "object_2"]
    assert entry.decision == "mesh" and entry.inferred is not None
    assert entry.inferred.what == "4 legs of up to 700 mm"
    assert entry.inferred.because == "what was seen ends 700 mm above floor_1 and would not stand there"
    low = [np.min(corners, axis=0)[2] for corners in entry.inferred.pieces]
    assert low == pytest.approx([0.0] * 4, abs=1e-3)

    made = in_physics(scene, tmp_path / "urdf")
    assert made.outcome == "ok", made.summary
    [body] = [body for body in made.info.bodies if body.name == "object_2"]
    assert body.movable and body.furniture
    assert body.because == f"inferred: {entry.inferred.what}; {entry.inferred.because}"
    [link] = [link for link in parse_urdf(made.path("scene.urdf")).links if link.name == "object_2"]
    drawn = [shape for shape in link.visuals if shape.color == pytest.approx(INFERRED)]
    names = {f"meshes/object_2/inferred_{number}.obj" for number in range(4)}
    assert {shape.mesh for shape in drawn} == names <= {shape.mesh for shape in link.collisions}
    seen = [shape for shape in link.visuals if shape not in drawn]
    assert [shape.mesh for shape in seen] == ["meshes/object_2/visual.obj"]


def test_legs_end_where_the_floor_has_its_slab_in_physics(replace_objects: Callable[..., CadScene]) -> None:
    """A floor that slopes in the map is level in physics, here 2 cm lower than below the board."""
    scene = top_in_the_air(replace_objects)
    pieces = obstacles_of(scene.graph, scene.path("layout"), scene.path("meshes"))
    found = completed(scene.graph, scene.path("meshes"), pieces, {"floor_1": -0.02}, {}, NOTHING_KNOWN)
    low = [np.min(corners, axis=0)[2] for corners in found["object_2"].pieces]
    assert low == pytest.approx([-0.02] * 4, abs=1e-4)


def test_what_has_no_room_to_stand_is_held_and_says_so(
    replace_objects: Callable[..., CadScene], tmp_path: Path
) -> None:
    """The same scene without what was added: the board is held, the cup on it free."""
    scene = top_in_the_air(replace_objects)
    file = scene.info
    bare = [
        entry.model_copy(update={"inferred": None}) if entry.node == "object_2" else entry
        for entry in file.replacements
    ]
    file.model_copy(update={"replacements": tuple(bare)}).write(scene.path("scene.json"))
    made = in_physics(CadScene(scene.root), tmp_path / "urdf")
    [body] = [body for body in made.info.bodies if body.name == "object_2"]
    assert not body.movable and body.because == "held: it would not stand"
    assert next(body for body in made.info.bodies if body.name == "cup_3").movable
