"""The step as a whole, on small sequences written by ourselves."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.base import as_transform
from scenewright.schemas.errors import BadInput, MissingDependency, UsageError
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.segments import FrameSegment, FrameSegments, Segments
from scenewright.schemas.sequence import Gravity, LabelEntry, Sequence, SequenceCamera, SequenceFile
from scenewright.schemas.vocabulary import UNNAMED, load_vocabulary
from scenewright.stages.ingest.color_registration import color_in_depth_camera
from scenewright.stages.ingest.layouts.seven_scenes.reader import COLOR_CAMERA, COLOR_FROM_DEPTH
from scenewright.stages.kit.formats.frames import FrameReader, FrameWriter
from scenewright.stages.kit.formats.masks import PanopticReader
from scenewright.stages.kit.geometry.transforms import look_at, transform_from_quaternion
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context
from scenewright.stages.segment.parameters import STAGE, SegmentParameters
from scenewright.stages.segment.stage import recognised_share, run

from tests.real_data import real_data
from tests.unit.segment.test_box_masks import SCENE, WIDE, world_depth

NAMES = {1: "wall", 2: "table", 3: "cup", 4: "cabinet", 5: "fridge"}
VOCABULARY = load_vocabulary()


@dataclass(frozen=True)
class Written:
    sequence: Sequence
    which: list[np.ndarray]
    """True surface numbers of every frame."""


def write_sequence(root: Path, *, labels: bool = True, depth: bool = True, frames: int = 4) -> Written:
    """A room with table, cup, unit and fridge; label values are 10 x the surface number."""
    root.mkdir(parents=True, exist_ok=True)
    table = tuple(LabelEntry(instance=10 * k, class_name=name) for k, name in NAMES.items()) if labels else ()
    truth = []
    with FrameWriter(root / "frames.mcap", WIDE, labels=labels, label_table=table) as writer:
        for k in range(frames):
            pose = look_at(np.array([0.2 + 0.1 * k, -1.0, 1.4]), np.array([0.0, 0.6, 0.7]))
            image, which = world_depth(WIDE, pose, SCENE)
            color = np.repeat((which * 40).astype(np.uint8)[..., None], 3, axis=2)
            truth.append(which)
            writer.write(
                k / 10, color, image if depth else None, pose, (10 * which).astype(np.uint16) if labels else None
            )
    with FrameReader(root / "frames.mcap") as reader:
        SequenceFile(
            source_format="test",
            rule="test",
            camera=reader.camera,
            cameras=(SequenceCamera(name="camera", camera=reader.camera),),
            streams=reader.streams,
            frame_count=len(reader),
            frames_in_log=len(reader),
            gravity=Gravity(method="given", world_from_log=as_transform(np.eye(4))),
            label_table=table,
        ).write(root / "sequence.json")
    return Written(Sequence(root), truth)


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Written:
    return write_sequence(tmp_path_factory.mktemp("room") / "sequence")


def segment(
    sequence: Sequence, out: Path, *, seed: int = 0, weights: Path | None = None, **options: object
) -> Segments:
    out.mkdir(parents=True)
    options.setdefault("backend", "ground-truth")
    context = Context(output=out, seed=seed, device="cpu", progress=SilentProgress())
    return run(sequence, weights, parameters=SegmentParameters(**options), context=context)  # type: ignore[arg-type]


def class_image(segments: Segments, frame: int) -> np.ndarray:
    with PanopticReader(segments.path("panoptic.zip")) as reader:
        ids = reader.read(frame)
    lookup = np.zeros(int(ids.max()) + 1, dtype=int)
    for entry in segments.info.frames[frame].segments:
        lookup[entry.id] = entry.class_id
    return lookup[ids]


def test_ground_truth_comes_back(room: Written, tmp_path: Path) -> None:
    made = segment(room.sequence, tmp_path / "out")
    assert made.outcome == "ok" and made.summary["frames"] == 4
    assert made.info.label == "ground-truth masks, corruption 0"
    for frame, which in enumerate(room.which):
        classes = class_image(made, frame)
        for number, name in NAMES.items():
            true = which == number
            if true.sum() < 100:
                continue
            found = classes == VOCABULARY.by_name(name).id
            assert (true & found).sum() / (true | found).sum() > 0.8, (frame, name)


def test_segments_agree_with_the_images(room: Written, tmp_path: Path) -> None:
    made = segment(room.sequence, tmp_path / "out", corruption=0.5)
    assert made.info.label == "ground-truth masks, corruption 0.5" and made.info.corruption == 0.5
    with PanopticReader(made.path("panoptic.zip")) as reader:
        assert reader.frame_indices() == [entry.frame for entry in made.info.frames] == [0, 1, 2, 3]
        for entry in made.info.frames:
            ids = reader.read(entry.frame)
            areas = np.bincount(ids.ravel())
            assert {s.id: s.area for s in entry.segments} == {i: int(areas[i]) for i in range(1, areas.size)}
            for s in entry.segments:
                assert (s.class_id == 0) == (s.instance == 0)
                if s.class_id:
                    assert (VOCABULARY.by_id(s.class_id).kind == "thing") == s.is_thing


def payload(segments: Segments) -> list[bytes]:
    return [segments.path(name).read_bytes() for name in ("segments.json", "panoptic.zip")]


def test_same_seed_same_bytes(room: Written, tmp_path: Path) -> None:
    first = payload(segment(room.sequence, tmp_path / "a", corruption=0.6))
    assert first == payload(segment(room.sequence, tmp_path / "b", corruption=0.6))
    assert first != payload(segment(room.sequence, tmp_path / "c", corruption=0.6, seed=1))


def test_geometric_backend_names_nothing_and_that_is_right(room: Written, tmp_path: Path) -> None:
    made = segment(room.sequence, tmp_path / "out", backend="geometric", fusion="thesis")
    assert made.outcome == "ok" and made.summary["named_share"] == 0
    assert made.info.backend == "geometric" and "class-agnostic" in made.info.label
    for entry in made.info.frames:
        assert {(s.class_id, s.instance) for s in entry.segments} == {(0, 0)} and len(entry.segments) > 3


def test_no_frame_is_segmented_where_nothing_is_named(room: Written, tmp_path: Path) -> None:
    """`fuse` cuts the surface of the whole room then, whatever a frame's segments were."""
    made = segment(room.sequence, tmp_path / "out", backend="geometric")
    assert made.outcome == "ok" and not any(entry.segments for entry in made.info.frames)
    with PanopticReader(made.path("panoptic.zip")) as images:
        assert not any(images.read(entry.frame).any() for entry in made.info.frames)


