"""Views: every kind becomes a recording that Rerun reads, with the entities that belong in it, at the right places."""

from __future__ import annotations

import builtins
import math
import re
from pathlib import Path

import numpy as np
import pytest
from scenewright.cli.main import run as scenewright
from scenewright.cli.viewing.library_view import row_places
from scenewright.cli.viewing.rerun_canvas import import_rerun
from scenewright.cli.viewing.segments_view import segment_images
from scenewright.cli.viewing.sequence_view import draw_sequence
from scenewright.cli.viewing.view import view_artifact, viewer_of
from scenewright.schemas.artifact import Artifact
from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.errors import BadInput, MissingDependency, UsageError
from scenewright.schemas.interactive_scene import InteractiveSceneFile
from scenewright.schemas.kinds import KINDS
from scenewright.schemas.scene_parts import Relation
from scenewright.schemas.sequence import Sequence
from scenewright.stages.kit.formats.link_poses import joint_motion, link_poses
from scenewright.stages.kit.formats.urdf_file import Urdf, UrdfJoint, parse_urdf
from scenewright.stages.kit.measurement.relation_evidence import evidence
from scenewright.stages.kit.viewing.graphs import relation_table
from scenewright.stages.kit.viewing.page.library import three_js
from scenewright.stages.kit.viewing.page.page_canvas import LARGEST_PAGE

from tests.unit.viewing import artifacts
from tests.unit.viewing.suture_artifacts import make_suture
from tests.unit.viewing.tableware_artifacts import make_tableware
from tests.unit.viewing.test_page import document_of


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    artifacts.make_sequence(folder)
    artifacts.make_segments(folder)
    artifacts.make_disparity(folder)
    artifacts.make_map(folder)
    library = CadLibrary(root=artifacts.make_library(folder))
    artifacts.make_contact_graph(folder, library)
    artifacts.make_cad_scene(folder, library)
    artifacts.make_interactive_scene(folder, library)
    artifacts.make_plan(folder)
    artifacts.make_packing(folder)
    make_tableware(folder)
    make_suture(folder)
    artifacts.make_ground_truth(folder, library)
    artifacts.make_evaluation(folder)
    artifacts.make_report(folder)
    artifacts.make_trajectory(folder)
    artifacts.make_export(folder)
    return folder


EXPECTED = {
    "sequence": {"/world/camera", "/world/camera/color", "/world/camera/depth", "/world/cloud", "/world/camera_path"},
    "disparity": {"/world/camera/color", "/world/camera/disparity", "/world/camera/confidence", "/rows"},
    "trajectory": {"/world/camera_path"},
    "segments": {"/world/class/labels", "/world/class/color", "/world/instance/labels", "/world/segment/labels"},
    "panoptic_map": {"/world/color", "/world/instance", "/world/boxes"},
    "contact_graph": {
        "/world/boxes",
        "/world/edges/supports",
        "/world/edges/contains",
        "/graph",
        "/relations",
        "/world/meshes/table_3",
    },
    "cad_scene": {
        "/world/cad/table_3",
        "/world/candidates/table_3/1_table_00",
        "/world/meshes/cup_5",
        "/world/layout/floor_1",
        "/replacements",
        "/candidates",
        "/relations",
        "/graph",
    },
    "interactive_scene": {"/world/scene/table_3", "/world/scene/fridge_4", "/world/scene/fridge_4__door", "/graph"},
    "plan": {"/plan", "/world/scene/cup_5", "/world/robot/panda_hand", "/world/execution"},
    "packing": {
        "/plans",
        "/world/start",
        "/world/packed",
        "/world/obstacles",
        "/world/robot/panda_hand",
        "/world/layout",
    },
    "suture_scene": {"/world/camera/color", "/world/camera/right", "/world/truth/needle", "/world/truth/thread"},
    "suture_needle": {"/needle", "/world/needle", "/world/filtered", "/world/left_eye", "/world/eyes/needle"},
    "suture_thread": {"/thread", "/world/thread", "/world/eyes/thread"},
    "suture_trial": {
        "/trial",
        "/world/wound",
        "/world/needle",
        "/world/needle_tip",
        "/world/thread",
        "/world/driver_left",
    },
    "suture_evaluation": {"/figures", "/world/plots/sutures"},
    "tableware_detections": {"/seen", "/world/items/1_cup", "/world/items/2_unknown", "/world/overlay"},
    "tableware_scene": {"/world/items/cup_1", "/world/table", "/world/camera/color"},
    "tableware_plan": {"/plan", "/world/strip", "/world/stackings/1", "/world/table"},
    "tableware_trial": {"/trial", "/world/items/cup_2", "/world/keyframes"},
    "tableware_evaluation": {"/policies"},
    "ground_truth": {"/world/room/fridge_4", "/world/boxes", "/world/visible", "/world/camera/labels"},
    "cad_library": {
        "/world/library/table/table_00/body",
        "/world/library/fridge/fridge_01/door",
        "/world/library/table/table_00/body/carries",
        "/world/library/fridge/fridge_01/door/grasps",
        "/world/library/fridge/fridge_01/body/rooms",
        "/affordances",
    },
    "evaluation": {"/figures", "/tables/map", "/world/plots/map"},
    "report": {"/report"},
    "exported_sequence": {"/export"},
}


