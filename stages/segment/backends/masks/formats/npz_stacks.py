"""NPZ files, one a picture: `masks` (N, H, W) that may overlap or `ids` (H, W), with what they are.

Beside `masks`: `classes` (N,) numbers or names, `scores` (N,). Beside `ids`, whose 0 is no mask: `id` (N,) the values
that occur, with `classes` and `scores` in their order (without `id`: 1 .. N).
"""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import opened
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.kit.formats.zip_files import zip_errors
from scenewright.stages.segment.backends.masks.classes import read_classes, score_of
from scenewright.stages.segment.backends.masks.encoded import check_amount
from scenewright.stages.segment.backends.masks.given import (
    Category,
    GivenFrame,
    GivenMask,
    MaskFormat,
    MaskSource,
    Picture,
    ReadSettings,
)
from scenewright.stages.segment.backends.masks.listing import Listing
from scenewright.stages.segment.backends.masks.overlapping import flatten

HINT = "np.savez(name, masks=..., classes=..., scores=...); docs/MASKS.md"
NAMES = ("masks", "ids", "id", "classes", "scores")
"""Arrays that are read; of `ids` and `id` either."""
LARGEST_FILE = 2**30 + 2**16
"""Most bytes of the arrays of one picture, unpacked."""


def open_source(listing: Listing) -> MaskSource | None:
    """Return the masks of a folder of NPZ files. Raises BadInput when one of them is broken."""
    files = listing.ending(".npz")
    if not files:
        return None
    names = [_arrays(file) for file in files]
    words: set[str] = set()
    for file, have in zip(files, names, strict=True):
        if "classes" in have:
            (classes,) = read_arrays(file, "classes", hint=HINT)
            words |= {str(name) for name in classes.ravel()} if classes.dtype.kind == "U" else set()
    categories, _ = read_classes(listing)
    numbers = {word: number for number, word in enumerate(sorted(words), start=1 + max(categories, default=0))}
    categories = {**categories, **{number: Category(word) for word, number in numbers.items()}}

    def read(place: int, shape: tuple[int, int], settings: ReadSettings) -> GivenFrame:
        return _read(files[place], names[place], numbers, shape, settings)

    lacks = [] if all("masks" in have for have in names) else ["overlaps"]
    lacks += [] if all("scores" in have for have in names) else ["scores"]
    return MaskSource(tuple(Picture(file.stem) for file in files), categories, read, tuple(lacks))


def _arrays(path: Path) -> set[str]:
    """Return the arrays of a file that are read here. Raises BadInput when they claim more than is held at a time."""
    with opened(path, hint=HINT) as file, zip_errors(path, HINT), zipfile.ZipFile(file) as archive:
        rows = [row for row in archive.infolist() if row.filename.removesuffix(".npy") in NAMES]
        if sum(row.file_size for row in rows) > LARGEST_FILE:
            raise BadInput(f"unpacks to more than {LARGEST_FILE} bytes", hint="write one file a picture")
        have = {row.filename.removesuffix(".npy") for row in rows}
    if ("masks" in have) == ("ids" in have):
        raise BadInput(f"{path}: needs either `masks` (N, H, W) or `ids` (H, W)", hint=HINT)
    return have


def _read(
    path: Path, have: set[str], numbers: dict[str, int], shape: tuple[int, int], settings: ReadSettings
) -> GivenFrame:
    order = [name for name in NAMES if name in have]
    arrays = dict(zip(order, read_arrays(path, *order, hint=HINT), strict=True))
    image = arrays["masks"] if "masks" in have else arrays["ids"]
    if image.ndim != (3 if "masks" in have else 2) or image.dtype.kind not in "bui":
        raise BadInput(f"{path}: `masks` is {image.dtype} {image.shape}, not (N, H, W) of bool or integers", hint=HINT)
    if image.shape[-2:] != shape:
        raise BadInput(
            f"{path}: masks of {image.shape[-1]}x{image.shape[-2]}, the frame has {shape[1]}x{shape[0]} pixels",
            hint="scale the network's masks to the pictures of the sequence (nearest neighbour)",
        )
    if "masks" in have:
        check_amount(len(image), shape, str(path))
        return flatten(list(image != 0), _given_masks(path, arrays, len(image), numbers), settings, shape)
    if image.size and not 0 <= int(image.min()) <= int(image.max()) < 2**31:
        raise BadInput(f"{path}: ids that are not in 0..2^31", hint=HINT)
    ids = image.astype(np.int32)
    present = [number for number in np.unique(ids).tolist() if number]
    listed = (
        arrays["id"] if "id" in have else np.arange(1, 1 + len(arrays["classes"] if "classes" in have else present))
    )
    if listed.ndim != 1 or listed.dtype.kind not in "ui" or len(set(listed.tolist())) != len(listed):
        raise BadInput(f"{path}: `id` is {listed.dtype} {listed.shape}, not (N,) of different integers", hint=HINT)
    if "id" not in have and "classes" not in have:
        listed = np.array(present)
    missing = sorted(set(present) - set(listed.tolist()))
    if missing:
        raise BadInput(f"{path}: nothing says what id {missing[0]} is ({len(missing)} such ids)", hint=HINT)
    masks = _given_masks(path, arrays, len(listed), numbers)
    return GivenFrame(ids, dict(zip(listed.tolist(), masks, strict=True)))


def _given_masks(path: Path, arrays: dict[str, np.ndarray], count: int, numbers: dict[str, int]) -> list[GivenMask]:
    for name in ("classes", "scores"):
        if name in arrays and arrays[name].shape != (count,):
            raise BadInput(f"{path}: `{name}` is {arrays[name].shape} for {count} masks", hint=HINT)
    classes, scores = arrays.get("classes"), arrays.get("scores")
    if classes is not None and classes.dtype.kind not in "uiU":
        raise BadInput(f"{path}: `classes` is {classes.dtype}, not integers or text", hint=HINT)
    if scores is not None and scores.dtype.kind not in "uif":
        raise BadInput(f"{path}: `scores` is {scores.dtype}, not numbers", hint=HINT)
    masks = []
    for k in range(count):
        category = (
            None if classes is None else numbers.get(str(classes[k])) if classes.dtype.kind == "U" else int(classes[k])
        )
        # The shortest number that rounds to the same 32 bits: 0.9 stays 0.9, as the other formats have it.
        score = 1.0 if scores is None else score_of(float(str(scores[k])), str(path))
        masks.append(GivenMask(category, score))
    return masks


FORMAT = MaskFormat("NPZ stacks", "`masks` (N, H, W) or `ids` (H, W), a file a picture", 40, open_source)
