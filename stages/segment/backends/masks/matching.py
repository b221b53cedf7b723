"""Which frame the masks of a picture belong to: by its name, its number or its time stamp."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.segment.backends.masks.given import Picture

NAME = re.compile(r"\d{6,9}", re.ASCII)
"""A frame's name in artifacts: its number in the sequence with six digits."""
SECONDS = re.compile(r"\d{1,10}\.\d+", re.ASCII)
TICKS = re.compile(r"\d{13,19}", re.ASCII)
"""Milliseconds to nanoseconds since 1970, by their number of digits."""
WAYS = ("name", "number", "time stamp")
"""How a picture may be matched to a frame, in the order in which that is tried."""
SHOWN = 3
"""Pictures without a frame that an error names."""


def match_pictures(
    pictures: Sequence[Picture], times: np.ndarray, tolerance: float, where: Path
) -> tuple[dict[int, int], Counter[str]]:
    """Return frame -> place of its picture, and how many were found in each of WAYS. times (N,) of the frames [s].

    A name of six to nine digits is that of a frame in every artifact (`000012`); `1305031102.175304` is a time [s],
    thirteen digits and more milli-, micro- or nanoseconds. Else the number that a picture is given, or the one in its
    name that differs from picture to picture, counts the frames of the sequence from 0. Raises BadInput when a picture
    belongs to no frame, or two to one.
    """
    varying = numbers_in_names([picture.name for picture in pictures])
    picture_of_frame: dict[int, int] = {}
    match_counts: Counter[str] = Counter()
    astray: list[str] = []
    for index, picture in enumerate(pictures):
        frame, matching = _frame_of(picture, varying[index], times, tolerance)
        if frame is None:
            astray.append(f"{picture.name or 'image'} ({matching} {_stated_text(picture, varying[index])})")
            continue
        if frame in picture_of_frame:
            raise _two_of_one_frame(pictures, picture_of_frame[frame], index, frame, where)
        picture_of_frame[frame] = index
        match_counts[matching] += 1
    if astray:
        astray_text = ", ".join(astray[:SHOWN]) + (", ..." if len(astray) > SHOWN else "")
        raise BadInput(
            f"{where}: {len(astray)} of {len(pictures)} masks are of frames that are not there: {astray_text}",
            hint=f"the sequence has frames 0 to {len(times) - 1} from {times[0]:.6f} to {times[-1]:.6f} s; "
            "name masks by these numbers or times"
            if len(times)
            else "the sequence is empty",
        )
    return picture_of_frame, match_counts


def says_a_frame(name: str) -> bool:
    """Return whether a name alone says which frame it is of, as six digits and stamps do."""
    return any(pattern.fullmatch(name) for pattern in (NAME, SECONDS, TICKS))


def _two_of_one_frame(pictures: Sequence[Picture], first: int, second: int, frame: int, where: Path) -> BadInput:
    """Return the error for two pictures of one frame: which they are, and which names are understood."""
    names = [
        picture.seen or picture.name or f"image {picture.number}" for picture in (pictures[first], pictures[second])
    ]
    hint = (
        "name a picture 000012 (its frame), 1305031102.175304 (its time) or with one number that differs; several "
        "masks of one picture lie in a folder of its name (000012/0.png, 000012/1.png)"
    )
    if pictures[first].name and pictures[first].name == pictures[second].name:
        hint = (
            f"both are {pictures[first].name!r}: give the folder of one kind of masks alone, without augmented copies"
        )
    return BadInput(f"{where}: masks of {names[0]!r} and {names[1]!r} are both of frame {frame}", hint=hint)


def numbers_in_names(names: Sequence[str]) -> list[int | None]:
    """Return the number in each name: of several groups of digits the one that varies, else the last; None: none."""
    groups = [[int(digits) for digits in re.findall(r"\d{1,18}", name, re.ASCII)] for name in names]
    columns = {len(row) for row in groups}
    if len(names) > 1 and len(columns) == 1 and groups[0]:
        varying = [k for k in range(len(groups[0])) if len({row[k] for row in groups}) > 1]
        if len(varying) == 1:
            return [row[varying[0]] for row in groups]
    return [row[-1] if row else None for row in groups]


def _frame_of(picture: Picture, number: int | None, times: np.ndarray, tolerance: float) -> tuple[int | None, str]:
    stamp = _stamp(picture)
    if stamp is not None:
        if not len(times):
            return None, WAYS[2]
        nearest = int(np.abs(times - stamp).argmin())
        return (nearest if abs(times[nearest] - stamp) <= tolerance + 1e-9 else None), WAYS[2]
    if NAME.fullmatch(picture.name):
        frame, matching = int(picture.name), WAYS[0]
    else:
        stated = picture.number if number is None else number
        frame, matching = (-1 if stated is None else stated), WAYS[1]
    return (frame if 0 <= frame < len(times) else None), matching


def _stamp(picture: Picture) -> float | None:
    if picture.time is not None:
        return picture.time
    if SECONDS.fullmatch(picture.name):
        return float(picture.name)
    if TICKS.fullmatch(picture.name):
        return int(picture.name) / 10 ** (len(picture.name) - 10)
    return None


def _stated_text(picture: Picture, number: int | None) -> str:
    stamp = _stamp(picture)
    stated = number if number is not None else picture.number
    return f"{stamp:.6f} s" if stamp is not None else "none" if stated is None else str(stated)