@pytest.fixture(scope="module")
def recordings(run: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, list]]:
    """Kind -> entity path -> chunks, as Rerun reads the file back."""
    pytest.importorskip("rerun", reason="the viewer is an extra: pip install rerun-sdk")
    from rerun.chunk import RrdReader

    read = {}
    for kind in EXPECTED:
        path = tmp_path_factory.mktemp("rrd") / f"{kind}.rrd"
        view_artifact(run / kind, path)
        entities: dict[str, list] = {}
        for chunk in RrdReader(str(path)).stream():
            entities.setdefault(chunk.entity_path, []).append(chunk)
        read[kind] = entities
    return read


def _column(chunks: list, name: str) -> list:
    values = []
    for chunk in chunks:
        batch = chunk.to_record_batch()
        for column in batch.schema.names:
            if name in column:
                values.extend(row for row in batch.column(column).to_pylist() if row is not None)
    return values


@pytest.mark.parametrize("kind", EXPECTED)
def test_every_kind_is_drawn(recordings: dict, kind: str) -> None:
    assert EXPECTED[kind] <= set(recordings[kind])


def test_every_kind_that_steps_write_has_a_view() -> None:
    for name, kind in KINDS.items():
        assert viewer_of(kind) is not None, name


def test_a_kind_is_drawn_as_what_it_can_be_read_as() -> None:
    class OtherSequence(Sequence):
        kind = "test_other_sequence"

    class Unseen(Artifact):
        kind = "test_unseen"

    try:
        assert viewer_of(OtherSequence) is draw_sequence and viewer_of(Unseen) is None
    finally:
        del KINDS["test_other_sequence"], KINDS["test_unseen"]


def test_relations_show_their_confidence_and_evidence(recordings: dict) -> None:
    link = Relation(
        source="shelf_2",
        target="cup_5",
        relation="contains",
        confidence=0.875,
        plane=3,
        gap=-0.004,
        overlap=0.9,
        contact=(0.1, 0.25, 1.0),
        inside=0.66,
    )
    assert evidence(link) == (
        "confidence 0.88, plane 3 of shelf_2, gap -4 mm, overlap 90 %, inside 66 %, meet at 0.10, 0.25, 1.00"
    )
    bare = Relation(source="floor_1", target="shelf_2", relation="supports", confidence=0.5)
    table = relation_table(ContactGraphFile(nodes=(), links=(link, bare))).splitlines()
    assert table[2] == "| supports | floor_1 | shelf_2 | 0.50 |  |  |  |  |  |"  # the least certain first
    assert table[3] == "| contains | shelf_2 | cup_5 | 0.88 | 3 | -4 | 90 | 66 | 0.10 0.25 1.00 |"
    edges = recordings["contact_graph"]["/world/edges/contains"]
    assert any("contains" in text and "confidence" in text for row in _column(edges, "labels") for text in row)


