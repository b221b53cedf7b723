"""Masks and labelled meshes that users bring: whatever is wrong with them, the command says it in one line.

What can't be used ends it with code 3 and leaves nothing; what is only incomplete (frames without masks, masks that
overlap) is one warning beside an artifact.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from scenewright.cli.main import run
from scenewright.stages.engine.runner import run_stage
from scenewright.stages.ingest.parameters import STAGE as INGEST
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.formats.run_lengths import encode_rle

from tests.unit.segment.test_stage import NAMES, write_sequence

CLASSES = {str(10 * k): name for k, name in NAMES.items()}
Write = Callable[[Path, list[np.ndarray]], None]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[np.ndarray]]:
    """A sequence of three frames as `ingest` writes it, and its true masks (H, W)."""
    root = tmp_path_factory.mktemp("recorded")
    log = write_sequence(root / "log", frames=3).sequence.path("frames.mcap")
    run_stage(INGEST, {"log": log}, root / "sequence", INGEST.parameters())
    with FrameReader(log) as reader:
        images = [frame.labels for frame in reader.frames(streams=("labels",))]
    return root / "sequence", [image for image in images if image is not None]


def pictures(root: Path, images: list[np.ndarray], classes: dict[str, str] | None = None) -> None:
    for k, image in enumerate(images):
        cv2.imwrite(str(root / f"{k:06d}.png"), image.astype(np.uint16))
    (root / "classes.json").write_text(json.dumps(CLASSES if classes is None else classes))


def another_size(root: Path, images: list[np.ndarray]) -> None:
    pictures(root, [image[::2, ::2] for image in images])


def beyond_the_class_file(root: Path, images: list[np.ndarray]) -> None:
    pictures(root, images, {"1": "chair"})


def of_frames_that_are_not_there(root: Path, images: list[np.ndarray]) -> None:
    pictures(root, images)
    (root / "000002.png").rename(root / "000777.png")


def lying_run_lengths(root: Path, images: list[np.ndarray]) -> None:
    code = encode_rle(images[0] == images[0].max())
    rows = [{"image_id": 0, "category_id": 10, "segmentation": {**code, "counts": [*code["counts"], 7]}}]
    told = [{"id": 10, "name": "chair"}]
    (root / "m.json").write_text(json.dumps({"images": [{"id": 0}], "annotations": rows, "categories": told}))


def boxes_alone(root: Path, images: list[np.ndarray], outlined: tuple[int, ...] = ()) -> None:
    outline = [[5.0, 5.0, 60.0, 5.0, 60.0, 40.0, 5.0, 40.0]]
    rows = [
        {"image_id": k, "category_id": 10, "bbox": [5, 5, 55, 35], "segmentation": outline if k in outlined else []}
        for k in range(3)
    ]
    told = [{"id": 10, "name": "chair"}]
    listed = [{"id": k, "file_name": f"{k:06d}.jpg"} for k in range(3)]
    (root / "m.json").write_text(json.dumps({"images": listed, "annotations": rows, "categories": told}))


def two_boxes_and_an_outline(root: Path, images: list[np.ndarray]) -> None:
    boxes_alone(root, images, (1,))


def twice_for_a_frame(root: Path, images: list[np.ndarray]) -> None:
    pictures(root, images)
    cv2.imwrite(str(root / "000001_jpg.rf.0a1b2c3d4e5f6071.png"), images[1].astype(np.uint8))


def ignored_values(root: Path, images: list[np.ndarray]) -> None:
    pictures(root, [np.where(image == image.max(), 255, image) for image in images])


def without_names(root: Path, images: list[np.ndarray]) -> None:
    pictures(root, images, dict.fromkeys(CLASSES, ""))


def of_one_frame(root: Path, images: list[np.ndarray]) -> None:
    pictures(root, images[:1])


def overlapping(root: Path, images: list[np.ndarray]) -> None:
    for k, image in enumerate(images):
        values = [value for value in np.unique(image).tolist() if value]
        whole = np.ones(image.shape, bool)
        np.savez(root / f"{k:06d}.npz", masks=np.array([*(image == value for value in values), whole]))


def command(recorded: tuple[Path, list[np.ndarray]], tmp_path: Path, write: Write) -> tuple[int, Path]:
    folder, out = tmp_path / "masks", tmp_path / "segments"
    folder.mkdir()
    write(folder, recorded[1])
    words = ["segment", "--sequence", str(recorded[0]), "--backend", "masks", "--masks", str(folder)]
    return run([*words, "--out", str(out)]), out


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (another_size, "frame 0: "),
        (beyond_the_class_file, "is beyond classes.json"),
        (of_frames_that_are_not_there, "1 of 3 masks are of frames outside the sequence: 000777"),
        (lying_run_lengths, "adds up to"),
        (without_names, "has no name"),
        (boxes_alone, "its annotations are boxes, none has a mask"),
        (twice_for_a_frame, "masks of '000001.png' and '000001_jpg.rf.0a1b2c3d4e5f6071.png' are both of frame 1"),
    ],
)
def test_masks_that_cannot_be_used(
    recorded: tuple[Path, list[np.ndarray]],
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    write: Write,
    message: str,
) -> None:
    code, out = command(recorded, tmp_path, write)
    errors = [line for line in capfd.readouterr().err.splitlines() if line.startswith("error: ")]
    assert code == 3 and len(errors) == 1 and message in errors[0], errors
    assert not out.exists()


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (of_one_frame, "2 of 3 frames have no masks, the first is 1"),
        (overlapping, "masks overlap in 3 frames"),
        (two_boxes_and_an_outline, "annotations without a mask"),
        (ignored_values, "255 (of 16 bits also 65535) is in no list of classes and was taken for no mask in 3 frames"),
    ],
)
def test_masks_that_are_used_all_the_same(
    recorded: tuple[Path, list[np.ndarray]],
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    write: Write,
    message: str,
) -> None:
    code, out = command(recorded, tmp_path, write)
    said = [line for line in capfd.readouterr().err.splitlines() if message in line]
    assert code == 0 and len(said) == 1 and (out / "manifest.json").is_file()


@pytest.mark.parametrize("faces", [10_000_000, 4_000_000_000])
def test_a_mesh_that_says_it_has_millions_of_faces(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], faces: int
) -> None:
    """Ten million are read where they are (and thinned); here the file ends long before."""
    head = ("ply", "format binary_little_endian 1.0", "element vertex 3")
    floats = tuple(f"property float {axis}" for axis in "xyz")
    lists = (f"element face {faces}", "property list uchar int vertex_indices", "end_header\n")
    text = "\n".join([*head, *floats, "property ushort label", *lists])
    (tmp_path / "scan.ply").write_bytes(text.encode() + bytes(3 * 14 + 13))
    code = run(["fuse", "--from-mesh", str(tmp_path / "scan.ply"), "--out", str(tmp_path / "map")])
    errors = [line for line in capfd.readouterr().err.splitlines() if line.startswith("error: ")]
    assert code == 3 and len(errors) == 1 and "scan.ply" in errors[0], errors
    assert not (tmp_path / "map").exists()
