"""NPZ files, one a picture: `masks` (N, H, W) that may overlap or `ids` (H, W), with what they are.

Beside `masks`: `classes` (N,) numbers or names, `scores` (N,). Beside `ids`: `id` (N,) the values that occur, with
`classes` and `scores` in their order (without `id`: 1 .. N); without both, the class file says what a value is. 0 is no
mask, unless `id` or the class file lists it. A picture without masks has `masks` of N = 0, or an empty array.
"""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import opened
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.kit.formats.zip_files import zip_errors
from scenewright.stages.segment.backends.masks.classes import read_classes, score_of, words_numbered
from scenewright.stages.segment.backends.masks.encoded import check_amount
from scenewright.stages.segment.backends.masks.given import (
    Category,
    GivenFrame,
    GivenMask,
    MaskFormat,
    MaskSource,
    ReadSettings,
    picture_of_file,
)
from scenewright.stages.segment.backends.masks.listing import Listing
from scenewright.stages.segment.backends.masks.overlapping import flatten
from scenewright.stages.segment.backends.masks.values import named_by_value, numbered

HINT = (
    "np.savez(name, masks=..., classes=..., scores=...), masks (N, H, W) of bool; an image without masks has "
    "masks=np.zeros((0, H, W), bool)"
)
NAMES = ("masks", "ids", "id", "classes", "scores")
"""Arrays that are read; of `ids` and `id` either."""
PROBABLE = 0.5
"""Least probability of a mask's pixel: torchvision's own."""
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
            words |= {str(name) for name in _texts(classes).ravel()} if classes.dtype.kind in "SU" else set()
    categories, divisor = read_classes(listing)
    numbers = words_numbered(words, categories)
    listed = (categories, divisor, listing.class_source())
    categories = {**categories, **{number: Category(word) for word, number in numbers.items()}}

    def read(place: int, shape: tuple[int, int], settings: ReadSettings) -> GivenFrame:
        if listed[0] and names[place] == {"ids"}:
            (values,) = read_arrays(files[place], "ids", hint=HINT)
            ids = _checked_ids(files[place], values, shape)
            return named_by_value(ids, listed[0], listed[1], files[place], listed[2], HINT)
        return _read(files[place], names[place], numbers, shape, settings)

    lacks = [] if all("masks" in have for have in names) else ["overlaps"]
    lacks += [] if all("scores" in have for have in names) else ["scores"]
    return MaskSource(tuple(picture_of_file(file, listing.root) for file in files), categories, read, tuple(lacks))


def _arrays(path: Path) -> set[str]:
    """Return the arrays of a file that are read here. Raises BadInput when they claim more than is held at a time."""
    with opened(path, hint=HINT) as file, zip_errors(path, HINT), zipfile.ZipFile(file) as archive:
        rows = [row for row in archive.infolist() if row.filename.removesuffix(".npy") in NAMES]
        if sum(row.file_size for row in rows) > LARGEST_FILE:
            raise BadInput(f"unpacks to more than {LARGEST_FILE} bytes", hint="write one file an image")
        have = {row.filename.removesuffix(".npy") for row in rows}
    if ("masks" in have) == ("ids" in have):
        raise BadInput(f"{path}: needs either `masks` (N, H, W) or `ids` (H, W)", hint=HINT)
    return have


def _read(
    path: Path, have: set[str], numbers: dict[str, int], shape: tuple[int, int], settings: ReadSettings
) -> GivenFrame:
    order = [name for name in NAMES if name in have]
    arrays = dict(zip(order, read_arrays(path, *order, hint=HINT), strict=True))
    if "masks" in have:
        stack = _stack(path, arrays["masks"], shape)
        check_amount(len(stack), shape, str(path))
        return flatten(list(stack), _given_masks(path, arrays, len(stack), numbers), settings, shape)
    ids = _checked_ids(path, arrays["ids"], shape)
    present = [number for number in np.unique(ids).tolist() if number or "id" in have and 0 in arrays["id"]]
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
    return numbered(ids, dict(zip(listed.tolist(), masks, strict=True)), [])


def _stack(path: Path, masks: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Return masks (N, H, W) bool. (H, W), (N, 1, H, W) and (H, W, N) are read where the frame's size leaves no doubt,
    and probabilities, of which 0.5 and more are inside. Raises BadInput."""
    if not masks.size:
        return np.zeros((0, *shape), dtype=bool)
    if masks.ndim == 4 and masks.shape[1] == 1:
        masks = masks[:, 0]
    if masks.ndim == 3 and masks.shape[:2] == shape != masks.shape[1:]:
        masks = masks.transpose(2, 0, 1)
    if masks.ndim == 2 and masks.shape == shape:
        masks = masks[None]
        if len(np.unique(masks)) > 2:
            raise BadInput(f"{path}: `masks` (H, W) holds several values", hint="call an image of values `ids`")
    if masks.ndim != 3 or masks.dtype.kind not in "buif":
        raise BadInput(f"{path}: `masks` is {masks.dtype} {masks.shape}, not (N, H, W) of bool or integers", hint=HINT)
    _check_size(path, masks, shape)
    if masks.dtype.kind != "f":
        return masks != 0
    if not ((masks >= 0) & (masks <= 1)).all():
        raise BadInput(
            f"{path}: `masks` is {masks.dtype} beyond 0..1, so no probabilities",
            hint="write booleans: masks=logits > 0",
        )
    return masks >= PROBABLE


def _checked_ids(path: Path, ids: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    if ids.ndim == 3 and 1 in (ids.shape[0], ids.shape[2]):
        ids = ids.reshape(shape) if ids.size == shape[0] * shape[1] else ids.squeeze()
    if ids.ndim != 2 or ids.dtype.kind not in "bui":
        raise BadInput(f"{path}: `ids` is {ids.dtype} {ids.shape}, not (H, W) of integers", hint=HINT)
    _check_size(path, ids, shape)
    if ids.size and not 0 <= int(ids.min()) <= int(ids.max()) < 2**31:
        raise BadInput(f"{path}: ids that are not in 0..2^31", hint=HINT)
    return ids.astype(np.int32)


def _check_size(path: Path, image: np.ndarray, shape: tuple[int, int]) -> None:
    if image.shape[-2:] != shape:
        raise BadInput(
            f"{path}: masks of {image.shape[-1]}x{image.shape[-2]}, the frame has {shape[1]}x{shape[0]} pixels",
            hint="scale the network's masks to the images of the sequence (nearest neighbour)",
        )


def _texts(names: np.ndarray) -> np.ndarray:
    """Return text of text in bytes, as HDF5 and pandas give it."""
    return np.char.decode(names, "utf-8", "replace") if names.dtype.kind == "S" else names


def _given_masks(path: Path, arrays: dict[str, np.ndarray], count: int, numbers: dict[str, int]) -> list[GivenMask]:
    for name in ("classes", "scores"):
        if name in arrays and arrays[name].size != count:
            raise BadInput(f"{path}: `{name}` is {arrays[name].shape} for {count} masks", hint=HINT)
    if not count:
        return []
    classes, scores = (arrays[name].ravel() if name in arrays else None for name in ("classes", "scores"))
    if classes is not None and classes.dtype.kind == "f" and (classes == np.round(classes)).all():
        classes = classes.astype(np.int64)  # numbers that a network gave beside its boxes
    classes = None if classes is None else _texts(classes)
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


FORMAT = MaskFormat("NPZ stacks", "`masks` (N, H, W) or `ids` (H, W), a file an image", 40, open_source)