def test_candidates_of_each_object_are_listed(recordings: dict) -> None:
    (text,) = _column(recordings["cad_scene"]["/candidates"], "text")[0]
    rows = [line for line in text.splitlines() if line.startswith("| table")]
    assert [row.split(" | ")[:3] for row in rows] == [
        ["| table_00", "chosen, best by itself", "0.100"],
        ["| table_00", "", "0.300"],
        ["| table_99", "", "0.100"],
    ]
    assert "Rejected: 4 scale out of range." in text and "nothing fits" in text and "floor_1" not in text


def test_camera_moves_with_the_frames(recordings: dict) -> None:
    cameras = [chunk for chunk in recordings["sequence"]["/world/camera"] if not chunk.is_static]
    assert len(_column(cameras, "Transform3D:translation")) == 5
    assert len(_column(recordings["sequence"]["/world/camera/depth"], "blob")) == 5
    assert all("time" in chunk.timeline_names for chunk in cameras)


def test_lifted_cup_is_animated(recordings: dict) -> None:
    chunks = recordings["plan"]["/world/scene/cup_5"]
    # What is static wins over what moves: a static pose would nail the cup down.
    assert not _column([chunk for chunk in chunks if chunk.is_static], "Transform3D:translation")
    heights = [row[0][2] for row in _column(chunks, "Transform3D:translation")]
    assert {0.0, 0.5, 1.0} <= set(heights) and len(heights) == 4  # where it stood, and three moments
    doors = recordings["cad_library"]["/world/library/fridge/fridge_00/door"]
    assert not _column([chunk for chunk in doors if chunk.is_static], "Transform3D:")
    assert len(_column(doors, "Transform3D:translation")) == 13


def test_boxes_start_on_the_table_and_end_in_the_basket(recordings: dict) -> None:
    """The red box of the artifact is 7 cm high; the table's surface is at 5 mm, the basket's at 7 mm."""
    (start,), (packed,) = (
        _column(recordings["packing"][f"/world/{name}"], "centers")[0] for name in ("start", "packed")
    )
    assert start == pytest.approx((0.39, -0.4, 0.005 + 0.035)) and packed == pytest.approx((0.7, 0.0, 0.007 + 0.035))
    (basket,) = _column(recordings["packing"]["/world/basket"], "centers")[0]
    assert basket == pytest.approx((0.65, 0.0, 0.002))


def test_what_was_binned_leaves_the_table(recordings: dict) -> None:
    chunks = recordings["tableware_trial"]["/world/items/cup_1"]
    places = [row[0] if isinstance(row[0], list) else row for row in _column(chunks, "Transform3D:translation")]
    assert places[0] == pytest.approx([0.1, 0.0, 0.0]) and places[-1][0] > 0.39


def test_map_is_coloured_by_instance_and_by_itself(recordings: dict) -> None:
    assert set(_column(recordings["panoptic_map"]["/world/color"], "vertex_colors")[0]) == {0x0A141EFF}
    assert len(set(_column(recordings["panoptic_map"]["/world/instance"], "vertex_colors")[0])) == 1


def test_link_poses_are_those_of_the_scene(run: Path) -> None:
    root = run / "interactive_scene"
    description = InteractiveSceneFile.read(root / "scene.json")
    values = {name: value for body in description.bodies for name, value in body.joint_values.items()}
    poses = link_poses(parse_urdf(root / "scene.urdf"), values)
    for body in description.bodies:
        np.testing.assert_allclose(poses[body.name], np.array(body.world_from_body), atol=1e-6)
    closed = link_poses(parse_urdf(root / "scene.urdf"), {})
    turned = np.linalg.inv(closed["fridge_4__door"]) @ poses["fridge_4__door"]
    assert math.acos((np.trace(turned[:3, :3]) - 1) / 2) == pytest.approx(1.2, abs=1e-6)


