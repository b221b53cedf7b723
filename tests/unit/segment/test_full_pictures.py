"""Where a sequence keeps pictures larger than its frames, networks see those; masks come out at the frame's size."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.formats.frames import Frame, FrameReader, FrameWriter
from scenewright.stages.kit.geometry.cameras import boxes_seen_by, project, scaled, seen_by
from scenewright.stages.segment.backends.masks.backend import MasksBackend
from scenewright.stages.segment.choice import BackendRequest
from scenewright.stages.segment.full_pictures import OnFullPictures
from scenewright.stages.segment.geometric import GeometricFrame, segment_depth
from scenewright.stages.segment.panoptic import PanopticFrame, PanopticMask
from scenewright.stages.segment.parameters import SegmentParameters
from scenewright.stages.segment.settings import geometric_settings
from scenewright.stages.splat.language.looks import sight_of
from scenewright.stages.splat.views import read_view

from tests.unit.ingest.phone_writers import Take, write_polycam
from tests.unit.ingest.running import ingest

SMALL = Camera(width=32, height=24, fx=30.0, fy=30.0, cx=15.8, cy=11.6)
FULL = scaled(SMALL, 7.5)


class Bright:
    """A backend of pictures: what is bright is one mask, a dot of one pixel another."""

    name, label, networks = "bright", "bright", ("bright",)
    streams: tuple[str, ...] = ("color", "depth")

    def __call__(self, frame: Frame, geometric: GeometricFrame | None, random: object) -> PanopticFrame:
        assert frame.color is not None
        ids = (frame.color[..., 0] > 128).astype(np.int32)
        ids[0, 1] = 2
        return PanopticFrame(ids, {1: PanopticMask(5, True, 0.9), 2: PanopticMask(6, True, 0.9)})


def written(path: Path, picture: np.ndarray | None) -> FrameReader:
    pictures = {"camera": FULL}
    with FrameWriter(path, SMALL, picture_cameras=pictures) as writer:
        writer.write(1.0, np.zeros((24, 32, 3), np.uint8), np.ones((24, 32), np.float32), picture=picture)
    return FrameReader(path)


def test_masks_of_the_picture_come_out_at_the_frames_size(tmp_path: Path) -> None:
    picture = np.zeros((180, 240, 3), np.uint8)
    picture[60:120, 80:160] = 255
    with written(tmp_path / "frames.mcap", picture) as reader:
        backend = OnFullPictures(Bright(), reader)
        assert backend.networks == ("bright",) and "picture" in backend.streams
        (frame,) = reader.frames(backend.streams)
        found = backend(frame, None, np.random.default_rng(0))  # type: ignore[arg-type]
    assert found.ids.shape == (24, 32) and set(found.masks) == {1}
    rows, columns = np.nonzero(found.ids == 1)
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (8, 15, 11, 20)


def test_a_frame_without_a_picture_is_judged_by_its_colour(tmp_path: Path) -> None:
    with written(tmp_path / "frames.mcap", None) as reader:
        (frame,) = reader.frames(("color", "depth", "picture"))
        found = OnFullPictures(Bright(), reader)(frame, None, np.random.default_rng(0))  # type: ignore[arg-type]
    assert found.ids.shape == (24, 32) and not (found.ids == 1).any()


@pytest.mark.parametrize("source", [FULL, FULL.model_copy(update={"cx": 140.0, "fy": 260.0})])
def test_a_ray_is_the_same_pixel_of_both(source: Camera) -> None:
    image = np.arange(source.width * source.height).reshape(source.height, source.width)
    seen = seen_by(image, source, SMALL)
    points = np.array([[0.1, -0.2, 1.0], [-0.3, 0.1, 1.2], [0.0, 0.0, 2.0]])
    (small, _), (large, _) = project(points, SMALL), project(points, source)
    for (u, v), (x, y) in zip(np.rint(small).astype(int), large, strict=True):
        row, column = np.divmod(seen[v, u], source.width)
        assert abs(row - y) < 8 and abs(column - x) < 8
    boxes = np.hstack([large, large + 10])
    assert boxes_seen_by(boxes, source, SMALL)[:, :2] == pytest.approx(small)


def test_what_the_other_did_not_see_is_nothing() -> None:
    narrow = SMALL.model_copy(update={"fx": 60.0, "fy": 60.0})
    seen = seen_by(np.ones((24, 32), np.int32), narrow, SMALL)
    assert seen.shape == (24, 32) and seen[12, 16] == 1 and not seen[0].any() and not seen[:, 0].any()


@pytest.mark.parametrize(("width", "size"), [(20, (20, 15)), (120, (120, 90)), (1000, (240, 180))])
def test_splats_are_learned_from_the_picture_where_frames_are_smaller(
    tmp_path: Path, width: int, size: tuple[int, int]
) -> None:
    with FrameWriter(tmp_path / "frames.mcap", SMALL, picture_cameras={"camera": FULL}) as writer:
        color, depth = np.full((24, 32, 3), 80, np.uint8), np.ones((24, 32), np.float32)
        writer.write(1.0, color, depth, picture=np.full((180, 240, 3), 200, np.uint8))
    with FrameReader(tmp_path / "frames.mcap") as reader:
        view = read_view(reader, 0, np.eye(4), width)
    assert view is not None and view.depth is not None and view.color.shape[:2] == view.depth.shape
    assert (view.camera.width, view.camera.height) == size
    assert view.camera.fx == pytest.approx(SMALL.fx * size[0] / 32)
    assert view.color.mean() == pytest.approx((80 if width == 20 else 200) / 255, abs=0.02)
    assert (view.depth > 0).all()


def test_words_are_looked_up_in_the_picture(tmp_path: Path) -> None:
    depth = np.full((24, 32), 2, np.float32)
    with FrameWriter(tmp_path / "frames.mcap", SMALL, picture_cameras={"camera": FULL}) as writer:
        writer.write(1.0, np.zeros((24, 32, 3), np.uint8), depth, picture=np.full((180, 240, 3), 200, np.uint8))
        writer.write(2.0, np.full((24, 32, 3), 9, np.uint8), depth)
    with FrameReader(tmp_path / "frames.mcap") as reader:
        full, small = (sight_of(reader, frame, frame.depth, np.eye(4)) for frame in reader.frames(("color", "depth")))
    assert full.camera == FULL and full.color.shape == (180, 240, 3) and full.color.mean() > 190
    assert full.depth.shape == (180, 240) and (full.depth == 2).all()
    assert small.camera == SMALL and small.color.mean() == pytest.approx(9, abs=1)


@pytest.mark.parametrize("size", [(48, 64), (360, 480)])
def test_masks_of_ones_own_may_be_of_the_full_picture(tmp_path: Path, size: tuple[int, int]) -> None:
    """The same mask, made on the frame or on the app's picture, is the same segment; other sizes are refused."""
    sequence = ingest(write_polycam(tmp_path / "log", Take(2)), tmp_path / "sequence")
    mask = np.zeros((1, *size), bool)
    mask[0, size[0] // 4 : size[0] // 2, size[1] // 4 : size[1] // 2] = True
    (tmp_path / "masks").mkdir()
    with FrameReader(sequence.path("frames.mcap")) as reader:
        for time in reader.times:
            path = tmp_path / "masks" / f"{time:.9f}.npz"
            np.savez(path, masks=mask, classes=np.array(["cup"]), scores=np.array([0.9], np.float32))
        request = BackendRequest(
            SegmentParameters(backend="masks"), None, masks=tmp_path / "masks", sequence=sequence, reader=reader
        )
        backend = MasksBackend(request)
        (frame, _) = reader.frames(("depth",))
        geometric = segment_depth(frame.depth, reader.camera, geometric_settings(SegmentParameters()))
        ids = backend(frame, geometric, np.random.default_rng(0)).ids
        rows, columns = np.nonzero(ids)
        assert ids.shape == (48, 64)
        assert (rows.min(), rows.max(), columns.min(), columns.max()) == (12, 23, 16, 31)
        np.savez(path, masks=mask[:, :-1], classes=np.array(["cup"]), scores=np.array([0.9], np.float32))
        with pytest.raises(BadInput, match="frame 1"):
            backend(reader.read(1, ("depth",)), geometric, np.random.default_rng(0))
