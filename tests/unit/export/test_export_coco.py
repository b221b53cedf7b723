"""Masks as COCO: read by pycocotools, and back by `segment --backend masks`."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.exported_sequence import ExportedSequence
from scenewright.schemas.segments import FrameSegment, FrameSegments, Segments, SegmentsFile
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.formats.masks import write_panoptic_zip
from scenewright.stages.segment.backends.masks.formats.coco_panoptic import open_source
from scenewright.stages.segment.backends.masks.given import ReadSettings
from scenewright.stages.segment.backends.masks.listing import Listing

from tests.unit.export.sequences import CAMERA, LABELS, export, write_sequence

CLASSES = {entry.name: entry for entry in load_vocabulary().classes}
SHAPE = (CAMERA.height, CAMERA.width)


def ids_of(frame: int) -> np.ndarray:
    """A table in two pieces (1 and 300), a wall (2), a piece that nothing names (7), a cup (70000), void."""
    ids = np.zeros(SHAPE, dtype=np.int32)
    ids[2:10, 3:9] = 1
    ids[2:10, 20 + frame : 30 + frame] = 300
    ids[20:, :] = 2
    ids[12:14, :5] = 7
    ids[15:18, 30:34] = 70000
    return ids


def segment(number: int, name: str | None, instance: int, score: float, ids: np.ndarray) -> FrameSegment:
    entry = CLASSES[name] if name else None
    return FrameSegment(
        id=number,
        class_id=entry.id if entry else 0,
        instance=instance,
        is_thing=bool(entry and entry.kind == "thing"),
        score=score,
        area=int((ids == number).sum()),
    )


def write_segments(root: Path, frames: tuple[int, ...] = (0, 1, 3), shift: int = 0) -> Segments:
    """Write masks of some frames, all with the same five segments."""
    root.mkdir()
    write_panoptic_zip(root / "panoptic.zip", ((frame + shift, ids_of(frame)) for frame in frames))
    rows = tuple(
        FrameSegments(
            frame=frame + shift,
            segments=(
                segment(1, "table", 4, 0.7, ids),
                segment(300, "table", 4, 0.9, ids),
                segment(2, "wall", 1, 1.0, ids),
                segment(7, None, 0, 1.0, ids),
                segment(70000, "cup", 5, 0.5, ids),
            ),
        )
        for frame in frames
        for ids in [ids_of(frame)]
    )
    SegmentsFile(backend="masks", label="test masks", width=SHAPE[1], height=SHAPE[0], frames=rows).write(
        root / "segments.json"
    )
    return Segments(root)


@pytest.fixture(scope="module")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> Sequence:
    return write_sequence(tmp_path_factory.mktemp("coco") / "sequence", labels=True)


@pytest.fixture(scope="module")
def done(sequence: Sequence, tmp_path_factory: pytest.TempPathFactory) -> ExportedSequence:
    folder = tmp_path_factory.mktemp("coco")
    return export(sequence, folder / "coco", write_segments(folder / "segments"), layout="coco")


def test_panoptic_by_its_published_format(sequence: Sequence, done: ExportedSequence) -> None:
    document = json.loads(done.path("panoptic.json").read_text())
    assert done.info.log == "panoptic.json" and done.info.frame_count == 3
    assert done.info.left_out == {"missing_masks": 2} and "test masks" in done.info.notes[0]
    assert [image["id"] for image in document["images"]] == [0, 1, 3]
    categories = {row["id"]: row for row in document["categories"]}
    assert {entry.id: entry.name for entry in CLASSES.values()} == {n: row["name"] for n, row in categories.items()}
    with FrameReader(sequence.path("frames.mcap")) as reader:
        for image, row in zip(document["images"], document["annotations"], strict=True):
            assert done.path(f"images/{image['file_name']}").read_bytes() == reader.encoded(image["id"])
            pixels = cv2.imread(str(done.path(f"panoptic/{row['file_name']}"))).astype(int)
            found = pixels[..., 2] + 256 * pixels[..., 1] + 65536 * pixels[..., 0]
            expected = ids_of(row["image_id"])
            expected[expected == 300] = 1
            expected[expected == 7] = 0
            np.testing.assert_array_equal(found, expected)
            assert {info["id"] for info in row["segments_info"]} == set(np.unique(expected)) - {0} == {1, 2, 70000}
            for info in row["segments_info"]:
                mask = expected == info["id"]
                lines, columns = np.nonzero(mask)
                x, y, width, height = info["bbox"]
                assert (x, y) == (columns.min(), lines.min())
                assert (x + width - 1, y + height - 1) == (columns.max(), lines.max())
                assert info["area"] == mask.sum() and info["iscrowd"] == 0
            by_class = {categories[info["category_id"]]["name"]: info for info in row["segments_info"]}
            assert by_class["table"]["score"] == 0.9 and "score" not in by_class["wall"]
            assert (categories[CLASSES["wall"].id]["isthing"], categories[CLASSES["table"].id]["isthing"]) == (0, 1)


def test_instances_are_read_and_scored_by_pycocotools(done: ExportedSequence) -> None:
    coco = pytest.importorskip("pycocotools.coco")
    evaluation = pytest.importorskip("pycocotools.cocoeval")
    truth = coco.COCO(str(done.path("instances.json")))
    assert sorted(truth.getImgIds()) == [0, 1, 3] and len(truth.anns) == 6
    for annotation in truth.anns.values():
        name = truth.cats[annotation["category_id"]]["name"]
        ids = ids_of(annotation["image_id"])
        expected = np.isin(ids, (1, 300)) if name == "table" else ids == 70000
        np.testing.assert_array_equal(truth.annToMask(annotation), expected)
    wanted = ("image_id", "category_id", "segmentation", "bbox", "area")
    results = [{**{k: row[k] for k in wanted}, "score": row.get("score", 1.0)} for row in truth.dataset["annotations"]]
    scored = evaluation.COCOeval(truth, truth.loadRes(results[:-1]), "segm")
    scored.evaluate()
    scored.accumulate()
    scored.summarize()
    assert 0.5 < scored.stats[0] < 1, "one of the three cups is missing"


def test_what_was_written_is_read_back_as_masks(done: ExportedSequence) -> None:
    source = open_source(Listing(done.root))
    assert source is not None and len(source.pictures) == 3
    for place, frame in enumerate((0, 1, 3)):
        given = source.read(place, SHAPE, ReadSettings(score_threshold=0.0, minimum_pixels=1))
        assert set(np.unique(given.ids)) - {0} == set(given.masks) == {1, 2, 70000}
        assert {source.categories[mask.category].name for mask in given.masks.values()} == {"table", "wall", "cup"}
        np.testing.assert_array_equal(given.ids == 70000, ids_of(frame) == 70000)


def test_true_labels_of_a_log(sequence: Sequence, tmp_path: Path) -> None:
    done = export(sequence, tmp_path / "coco", layout="coco", every=2, streams=("color",))
    document = json.loads(done.path("panoptic.json").read_text())
    assert [row["image_id"] for row in document["annotations"]] == [0, 2, 4]
    table = CLASSES[LABELS[0].class_name]
    for row in document["annotations"]:
        (info,) = row["segments_info"]
        assert (info["id"], info["category_id"], info["area"]) == (3, table.id, SHAPE[0] * SHAPE[1])


def test_what_cannot_be_exported_says_why(sequence: Sequence, tmp_path: Path) -> None:
    plain = write_sequence(tmp_path / "plain")
    with pytest.raises(BadInput, match="no masks of its own.*--segments"):
        export(plain, tmp_path / "a", layout="coco")
    with pytest.raises(BadInput, match="masks of frame 8, the sequence has 5 frames"):
        export(plain, tmp_path / "b", write_segments(tmp_path / "later", shift=5), layout="coco")
    with pytest.raises(UsageError, match="tum holds no masks"):
        export(plain, tmp_path / "c", write_segments(tmp_path / "segments"), layout="tum")
    unlisted = write_segments(tmp_path / "unlisted")
    write_panoptic_zip(unlisted.path("panoptic.zip"), [(k, np.full(SHAPE, 9)) for k in (0, 1, 3)])
    with pytest.raises(BadInput, match="frame 0: id 9 is not in segments.json"):
        export(plain, tmp_path / "d", unlisted, layout="coco")
    other = write_segments(tmp_path / "other")
    write_panoptic_zip(other.path("panoptic.zip"), [(k, np.ones((4, 4), int)) for k in (0, 1, 3)])
    with pytest.raises(BadInput, match="4 x 4, its images"):
        export(plain, tmp_path / "e", other, layout="coco")


def test_masks_that_name_nothing_give_pictures_without_masks(sequence: Sequence, tmp_path: Path) -> None:
    """The geometric backend names nothing."""
    nameless = write_segments(tmp_path / "segments", frames=(0,))
    info = nameless.info
    (row,) = info.frames
    bare = tuple(s.model_copy(update={"class_id": 0, "instance": 0, "is_thing": False}) for s in row.segments)
    info.model_copy(update={"frames": (row.model_copy(update={"segments": bare}),)}).write(
        nameless.path("segments.json")
    )
    done = export(sequence, tmp_path / "coco", Segments(nameless.root), layout="coco")
    assert json.loads(done.path("panoptic.json").read_text())["annotations"][0]["segments_info"] == []
    assert any("no mask has a class" in note for note in done.info.notes)
