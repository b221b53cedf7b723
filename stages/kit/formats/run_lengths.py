"""COCO's run-length encodings: a mask as the lengths of its runs of 0 and 1 in turn, down the columns, first of 0.

`{"size": [height, width], "counts": [7, 3, ...]}`, or `counts` as text: runs from the fourth on as the difference to
the run two before, in pieces of five bits, the lowest first, the sixth bit of a piece saying that another follows, and
48 added to each to make it a printable letter (pycocotools, maskApi.c: rleFrString).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput

LONGEST_PIECES = 7
"""Pieces of five bits that a run of at most 2^31 takes."""


def decode_rle(encoding: Any, shape: tuple[int, int]) -> np.ndarray:
    """Return the mask (H, W) bool of an encoding for a picture of `shape`.

    Raises BadInput, in words that follow the name of the mask, when it is none, of another size, or lies: runs that are
    negative, no integers, or do not add up to the picture.
    """
    size = encoding.get("size") if isinstance(encoding, dict) else None
    if not isinstance(size, list) or len(size) != 2 or "counts" not in encoding:
        raise BadInput("its segmentation is not an RLE ({size, counts})", hint="pycocotools.mask.encode writes one")
    if size != [shape[0], shape[1]]:
        raise BadInput(
            f"its RLE is of {size[1]!r:.12} x {size[0]!r:.12} pixels, the frame of {shape[1]} x {shape[0]}",
            hint="masks have the size of the sequence's pictures",
        )
    counts = encoding["counts"]
    runs = _runs_of_text(counts) if isinstance(counts, str) else _runs_of_list(counts)
    pixels = shape[0] * shape[1]
    if len(runs) and int(runs.min()) < 0:
        raise BadInput(f"its RLE has a run of {int(runs.min())} pixels", hint="it is damaged; write it again")
    if len(runs) and (int(runs.max()) > pixels or int(runs.sum()) != pixels) or not len(runs):
        total = "more than the picture" if len(runs) and int(runs.max()) > pixels else f"{int(runs.sum())} pixels"
        raise BadInput(f"its RLE adds up to {total}, the picture has {pixels}", hint="it is damaged; write it again")
    values = np.arange(len(runs)) % 2 == 1
    return np.repeat(values, runs).reshape(shape, order="F")


def encode_rle(mask: np.ndarray) -> dict[str, Any]:
    """Return the uncompressed encoding of a mask (H, W) bool."""
    flat = np.asarray(mask, dtype=bool).ravel(order="F")
    ends = np.flatnonzero(np.diff(flat)) + 1
    runs = np.diff([0, *ends.tolist(), flat.size]).tolist()
    return {"size": list(mask.shape), "counts": [0, *runs] if flat[0] else runs}


def _runs_of_list(counts: Any) -> np.ndarray:
    if not isinstance(counts, list) or not all(type(run) is int and abs(run) < 2**40 for run in counts):
        raise BadInput("the counts of its RLE are no list of integers and no text", hint="write it again")
    return np.array(counts, dtype=np.int64)


def _runs_of_text(text: str) -> np.ndarray:
    letters = np.frombuffer(text.encode("utf-8", "replace"), dtype=np.uint8).astype(np.int64) - 48
    if not len(letters):
        return letters
    last = (letters & 32) == 0
    if letters.min() < 0 or letters.max() > 63 or not last[-1]:
        raise BadInput("the text of its RLE breaks off or has letters that none has", hint="write it again")
    ends = np.flatnonzero(last)
    starts = np.concatenate([[0], ends[:-1] + 1])
    if int((ends - starts).max()) >= LONGEST_PIECES:
        raise BadInput("the text of its RLE has a run of more than 2^31 pixels", hint="it is damaged; write it again")
    letter_position = np.arange(len(letters)) - np.repeat(starts, ends - starts + 1)
    runs = np.add.reduceat((letters & 31) << (5 * letter_position), starts)
    negative = (letters[ends] & 16) != 0
    runs = runs - (negative.astype(np.int64) << (5 * (ends - starts + 1)))
    runs[1::2] = np.cumsum(runs[1::2])
    runs[2::2] = np.cumsum(runs[2::2])
    return runs