def test_joint_motions() -> None:
    joint = UrdfJoint("j", "prismatic", "a", "b", np.eye(4), axis=(0.0, 1.0, 0.0))
    np.testing.assert_array_equal(joint_motion(joint, 0.3)[:3, 3], [0, 0.3, 0])
    assert (joint_motion(UrdfJoint("j", "floating", "a", "b", np.eye(4)), 5.0) == np.eye(4)).all()


def test_links_that_are_no_tree_are_bad_input() -> None:
    from scenewright.stages.kit.formats.urdf_file import Link

    links = (Link("a"), Link("b"))
    loop = (UrdfJoint("1", "fixed", "a", "b", np.eye(4)), UrdfJoint("2", "fixed", "b", "a", np.eye(4)))
    with pytest.raises(BadInput, match="hangs on nothing"):
        link_poses(Urdf("u", links, loop), {})


def test_segment_images_look_up_class_and_instance() -> None:
    from scenewright.schemas.segments import FrameSegment, FrameSegments

    records = (
        FrameSegment(id=70000, class_id=5, instance=2, is_thing=True, score=1, area=1),
        FrameSegment(id=3, class_id=6, instance=8, is_thing=True, score=1, area=1),
    )
    images = segment_images(FrameSegments(frame=0, segments=records), np.array([[70000, 3], [0, 99]]))
    assert images["class"].tolist() == [[5, 6], [0, 0]]
    assert images["instance"].tolist() == [[2, 8], [0, 0]]


def test_models_stand_side_by_side(run: Path) -> None:
    models = CadLibrary(root=run / "cad_library").info.models
    places = row_places(models)
    footprints = [
        (
            places[m.id][:2] + np.array(m.states[0].box_minimum)[:2],
            places[m.id][:2] + np.array(m.states[0].box_maximum)[:2],
        )
        for m in models
    ]
    for i, (low, high) in enumerate(footprints):
        for other_low, other_high in footprints[:i]:
            assert (high <= other_low).any() or (other_high <= low).any()


def test_missing_viewer_names_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    real_import = builtins.__import__

    def without_rerun(name: str, *arguments, **options):
        if name == "rerun":
            raise ImportError(name)
        return real_import(name, *arguments, **options)

    monkeypatch.setattr(builtins, "__import__", without_rerun)
    with pytest.raises(MissingDependency, match="pip install"):
        import_rerun()


def test_wrong_requests_are_refused(run: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"\.rrd"):
        view_artifact(run / "sequence", tmp_path / "picture.png")
    pytest.importorskip("rerun", reason="the viewer is an extra: pip install rerun-sdk")
    with pytest.raises(BadInput, match="not an artifact"):
        view_artifact(tmp_path, tmp_path / "a.rrd")
    with pytest.raises(BadInput, match="cannot be written"):
        (tmp_path / "file").write_text("")
        view_artifact(run / "report", tmp_path / "file" / "a.rrd")


def test_artifacts_become_pages_of_the_same_drawing(run: Path, tmp_path: Path) -> None:
    for kind, paths in {
        "panoptic_map": {"color", "instance", "class", "trust"},
        "contact_graph": {"meshes/table_3"},
        "cad_scene": {"cad/table_3", "candidates/table_3/1_table_00", "layout/floor_1"},
        "interactive_scene": {"scene/table_3"},
        "plan": set(),
        "sequence": set(),
    }.items():
        page = tmp_path / f"{kind}.html"
        assert scenewright(["view", str(run / kind), "--save", str(page)]) == 0
        drawn = document_of(page)
        assert paths <= {item["path"] for item in drawn["meshes"]}, kind
        assert page.stat().st_size < LARGEST_PAGE
        assert not re.search(r"(src|href)=[\"']?http", page.read_text().replace(three_js(), ""))
    assert document_of(tmp_path / "plan.html")["transforms"] and document_of(tmp_path / "sequence.html")["pictures"]
    assert any(link["kind"] == "turning" for link in document_of(tmp_path / "interactive_scene.html")["joints"])
    assert document_of(tmp_path / "contact_graph.html")["graph"]["edges"]
    assert scenewright(["view", str(run / "plan"), "--save", str(tmp_path / "plan.txt")]) == 2
