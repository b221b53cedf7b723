"""Which frame the masks of a picture belong to: by its name in the log, its number or its time stamp."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.segment.backends.masks.given import Picture
from scenewright.stages.segment.backends.masks.log_names import LEFT_OUT, NAME, LogNames

SECONDS = re.compile(r"\d{1,10}\.\d+", re.ASCII)
TICKS = re.compile(r"\d{13,19}", re.ASCII)
"""Milliseconds to nanoseconds since 1970, by their number of digits."""
LATEST = 1e11
"""A stated time beyond this is no number of seconds since 1970, but of milli-, micro- or nanoseconds."""
OF_THE_LOG, NUMBER, STAMP = "the log's own name", "number", "time stamp"
WAYS = (OF_THE_LOG, "name", NUMBER, STAMP)
"""How a picture may be matched to a frame."""
SHOWN = 3
"""Pictures without a frame that an error names."""
NO_NAMES = LogNames()
NamedLike = Literal["auto", "log", "sequence"]


@dataclass(frozen=True)
class Matching:
    """Which masks belong to which frame."""

    places: dict[int, int]
    """Frame -> place of its picture."""
    ways: Counter[str]
    """How many were found in each of WAYS."""
    warnings: tuple[str, ...] = ()
    """What may be meant otherwise, for people."""


@dataclass(frozen=True)
class _Found:
    frame: int | None
    way: str
    stated: str = ""
    """What the way went by, for people."""


def match_pictures(
    pictures: Sequence[Picture],
    times: np.ndarray,
    tolerance: float,
    where: Path,
    names: LogNames = NO_NAMES,
    named_like: NamedLike = "auto",
) -> Matching:
    """Return which frame the masks of each picture are of. times (N,) or (N, 2) of the frames [s]: several of a frame
    count alike.

    A stated time goes first, then the name that the log has for a picture. Only when no mask has such a name, or with
    `named_like` sequence, a name of six to nine digits is that of a frame in every artifact (`000012`);
    `1305031102.175304` is a time [s], thirteen digits and more are milli-, micro- or nanoseconds. Else the number that
    a picture is given, or the one in its name that differs from picture to picture, counts the frames of the sequence
    from 0. Raises BadInput when a picture belongs to no frame, or two to one, and when some names are the log's while
    all may be numbers of frames.
    """
    times = np.asarray(times, dtype=float).reshape(len(times), -1)
    numbers = numbers_in_names([picture.name for picture in pictures])
    counted = [_frame_of(picture, number, times, tolerance) for picture, number in zip(pictures, numbers, strict=True)]
    by_log = [_of_log(picture, names) for picture in pictures]
    if named_like == "log" and not any(by_log):
        raise BadInput(f"{where}: no mask is named like an image of the log", hint="leave out --masks-named-like")
    if named_like == "sequence" or not any(by_log):
        return _placed(pictures, counted, times, where, _counting_from_one(counted))
    strangers = [k for k, found in enumerate(by_log) if found is None and counted[k].way != STAMP]
    named = [found or other for found, other in zip(by_log, counted, strict=True)]
    warnings: list[str] = []
    if named_like == "auto" and _both_fit(named, counted):
        if strangers and not names.gapless:
            raise BadInput(
                f"{where}: {len(pictures) - len(strangers)} of {len(pictures)} masks are named like images of the "
                f"log, {pictures[strangers[0]].name!r} is not; their numbers are those of other frames",
                hint="say which: --masks-named-like log, or --masks-named-like sequence",
            )
        if strangers:  # the log has every picture from its first to its last, and this is none of them
            warnings.append(
                f"mask {pictures[strangers[0]].name!r} is of no image of the log: the numbers of all masks count the "
                "frames of the sequence from 0 (--masks-named-like log goes by the log's names)"
            )
            return _placed(pictures, counted, times, where, warnings)
        warnings.append(
            "masks go by the names of the log's images; their numbers are those of other frames of the sequence "
            "(--masks-named-like sequence goes by numbers)"
        )
    if strangers:
        shown = ", ".join(pictures[k].name or "image" for k in strangers[:SHOWN])
        warnings.append(f"{len(strangers)} masks are of no image of the log and left out: {shown}")
    kept = [k for k, found in enumerate(named) if k not in strangers and found.frame != LEFT_OUT]
    matching = _placed([pictures[k] for k in kept], [named[k] for k in kept], times, where, warnings)
    return replace(matching, places={frame: kept[place] for frame, place in matching.places.items()})


def _both_fit(named: Sequence[_Found], counted: Sequence[_Found]) -> bool:
    """Whether all masks may go by their numbers too, and would be of other frames then."""
    frames = [found.frame for found in counted]
    unique = None not in frames and len(set(frames)) == len(frames)
    return unique and frames != [found.frame for found in named]


def _placed(
    pictures: Sequence[Picture], found: Sequence[_Found], times: np.ndarray, where: Path, warnings: Sequence[str]
) -> Matching:
    """Return the matching of pictures whose frames were found. Masks of times between frames are left out where every
    frame has its own: somebody made them for all of the log. Raises BadInput for other masks of no frame, and for two
    of one frame."""
    picture_of_frame: dict[int, int] = {}
    match_counts: Counter[str] = Counter()
    astray: list[str] = []
    only_stamps = True
    for index, (picture, place) in enumerate(zip(pictures, found, strict=True)):
        if place.frame is None:
            astray.append(f"{picture.name or 'image'} ({place.way} {place.stated})")
            only_stamps &= place.way == STAMP
            continue
        if place.frame in picture_of_frame:
            raise _two_of_one_frame(pictures, picture_of_frame[place.frame], index, place.frame, where)
        picture_of_frame[place.frame] = index
        match_counts[place.way] += 1
    if astray and only_stamps and len(picture_of_frame) == len(times) and len(times):
        left_out = f"{len(astray)} masks are of times at which the sequence has no frame, and are left out"
        return Matching(picture_of_frame, match_counts, (*warnings, left_out))
    if astray:
        astray_text = ", ".join(astray[:SHOWN]) + (", ..." if len(astray) > SHOWN else "")
        raise BadInput(
            f"{where}: {len(astray)} of {len(pictures)} masks are of frames outside the sequence: {astray_text}",
            hint=f"name masks by frames, 0 to {len(times) - 1}, by times, {times.min():.6f} to {times.max():.6f} s, or "
            "like the log's images"
            if len(times)
            else "the sequence is empty",
        )
    return Matching(picture_of_frame, match_counts, tuple(warnings))


def _of_log(picture: Picture, names: LogNames) -> _Found | None:
    frame = None if picture.time is not None else names.frame_of(picture.name)
    return None if frame is None else _Found(frame, OF_THE_LOG, picture.name)


def _counting_from_one(counted: Sequence[_Found]) -> list[str]:
    """A warning where masks that go by numbers have a 1 and no 0, as those do that count pictures from 1."""
    frames = {found.frame for found in counted if found.way == NUMBER and found.frame is not None}
    if min(frames, default=0) != 1:
        return []
    return [
        "numbers in the masks' names begin at 1, and frames of the sequence at 0: if they count images from 1, each "
        "mask is one frame late; name them by time stamp then"
    ]


def says_a_frame(name: str) -> bool:
    """Return whether a name alone says which frame it is of, as six digits and stamps do."""
    return any(pattern.fullmatch(name) for pattern in (NAME, SECONDS, TICKS))


def _two_of_one_frame(pictures: Sequence[Picture], first: int, second: int, frame: int, where: Path) -> BadInput:
    """Return the error for two pictures of one frame: which they are, and which names are understood."""
    names = [
        picture.seen or picture.name or f"image {picture.number}" for picture in (pictures[first], pictures[second])
    ]
    hint = (
        "name an image 000012 (its frame), 1305031102.175304 (its time) or with one number that differs; several "
        "masks of one image lie in a folder of its name (000012/0.png, 000012/1.png)"
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


def _frame_of(picture: Picture, number: int | None, times: np.ndarray, tolerance: float) -> _Found:
    stamp = _stamp(picture)
    if stamp is not None:
        if not len(times):
            return _Found(None, STAMP, f"{stamp:.6f} s")
        distances = np.abs(times - stamp).min(axis=1)
        nearest = int(distances.argmin())
        return _Found(nearest if distances[nearest] <= tolerance + 1e-9 else None, STAMP, f"{stamp:.6f} s")
    if NAME.fullmatch(picture.name):
        stated, way = int(picture.name), "name"
    else:
        given = picture.number if number is None else number
        stated, way = (-1 if given is None else given), NUMBER
    return _Found(stated if 0 <= stated < len(times) else None, way, "none" if stated < 0 else str(stated))


def _stamp(picture: Picture) -> float | None:
    if picture.time is not None:
        time = picture.time
        while time >= LATEST:
            time /= 1000
        return time
    if SECONDS.fullmatch(picture.name):
        return float(picture.name)
    if TICKS.fullmatch(picture.name):
        return int(picture.name) / 10 ** (len(picture.name) - 10)
    return None
