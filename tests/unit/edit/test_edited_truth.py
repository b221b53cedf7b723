"""What a person put right as truth: an annotation that `evaluate` measures against, and masks to train with."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scenewright.cli.main import run as scenewright
from scenewright.schemas.evaluation import Evaluation
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.segments import Segments
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.formats.frames import FrameReader, FrameWriter
from scenewright.stages.kit.formats.masks import PanopticReader
from scenewright.stages.kit.geometry.transforms import look_at
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer

from tests.unit.edit.maps import ROOM, dense, room_map
from tests.unit.ingest.tiny_room import CAMERA

EYES = ((0.0, -1.2, 1.5), (0.9, -0.9, 1.6), (-0.9, -0.8, 1.4), (0.4, 0.3, 2.0), (-1.6, -0.2, 1.6))


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Frames of the room, a map in which a cup is called a bottle and the cabinet a table, and that map put right."""
    root = tmp_path_factory.mktemp("room")
    renderer = SceneRenderer([(k, dense(mesh, 0.1)) for k, (_, mesh) in ROOM.items()])
    with FrameWriter(root / "log.mcap", CAMERA, labels=True, world_up="z") as writer:
        for k, eye in enumerate(EYES):
            pose = look_at(np.array(eye), np.array((0.0, 0.1, 0.6)))
            picture = renderer.render(CAMERA, pose)
            depth = picture.depth.copy()
            depth[40:44] = 0.0  # a stripe that the camera did not measure
            writer.write(0.1 * k, picture.color, depth, pose, picture.instance.astype(np.uint16))
    assert scenewright(["ingest", "--log", str(root / "log.mcap"), "--out", str(root / "sequence")]) == 0
    seen = room_map(root / "map", classes={3: "bottle", 5: "table"})
    edits = root / "edits.toml"
    for name, right in (("bottle_3", "cup"), ("table_5", "cabinet")):
        words = ["edit", "rename", str(edits), name, "--class", right, "--panoptic-map", str(seen.root)]
        assert scenewright(words) == 0
    command = ["edit", "map", "--panoptic-map", str(seen.root), "--edits", str(edits), "--out", str(root / "edited")]
    assert scenewright(command) == 0
    return root


def test_masks_of_a_map_are_those_of_its_things(room: Path) -> None:
    out = room / "masks"
    words = ["edit", "masks", "--sequence", str(room / "sequence"), "--panoptic-map", str(room / "edited")]
    assert scenewright([*words, "--out", str(out)]) == 0
    info = Segments(out).info
    assert [frame.frame for frame in info.frames] == list(range(len(EYES))) and "map" in info.label
    classes = {entry.name: entry.id for entry in load_vocabulary().classes}
    wrong = total = 0
    with FrameReader(room / "sequence" / "frames.mcap") as reader, PanopticReader(out / "panoptic.zip") as masks:
        for frame, record in zip(reader.frames(), info.frames, strict=True):
            assert frame.labels is not None
            drawn = masks.read(frame.index)
            wrong += int((drawn != frame.labels).sum())
            total += drawn.size
            assert {segment.id: segment.class_id for segment in record.segments} == {
                k: classes[{3: "cup", 5: "cabinet"}.get(k, ROOM[k][0])] for k in np.unique(drawn).tolist() if k
            }
            assert sum(segment.area for segment in record.segments) == int((drawn > 0).sum())
            assert (drawn[40:44] > 0).any()  # by rays, where nothing was measured
    assert wrong < 0.01 * total
    coco = room / "coco"
    words = ["export", "--sequence", str(room / "sequence"), "--segments", str(out), "--layout", "coco"]
    assert scenewright([*words, "--out", str(coco)]) == 0
    written = json.loads((coco / "panoptic.json").read_text())
    found = {row["category_id"] for one in written["annotations"] for row in one["segments_info"]}
    assert classes["cup"] in found and classes["bottle"] not in found


def test_diff_says_who_changed_what(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert scenewright(["diff", str(room / "map"), str(room / "edited")]) == 0
    told = capsys.readouterr().out
    assert "edit 1 (rename): none -> applied, cup_3" in told and "edit 2 (rename): none -> applied, cabinet_5" in told


def test_what_was_put_right_is_truth_for_evaluate(room: Path) -> None:
    for name in ("map", "edited"):
        words = ["graph", "--panoptic-map", str(room / name), "--out", str(room / f"graph_{name}")]
        assert scenewright(words) == 0
    truth = room / "truth"
    words = ["truth", "edited", "--sequence", str(room / "sequence"), "--panoptic-map", str(room / "edited")]
    assert scenewright([*words, "--contact-graph", str(room / "graph_edited"), "--out", str(truth)]) == 0
    made = GroundTruth(truth)
    assert {entry.name for entry in made.info.objects} == {"floor_1", "table_2", "cup_3", "cup_4", "cabinet_5"}
    link = made.graph.parent_link("cup_3")
    assert link is not None and (link.source, link.confidence) == ("table_2", 1.0)
    figures = {}
    for name in ("map", "edited"):
        words = ["evaluate", "--ground-truth", str(truth), "--sequence", str(room / "sequence"), "--no-plots"]
        words += ["--panoptic-map", str(room / name), "--contact-graph", str(room / f"graph_{name}")]
        assert scenewright([*words, "--out", str(room / f"evaluation_{name}")]) == 0
        figures[name] = (
            Evaluation(room / f"evaluation_{name}").summary
            or json.loads((room / f"evaluation_{name}" / "manifest.json").read_text())["summary"]
        )
    assert figures["edited"]["map/pq"] > 0.95 and figures["map"]["map/pq"] < 0.7  # two of five have another class
    assert figures["edited"]["graph/support_f1"] == 1.0
    # A graph of another map is refused.
    words = ["truth", "edited", "--sequence", str(room / "sequence"), "--panoptic-map", str(room / "map")]
    out = room / "none"
    assert scenewright([*words, "--contact-graph", str(room / "graph_edited"), "--out", str(out)]) == 3
    assert not out.exists()