def test_thesis_fusion_is_another_one(room: Written, tmp_path: Path) -> None:
    ours, thesis = (segment(room.sequence, tmp_path / rule, fusion=rule) for rule in ("ours", "thesis"))
    assert payload(ours) != payload(thesis)


def test_missing_labels_name_the_other_backends(tmp_path: Path) -> None:
    bare = write_sequence(tmp_path / "bare", labels=False, frames=1)
    with pytest.raises(BadInput) as caught:
        segment(bare.sequence, tmp_path / "out")
    assert "detector" in caught.value.hint and "geometric" in caught.value.hint
    assert segment(bare.sequence, tmp_path / "geometric", backend="geometric").outcome == "ok"


def test_bad_requests(room: Written, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="corruption"):
        segment(room.sequence, tmp_path / "a", backend="geometric", corruption=0.1)
    with pytest.raises(MissingDependency, match="weights"):
        segment(room.sequence, tmp_path / "b", backend="detector")
    with pytest.raises(BadInput, match="not an ONNX network"):
        segment(room.sequence, tmp_path / "c", backend="detector", weights=tmp_path / "none.onnx")
    blind = write_sequence(tmp_path / "blind", depth=False, frames=1)
    with pytest.raises(BadInput, match="depth"):
        segment(blind.sequence, tmp_path / "d")


