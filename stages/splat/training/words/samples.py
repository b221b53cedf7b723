"""What the embedded encoder is trained on, as arrays: pictures of rooms with what is where, and single models.

Models are rendered alone, one of three times in their own colours; `batches.py` sets them before pieces of rooms. The
arrays go into one file, so that a machine with a GPU needs neither the renderer nor the libraries.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.splat.training.words.lexicon import Lexicon, Thing

TRAINING_FILE, VALIDATION_FILE = "training.npz", "validation.npz"
RENDERED = 48
"""Edge of the picture of a model [px]."""
QUALITY = 75
"""WebP quality of the pictures in a file."""


@dataclass(frozen=True)
class Samples:
    """Rooms and models. Things are numbered; thing 0 is none, of which everything is false."""

    frames: np.ndarray
    """(F, H, W, 3) uint8."""
    labels: np.ndarray
    """(F, H, W) uint16: things."""
    sprites: np.ndarray
    """(K, V, RENDERED, RENDERED, 3) uint8: models, from V sides."""
    masks: np.ndarray
    """(K, V, RENDERED, RENDERED) bool: where the model is."""
    sprite_things: np.ndarray
    """(K,)."""
    things: np.ndarray
    """(T, A) int8: what is true of each (lexicon.py)."""
    held: np.ndarray
    """(T,) bool: no picture of it may be trained on ..."""
    held_style: np.ndarray
    """(T,) bool: ... for its style."""


def numbered(things: list[Thing], words: Lexicon) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return `things`, `held` and `held_style` of things 1, 2 ..."""
    rows = [np.zeros(len(words.attributes), np.int8), *(words.row(thing) for thing in things)]
    held = [False, *(words.is_held_out(thing) for thing in things)]
    styles = [False, *((thing.class_name, thing.style) in words.held_styles for thing in things)]
    return np.stack(rows), np.array(held), np.array(styles)


def write_samples(path: Path, samples: Samples) -> None:
    """Write samples; pictures lose a little (WebP)."""
    count, views, side = samples.masks.shape[:3]
    sheets = samples.sprites.transpose(0, 2, 1, 3, 4).reshape(count, side, views * side, 3)
    shapes = samples.masks.transpose(0, 2, 1, 3).reshape(count, side, views * side)
    arrays = {name: getattr(samples, name) for name in ("sprite_things", "things", "held", "held_style")}
    arrays |= _packed("frames", samples.frames, lossy=True) | _packed("labels", samples.labels, lossy=False)
    arrays |= _packed("sheets", sheets, lossy=True) | {"masks": np.packbits(shapes), "shape": np.array([count, views])}
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(path, allow_pickle=False, **arrays)


def read_samples(path: Path) -> Samples:
    """Read what `write_samples` wrote. Raises BadInput where there is no such file."""
    if not path.is_file():
        raise BadInput(f"{path}: no samples", hint="make them first: docs/SPLATS.md")
    with np.load(path, allow_pickle=False) as file:
        arrays = dict(file)
    count, views = (int(v) for v in arrays["shape"])
    sheets = _unpacked("sheets", arrays).reshape(count, RENDERED, views, RENDERED, 3).transpose(0, 2, 1, 3, 4)
    masks = np.unpackbits(arrays["masks"])[: count * views * RENDERED**2].astype(bool)
    return Samples(
        frames=_unpacked("frames", arrays),
        labels=_unpacked("labels", arrays),
        sprites=np.ascontiguousarray(sheets),
        masks=np.ascontiguousarray(masks.reshape(count, RENDERED, views, RENDERED).transpose(0, 2, 1, 3)),
        **{name: arrays[name] for name in ("sprite_things", "things", "held", "held_style")},
    )


def _packed(name: str, pictures: np.ndarray, *, lossy: bool) -> dict[str, np.ndarray]:
    """Return pictures as one run of bytes, with the lengths of its parts."""
    if lossy:
        files = [cv2.imencode(".webp", each[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, QUALITY])[1] for each in pictures]
    else:
        files = [cv2.imencode(".png", each, [cv2.IMWRITE_PNG_COMPRESSION, 9])[1] for each in pictures]
    parts = [file.reshape(-1) for file in files]
    joined = np.concatenate(parts) if parts else np.zeros(0, np.uint8)
    return {name: joined, f"{name}_lengths": np.array([len(part) for part in parts], np.int64)}


def _unpacked(name: str, arrays: dict[str, np.ndarray]) -> np.ndarray:
    ends = np.cumsum(arrays[f"{name}_lengths"])
    found = []
    for start, end in zip(np.concatenate([[0], ends[:-1]]), ends, strict=True):
        picture: np.ndarray | None = cv2.imdecode(arrays[name][start:end], cv2.IMREAD_UNCHANGED)
        assert picture is not None
        found.append(picture[..., ::-1] if picture.ndim == 3 else picture)
    return np.ascontiguousarray(np.stack(found))
