"""Masks as strangers have them, and how well the segments that came of them lie over the true ones."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.segments import Segments
from scenewright.schemas.vocabulary import load_vocabulary

from tests.strangers.calls import CLEAR_CODES, Said, call
from tests.strangers.rooms import NAMES, pitched, seen, shots
from tests.unit.segment.test_stage import class_image

COUNT = 6
PAN = np.array([pitched((-0.2 + 0.02 * k, -0.9, 1.3), 145 - 24.0 * k, 22) for k in range(COUNT)])
"""A camera that turns by 24 degrees from frame to frame: masks of the next frame lie elsewhere."""
TRUE = [seen(pose)[2] for pose in PAN]
"""Surface numbers (H, W) of every frame, as in NAMES."""
SHOTS = shots(PAN)
THINGS = {name: number for number, name in NAMES.items() if name != "wall"}
VOCABULARY = load_vocabulary()


def _red_and_blue() -> np.ndarray:
    height, width = TRUE[0].shape
    picture = np.zeros((height, width, 3), np.uint8)
    picture[: height * 3 // 4, : width // 2, 0] = 255
    picture[: height * 3 // 4, width // 2 :, 2] = 255
    return picture


RED_AND_BLUE = [(_red_and_blue(), depth, pose) for _, depth, pose in SHOTS[:1]]
"""A picture that is red on the left and blue on the right, black below: what the tiny networks find."""


def numbers(name: str) -> set[int]:
    """Return the class numbers that a word may become."""
    return {entry.id for entry in VOCABULARY.classes if entry.name == name}


def overlaps(segments: Path, frames: list[int] | None = None, order: list[int] | None = None) -> dict[str, float]:
    """Return class -> intersection over union with the truth over all frames that see it.

    `frames` are those of the sequence that count; `order` says which true frame each of them is.
    """
    artifact = Segments(segments)
    frames = list(range(COUNT)) if frames is None else frames
    order = list(range(COUNT)) if order is None else order
    both, either = dict.fromkeys(THINGS, 0), dict.fromkeys(THINGS, 0)
    for frame in frames:
        found, true = class_image(artifact, frame), TRUE[order[frame]]
        for name, number in THINGS.items():
            mask, wanted = np.isin(found, list(numbers(name))), true == number
            both[name] += int((mask & wanted).sum())
            either[name] += int((mask | wanted).sum())
    return {name: both[name] / either[name] for name in THINGS if either[name]}


def classes_at(segments: Path, red: str = "cup", blue: str = "chair") -> tuple[float, float]:
    """Return the shares of the red part that have one class and of the blue part that have the other."""
    height, width = TRUE[0].shape
    found = class_image(Segments(segments), 0)
    left, right = found[8 : height // 2, 8 : width // 2 - 8], found[8 : height // 2, width // 2 + 8 : -8]
    return float(np.isin(left, list(numbers(red))).mean()), float(np.isin(right, list(numbers(blue))).mean())


def segment(sequence: Path, masks: Path, out: Path, *options: str | Path) -> Said:
    return call("segment", "--sequence", sequence, "--backend", "masks", "--masks", masks, "--out", out, *options)


def right_or_clear(
    sequence: Path,
    masks: Path,
    tmp_path: Path,
    *words: str,
    frames: list[int] | None = None,
    order: list[int] | None = None,
    least: float = 0.8,
) -> None:
    """Every thing lies where it is (IoU), or the masks are refused in a line that says these words."""
    said = segment(sequence, masks, tmp_path / "segments")
    if said.code == 0:
        found = overlaps(tmp_path / "segments", frames, order)
        assert found and min(found.values()) > least, f"{found}: {said.text}"
        return
    assert said.code in CLEAR_CODES
    assert words and said.names(*words), f"refused without naming {words}: {said.text}"
    assert not said.names("keep one of them"), said.text


def outline(mask: np.ndarray) -> list[np.ndarray]:
    """Return polygons (N, 2) [pixel] along the outer borders of a mask."""
    found, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return [contour[:, 0].astype(float) for contour in found if len(contour) > 2]


def write_ids(path: Path, image: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), image)