def test_nothing_found_is_an_outcome(tmp_path: Path) -> None:
    root = tmp_path / "empty"
    root.mkdir()
    camera = Camera(width=40, height=30, fx=40, fy=40, cx=20, cy=15)
    with FrameWriter(root / "frames.mcap", camera) as writer:
        writer.write(0.0, np.zeros((30, 40, 3), np.uint8), np.zeros((30, 40), np.float32), np.eye(4))
    SequenceFile(
        source_format="test",
        rule="test",
        camera=camera,
        cameras=(SequenceCamera(name="camera", camera=camera),),
        streams=("color", "depth"),
        frame_count=1,
        frames_in_log=1,
        gravity=Gravity(method="none", world_from_log=as_transform(np.eye(4))),
    ).write(root / "sequence.json")
    assert segment(Sequence(root), tmp_path / "out", backend="geometric", fusion="thesis").outcome == "ok"
    assert segment(Sequence(root), tmp_path / "named", backend="network").outcome == "empty"


def test_detector_on_the_kitchen(tmp_path: Path) -> None:
    """One real frame through the whole step: a table, chairs, a cup. The floor is for `fuse` to find."""
    import cv2

    weights = real_data("detectors") / "yolox_nano.onnx"
    folder = real_data("7scenes_redkitchen")
    root = tmp_path / "kitchen"
    root.mkdir()
    camera = Camera(width=640, height=480, fx=585, fy=585, cx=320, cy=240)
    color = np.ascontiguousarray(cv2.imread(str(folder / "frame-000000.color.jpg"))[..., ::-1])
    depth = cv2.imread(str(folder / "frame-000000.depth.png"), cv2.IMREAD_UNCHANGED)
    depth[depth == 65535] = 0
    seen = color_in_depth_camera(color, depth / np.float32(1000), camera, COLOR_CAMERA, COLOR_FROM_DEPTH)
    # The pose that ingest gives this frame: 1.37 m over the floor, looking 28 degrees down.
    pose = transform_from_quaternion(np.array([-0.84013, -0.17373, 0.04527, 0.51182]), np.array([-0.32, 0.28, 1.3707]))
    with FrameWriter(root / "frames.mcap", camera) as writer:
        writer.write(0.0, seen, depth, pose)
    SequenceFile(
        source_format="test",
        rule="test",
        camera=camera,
        cameras=(SequenceCamera(name="camera", camera=camera),),
        streams=("color", "depth"),
        frame_count=1,
        frames_in_log=1,
        gravity=Gravity(method="floor_plane", world_from_log=as_transform(np.eye(4))),
    ).write(root / "sequence.json")
    made = segment(Sequence(root), tmp_path / "out", backend="detector", weights=weights)
    instances = {(s.class_id, s.instance) for s in made.info.frames[0].segments if s.class_id}
    names = sorted(VOCABULARY.by_id(category).name for category, _ in instances)
    assert "floor" not in names and names.count("table") == 1 and names.count("chair") >= 2 and "cup" in names
    assert made.info.label == "detector yolox_nano + geometric segments"


def test_declaration() -> None:
    assert STAGE.name == "segment" and STAGE.required() == ("sequence",)
    for name, info in SegmentParameters.model_fields.items():
        assert info.description, name


def test_recognised_share_is_that_of_the_area_of_things() -> None:
    chair, unnamed, wall = (load_vocabulary().by_name(name).id for name in ("chair", UNNAMED, "wall"))

    def frame(*rows: tuple[int, bool, int]) -> FrameSegments:
        segments = tuple(
            FrameSegment(id=k, class_id=c, instance=k, is_thing=thing, score=0.5, area=area)
            for k, (c, thing, area) in enumerate(rows, 1)
        )
        return FrameSegments(frame=0, segments=segments)

    seen = [frame((chair, True, 100), (wall, False, 5000), (0, False, 70)), frame((unnamed, True, 300))]
    assert recognised_share(seen, unnamed) == pytest.approx(0.25)
    assert recognised_share([frame((wall, False, 10))], unnamed) is None
