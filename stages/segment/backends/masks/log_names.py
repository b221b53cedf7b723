"""The names that a log gave its pictures, and which of them a mask is named like."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from scenewright.schemas.sequence import FrameSources
from scenewright.stages.segment.backends.masks.given import stem_of

NAME = re.compile(r"\d{6,9}", re.ASCII)
"""A frame's name in artifacts: its number in the sequence with six digits."""
WORDS = re.compile(r"[^\W\d_]+|\d{1,18}")
OF_NO_MATTER = {
    *("color", "colour", "rgb", "depth", "left", "right", "image", "img", "mask", "masks", "seg", "segmentation"),
    *("panoptic", "instance", "instances", "semantic", "label", "labels"),
    *("jpg", "jpeg", "png", "bmp", "tif", "tiff", "ppm", "pgm", "webp", "npy"),
}
"""Words that say what a picture shows, or end its name, and not which picture it is."""
LEFT_OUT = -1
"""In place of a frame: a picture of the log whose frame is not in the sequence."""


@dataclass(frozen=True)
class LogNames:
    """Names of a log's pictures -> frame, LEFT_OUT for pictures without one. What two frames share is no name."""

    files: Mapping[str, int] = field(default_factory=dict)
    """By file name: COLMAP calls a mask `picture.jpg.png`."""
    stems: Mapping[str, int] = field(default_factory=dict)
    words: Mapping[str, int] = field(default_factory=dict)
    """By what is left without the words of no matter: `frame_0007_mask` is of `frame_7.color.png`."""
    gapless: bool = False
    """Whether the numbers in the names follow each other: then the log lists every picture that there was."""

    def frame_of(self, name: str) -> int | None:
        """Return the frame of the picture that a mask called `name` (without folder and ending) is of: LEFT_OUT when
        the sequence has none for it, None when it is no picture of the log."""
        for names in (self.files, self.stems):
            if name in names:
                return names[name]
        return None if NAME.fullmatch(name) else self.words.get(_words_of(name))


def log_names(sources: FrameSources | None) -> LogNames:
    """Return the names that the log gave the pictures of a sequence; without sources there are none."""
    if sources is None:
        return LogNames()
    depths = [(name, frame) for frame, name in enumerate(sources.depth) if name is not None]
    pictures = [(name, frame) for frame, name in enumerate(sources.color) if name is not None]
    pictures += [(name, LEFT_OUT) for name in sources.left_out]
    files, stems, words = (
        {**_by_form(depths, form), **_by_form(pictures, form)} for form in (_file_of, stem_of, _words_of)
    )
    return LogNames(files, stems, words, _are_gapless(name for name, _ in pictures or depths))


def _file_of(name: str) -> str:
    return name.rsplit("/", 1)[-1]


def _words_of(name: str) -> str:
    """Return the words of a name that tell pictures apart. Leading zeros do not, but in numbers of six digits and more,
    which artifacts and exports have: `frame_000007` of an export is not the log's `frame_00007`."""
    words = [word for word in WORDS.findall(_file_of(name).lower()) if word not in OF_NO_MATTER]
    return " ".join(str(int(word)) if word.isdecimal() and len(word) < 6 else word for word in words)


def _by_form(pictures: Iterable[tuple[str, int]], form: Callable[[str], str]) -> dict[str, int]:
    """Return form of a name -> frame, without the forms that two frames share."""
    frames: dict[str, int] = {}
    shared = {""}
    for name, frame in pictures:
        if frames.setdefault(form(name), frame) != frame:
            shared.add(form(name))
    return {key: frame for key, frame in frames.items() if key not in shared}


def _are_gapless(names: Iterable[str]) -> bool:
    numbers = [int(found[-1]) for name in names if (found := re.findall(r"\d{1,18}", stem_of(name), re.ASCII))]
    return bool(numbers) and len(set(numbers)) == len(numbers) == max(numbers) - min(numbers) + 1
