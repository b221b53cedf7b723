"""The step `urdf`: from a CAD scene on disk to an interactive scene."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scenewright.schemas.cad_scene import CadScene, CadSceneFile
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.stages.kit.formats.cad_models import model_folder
from scenewright.stages.kit.formats.urdf_file import parse_urdf
from scenewright.stages.kit.viewing.page.page_canvas import PageCanvas
from scenewright.stages.kit.viewing.scenes import draw_settling
from scenewright.stages.urdf.parameters import UrdfParameters
from scenewright.stages.urdf.stage import run

from tests.unit.urdf.small_room import context, graph_of, placed, room


@pytest.fixture
def cad_scene(library, tmp_path) -> CadScene:
    """The small room, with a monitor that kept its reconstructed mesh."""
    root = tmp_path / "cad_scene"
    for folder in ("models", "meshes", "layout"):
        (root / folder).mkdir(parents=True)
    bodies = [*room(library), placed(library, "monitor_8", "monitor_00", (0.1, -0.1, 0.7), parent="table_3")]
    for body in bodies:
        if body.model is not None:
            shutil.copytree(model_folder(library, body.model.id), root / "models" / body.model.id, dirs_exist_ok=True)
    sheet = trimesh.creation.box((3, 3, 0.01))
    sheet.export(root / "layout" / "floor_1.ply")
    blob = trimesh.creation.icosphere(subdivisions=2, radius=0.2)
    blob.apply_translation([0.1, -0.1, 0.9])
    blob.export(root / "meshes" / "monitor_8.ply")
    graph = graph_of(bodies)
    kept = {"model_id": None, "world_from_model": None, "scale": None}
    nodes = tuple(node.model_copy(update=kept) if node.id == "monitor_8" else node for node in graph.nodes)
    graph.model_copy(update={"nodes": nodes}).write(root / "graph.json")
    CadSceneFile(replacements=(), conflicts_before=0, conflicts_after=0, iterations=0).write(root / "scene.json")
    return CadScene(root)


def test_supports_become_joints_by_what_is_movable(cad_scene, tmp_path):
    made = run(cad_scene, parameters=UrdfParameters(), context=context(tmp_path / "out"))
    assert made.outcome == "unsettled" and "cup_7 moves 994 mm" in made.summary["reason"]
    counted = ("bodies", "movable", "joints", "cad_models", "settled", "unstable", "fell_through", "blocked_joints")
    assert [made.summary[key] for key in counted] == [8, 3, 1, 5, 0, 1, 0, 0]
    assert made.summary["largest_move_mm"] == pytest.approx(994, abs=5)
    assert made.summary["collisions"] == 0 and made.summary["max_penetration_mm"] == pytest.approx(
        5
    )  # the sheet is the floor
    joints = {joint.child: (joint.parent, joint.type) for joint in parse_urdf(made.path("scene.urdf")).joints}
    assert joints["cup_5"] == ("table_3", "floating")
    assert joints["table_3"] == ("floor_1", "fixed")
    assert joints["monitor_8"] == ("table_3", "fixed")
    assert joints["fridge_4__door"] == ("fridge_4", "revolute")
    assert made.graph == cad_scene.graph
    monitor = next(body for body in made.info.bodies if body.name == "monitor_8")
    pose = np.array(monitor.world_from_body)
    visual = trimesh.load(made.root / "meshes/monitor_8/visual.obj", force="mesh", process=False)
    assert (visual.bounds + pose[:3, 3])[0] == pytest.approx([-0.1, -0.3, 0.7], abs=0.01)


def test_how_things_settle_is_kept_and_played(cad_scene, tmp_path):
    """The cup that hangs in the air is seen falling, the one on the table standing still; what fails is said when."""
    made = run(cad_scene, parameters=UrdfParameters(), context=context(tmp_path / "out"))
    settling = made.settling
    assert settling is not None and settling.verdict == "unsettled" and settling.times[-1] == pytest.approx(3.0)
    bodies = {body.name: body for body in settling.bodies}
    falling = bodies["cup_7"]
    heights = [pose[2] for pose in falling.poses]
    assert len(heights) == len(settling.times) and heights[0] - heights[-1] == pytest.approx(0.994, abs=0.005)
    assert falling.leaves == pytest.approx(0.05) and bodies["cup_5"].leaves is None and bodies["cup_5"].poses == ()
    canvas = PageCanvas("settling")
    draw_settling(made, canvas)
    page = canvas.page().decode()
    drawn = json.loads(page.split('<script id="document" type="application/json">')[1].split("</script>")[0])
    places = [(item["time"], item["rows"][11]) for item in drawn["transforms"] if item["path"] == "scene/cup_7"]
    assert places[0] == (0.0, pytest.approx(heights[0], abs=1e-3))
    assert places[-1] == (pytest.approx(3.0), pytest.approx(heights[-1], abs=1e-3))
    bad = [moment for moment in drawn["moments"] if moment["bad"]]
    assert [moment["time"] for moment in bad] == [pytest.approx(0.05), pytest.approx(3.0)]
    assert "cup_7 does not stay: 994 mm" in bad[0]["text"]
    quiet = run(cad_scene, parameters=UrdfParameters(settle_seconds=0), context=context(tmp_path / "quiet"))
    assert quiet.settling is None


def test_what_has_no_name_is_a_static_body(cad_scene, tmp_path):
    counter = trimesh.creation.box(bounds=[(-1.4, 1.0, 0.0), (-0.9, 1.4, 0.9)])
    counter.export(cad_scene.root / "meshes" / "surroundings.ply")
    quick = UrdfParameters(settle_seconds=0, rest=False)
    made = run(cad_scene, parameters=quick, context=context(tmp_path / "out"))
    body = next(body for body in made.info.bodies if body.name == "surroundings")
    assert not body.movable and body.parent is None
    joint = next(joint for joint in parse_urdf(made.path("static.urdf")).joints if joint.child == "surroundings")
    assert (joint.parent, joint.type) == ("world", "fixed")
    assert np.array(body.box.center) == pytest.approx([-1.15, 1.2, 0.45])
    assert made.graph == cad_scene.graph, "it is not a node"


def test_what_hangs_in_the_air_is_named(cad_scene, tmp_path, caplog):
    run(cad_scene, parameters=UrdfParameters(settle_seconds=1.5, rest=False), context=context(tmp_path / "out"))
    messages = [record.getMessage() for record in caplog.records]
    assert [message.split()[0] for message in messages] == ["cup_7"]
    quick = UrdfParameters(settle_seconds=0, rest=False)
    made = run(cad_scene, parameters=quick, context=context(tmp_path / "unsettled"))
    assert "unstable" not in made.summary  # what was not measured is not called 0


def test_movability_can_be_overruled(cad_scene, tmp_path):
    quick = {"settle_seconds": 0, "rest": False}
    parameters = UrdfParameters(movable_classes=("monitor",), fixed_classes=("bottle",), **quick)
    made = run(cad_scene, parameters=parameters, context=context(tmp_path / "out"))
    movable = {body.name for body in made.info.bodies if body.movable}
    assert movable == {"cup_5", "cup_7", "monitor_8"}
    with pytest.raises(UsageError, match="unicorn"):
        run(cad_scene, parameters=UrdfParameters(fixed_classes=("unicorn",)), context=context(tmp_path / "x"))


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda root: shutil.rmtree(root / "models" / "cup_00"), "cup_00"),
        (lambda root: (root / "models" / "cup_00" / "model.json").unlink(), "model.json"),
        (lambda root: (root / "models" / "cup_00" / "model.urdf").write_text("<robot"), "XML"),
        (lambda root: (root / "models" / "cup_00" / "collision" / "body_0.obj").unlink(), "body_0.obj"),
        (lambda root: (root / "meshes" / "monitor_8.ply").write_bytes(b"ply\nformat nonsense"), "monitor_8.ply"),
        (lambda root: (root / "graph.json").write_text("{}"), "graph.json"),
    ],
)
def test_a_damaged_scene_is_bad_input(cad_scene, tmp_path, damage, message):
    damage(Path(cad_scene.root))
    with pytest.raises(BadInput, match=message):
        run(cad_scene, parameters=UrdfParameters(), context=context(tmp_path / "out"))
