"""Edits of CAD scenes: models, places and joints as a person says, which the steps after heed; or a conflict."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from scenewright.cli.main import run as scenewright
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.stages.edit.edits_file import read_edits
from scenewright.stages.edit.scene_edits import joint_anchors
from scenewright.stages.edit.scene_state import SceneState
from scenewright.stages.kit.formats.cad_models import read_model
from scenewright.stages.kit.formats.mesh_files import read_mesh

from tests.unit.edit.scenes import scene_room


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return scene_room(tmp_path_factory.mktemp("room"))


def edited(
    room: dict[str, Path], folder: Path, *commands: list[str], code: int = 0, more: tuple[str, ...] = ()
) -> CadScene:
    """The scene with edits made by commands, each made on the scene as it was."""
    edits, out = folder / "edits.toml", folder / "edited"
    for command in commands:
        said = ["edit", command[0], str(edits), *command[1:], "--cad-scene", str(room["cad"]), "--by", "anna"]
        assert scenewright(said) == 0, said
    apply = ["edit", "scene", "--cad-scene", str(room["cad"]), "--edits", str(edits), "--out", str(out), *more]
    assert scenewright(apply) == code
    return CadScene(out)


def statuses(scene: CadScene) -> list[str]:
    assert scene.edits is not None
    return [record.status for record in scene.edits.edits]


@pytest.mark.slow
def test_another_model_stands_for_a_thing_or_none_does(room: dict[str, Path], tmp_path: Path) -> None:
    before = CadScene(room["cad"]).graph
    assert before.node("table_2").model_id == "table_long"
    more = ("--library", str(room["library"]), "--panoptic-map", str(room["map"]))
    scene = edited(room, tmp_path, ["model", "table_2", "table_square"], ["model", "fridge_3", "none"], more=more)
    assert statuses(scene) == ["applied", "applied"]
    table = scene.graph.node("table_2")
    assert table.model_id == "table_square" and (scene.path("models") / "table_square" / "model.urdf").is_file()
    assert not (scene.path("models") / "table_long").exists() and not (scene.path("models") / "fridge_tall").exists()
    assert table.box is not None and np.allclose(table.box.center[:2], (-0.5, 0.6), atol=0.05)
    assert table.box.center[2] - table.box.size[2] / 2 == pytest.approx(0.0, abs=0.02)
    # What stands on it stands on the surface of the new one.
    link = scene.graph.parent_link("box_4")
    assert link is not None and link.source == "table_2" and link.plane is not None
    assert table.planes[link.plane].horizontal
    fridge = next(entry for entry in scene.info.replacements if entry.node == "fridge_3")
    assert fridge.decision == "mesh" and (scene.path("meshes") / "fridge_3.ply").is_file()
    assert scene.graph.node("fridge_3").model_id is None
    # The step after runs on it as on any other.
    out = tmp_path / "urdf"
    assert scenewright(["urdf", "--cad-scene", str(scene.root), "--out", str(out), "--settle-seconds", "0"]) == 0
    names = {body.name for body in InteractiveScene(out).info.bodies}
    assert {"table_2", "fridge_3", "box_4", "cabinet_5"} <= names


def test_without_library_or_map_a_model_is_a_conflict(room: dict[str, Path], tmp_path: Path) -> None:
    scene = edited(room, tmp_path, ["model", "table_2", "table_square"], ["model", "fridge_3", "none"], code=4)
    assert statuses(scene) == ["conflict", "conflict"]
    reasons = [record.reason for record in (scene.edits.edits if scene.edits else ())]
    assert "table_square" in reasons[0] and "panoptic map" in reasons[1]
    assert scene.graph == CadScene(room["cad"]).graph


def test_a_thing_is_moved_with_what_it_carries(room: dict[str, Path], tmp_path: Path) -> None:
    before = CadScene(room["cad"]).graph
    scene = edited(
        room,
        tmp_path,
        ["move", "table_2", "--shift", "0.3", "-0.2", "0", "--turn", "90", "--carried"],
        ["move", "cabinet_5", "--shift", "0.1", "0", "0", "--turn", "30"],
    )
    assert statuses(scene) == ["applied", "applied"]
    after = scene.graph
    for name in ("table_2", "cabinet_5"):
        here, there = before.node(name).box, after.node(name).box
        assert here is not None and there is not None
        shift = (0.3, -0.2, 0.0) if name == "table_2" else (0.1, 0.0, 0.0)
        assert np.allclose(np.subtract(there.center, here.center), shift, atol=2e-3)
    here, there = (np.array(graph.node("table_2").world_from_model) for graph in (before, after))
    turn = math.atan2(there[1, 0], there[0, 0]) - math.atan2(here[1, 0], here[0, 0])
    assert math.cos(turn) == pytest.approx(0.0, abs=1e-3)
    # The box lay 0.2 m to one side of the table's middle; it does so still, seen from the table.
    offset = [
        np.linalg.inv(np.array(graph.node("table_2").world_from_model)) @ np.array(graph.node("box_4").world_from_model)
        for graph in (before, after)
    ]
    assert np.allclose(offset[0], offset[1], atol=2e-3)
    mesh, was = read_mesh(scene.path("meshes") / "cabinet_5.ply"), read_mesh(room["cad"] / "meshes" / "cabinet_5.ply")
    assert len(mesh.faces) == len(was.faces) and not np.allclose(mesh.bounds, was.bounds, atol=0.02)
    link = after.parent_link("box_4")
    assert link is not None and link.plane is not None and abs(link.gap or 0.0) < 0.01


@pytest.mark.slow
def test_a_built_in_is_moved_as_models_are(tmp_path: Path) -> None:
    room = scene_room(tmp_path / "room", built_ins=True)
    before = CadScene(room["cad"]).graph.node("cabinet_5")
    assert before.model_id == "cabinet_5_built_in"
    scene = edited(room, tmp_path, ["move", "cabinet_5", "--shift", "0.1", "0", "0"])
    assert statuses(scene) == ["applied"]
    after = scene.graph.node("cabinet_5")
    shift = np.subtract(np.array(after.world_from_model)[:3, 3], np.array(before.world_from_model)[:3, 3])
    assert np.allclose(shift, (0.1, 0.0, 0.0), atol=2e-3)
    out = tmp_path / "urdf"
    assert scenewright(["urdf", "--cad-scene", str(scene.root), "--out", str(out), "--settle-seconds", "0"]) == 0
    assert "cabinet_5" in {body.name for body in InteractiveScene(out).info.bodies}


def test_a_heading_of_another_model_is_a_conflict(room: dict[str, Path], tmp_path: Path) -> None:
    scene = edited(
        room,
        tmp_path,
        ["model", "table_2", "table_square"],
        ["move", "table_2", "--turn", "30"],
        code=4,
        more=("--library", str(room["library"])),
    )
    assert statuses(scene) == ["applied", "conflict"] and scene.edits is not None
    assert "heading was of table_long" in scene.edits.edits[1].reason or "boxes" in scene.edits.edits[1].reason


def test_joints_are_believed_held_and_limited(room: dict[str, Path], tmp_path: Path) -> None:
    before = CadScene(room["cad"])
    state = SceneState(before.graph, {k.node: k for k in before.info.replacements}, before)
    (name,) = joint_anchors(state, before.graph.node("fridge_3"))
    upper = "1.2"
    scene = edited(room, tmp_path, ["joint", "fridge_3", name, "--upper", upper, "--value", "0.4"])
    assert statuses(scene) == ["applied"]
    node = scene.graph.node("fridge_3")
    assert node.joints[name] == 0.4 and node.model_id == "fridge_3_edited_1"
    model = read_model(scene.path("models") / "fridge_3_edited_1")
    assert model.joints[0].upper == 1.2
    entry = next(entry for entry in scene.info.replacements if entry.node == "fridge_3")
    assert entry.joint_evidence is not None and "user" in entry.joint_evidence[name].grounds and not entry.held
    assert (
        scenewright(["urdf", "--cad-scene", str(scene.root), "--out", str(tmp_path / "u"), "--settle-seconds", "0"])
        == 0
    )
    body = next(body for body in InteractiveScene(tmp_path / "u").info.bodies if body.name == "fridge_3")
    assert [joint.upper for joint in body.joints] == [1.2]
    other = tmp_path / "held"
    other.mkdir()
    held = edited(room, other, ["no-joint", "fridge_3", name])
    entry = next(entry for entry in held.info.replacements if entry.node == "fridge_3")
    assert entry.held == {name}


def test_a_door_is_cut_out_of_a_mesh_and_hung_on_a_joint(room: dict[str, Path], tmp_path: Path) -> None:
    front = ["--center", "-0.8", "-0.8", "0.45", "--size", "0.9", "0.06", "1.0"]
    hinge = ["--axis", "0", "0", "1", "--origin", "-1.2", "-0.8", "0", "--upper", "1.5", "--type", "revolute"]
    scene = edited(room, tmp_path, ["new-joint", "cabinet_5", *front, *hinge, "--handle", "-0.45", "-0.78", "0.5"])
    assert statuses(scene) == ["applied"]
    node = scene.graph.node("cabinet_5")
    assert node.model_id == "cabinet_5_edited_1" and not (scene.path("meshes") / "cabinet_5.ply").exists()
    model = read_model(scene.path("models") / "cabinet_5_edited_1")
    assert model.parts == ("body", "hand_1") and model.joints[0].upper == 1.5
    assert node.box is not None and np.allclose(node.box.center, (-0.8, -1.0, 0.45), atol=0.03)
    assert (
        scenewright(["urdf", "--cad-scene", str(scene.root), "--out", str(tmp_path / "u"), "--settle-seconds", "0"])
        == 0
    )
    body = next(body for body in InteractiveScene(tmp_path / "u").info.bodies if body.name == "cabinet_5")
    (joint,) = body.joints
    pose = np.array(body.world_from_body)
    origin = pose[:3, :3] @ np.array(joint.origin) + pose[:3, 3]
    assert np.allclose(origin, (-1.2, -0.8, 0.0), atol=0.01) and joint.handle is not None
    # A box that holds all of the thing, or nothing of it, cuts nothing.
    far = tmp_path / "far"
    far.mkdir()
    all_of_it = ["--center", "-0.8", "-1.0", "0.45", "--size", "2", "2", "2"]
    scene = edited(room, far, ["new-joint", "cabinet_5", *all_of_it, *hinge], code=4)
    assert statuses(scene) == ["conflict"]


def test_lines_say_what_commands_said_and_bad_ones_are_refused(room: dict[str, Path], tmp_path: Path, capsys) -> None:
    edits = tmp_path / "edits.toml"
    scene = ["--cad-scene", str(room["cad"])]
    assert scenewright(["edit", "mark", str(edits), "table_2", "fixed", *scene, "--note", '"<' + "x" * 9000]) == 0
    before = edits.read_bytes()
    for words, said in (
        (["move", "table_2", "--to", "1", "1", "1", "--shift", "1", "1", "1"], "both say where"),
        (["move", "table_2", "--to", "nan", "1", "1"], "edit move"),
        (["model", "table_2", "../../etc"], "edit model"),
        (["joint", "fridge_3", "no such"], "has no joint"),
        (["joint", "cabinet_5", "door"], "no model stands"),
        (["no-joint", "nothing_9", "door"], "has no thing"),
    ):
        capsys.readouterr()
        assert scenewright(["edit", words[0], str(edits), *words[1:], *scene]) == 2
        error = capsys.readouterr().err
        assert said in error and len(error) < 600, error
        assert edits.read_bytes() == before
    assert read_edits(edits).edits[0].what == "mark"
    out = tmp_path / "out"
    apply = ["edit", "scene", *scene, "--edits", str(edits), "--out", str(out)]
    assert scenewright(apply) == 0 and CadScene(out).graph.node("table_2").mark == "fixed"
    assert json.loads((out / "manifest.json").read_text())["summary"]["applied"] == 1
    # A folder half written is no scene.
    torn = tmp_path / "torn"
    torn.mkdir()
    (torn / "scene.json").write_text("{")
    assert scenewright(["edit", "model", str(edits), "table_2", "none", "--cad-scene", str(torn)]) == 3
    assert edits.read_bytes() == before
