"""Masks find their frames by the names that the log gave its pictures, before any number in them counts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.schemas.sequence import FrameSources
from scenewright.stages.segment.backends.masks.given import Picture, stem_of
from scenewright.stages.segment.backends.masks.log_names import log_names
from scenewright.stages.segment.backends.masks.matching import Matching, match_pictures

COUNT = 12
OTHER_WAY = "their numbers are those of other frames"


def sources(pattern: str, first: int = 1, every: int = 1) -> FrameSources:
    """Pictures of a log of COUNT frames, numbered from `first`, of which every `every`-th is in the sequence."""
    names = [pattern.format(first + k) for k in range(COUNT)]
    kept = names[::every]
    return FrameSources(color=tuple(kept), left_out=tuple(name for name in names if name not in kept))


def match(names: list[str], own: FrameSources | None, **options: str) -> Matching:
    frames = COUNT if own is None else len(own.color)
    pictures = [Picture(stem_of(f"{name}.png")) for name in names]
    return match_pictures(pictures, np.arange(frames) / 30, 0.02, Path("m"), log_names(own), **options)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("pictures", "masks"),
    [
        ("images/frame_{:05d}.jpg", "frame_{:05d}"),
        ("images/frame_{:05d}.jpg", "frame_{:05d}.jpg"),  # as COLMAP names them
        ("frame_{:05d}.jpg", "frame_{:05d}_mask"),
        ("frame_{}.png", "frame_{:05d}"),
        ("rgb/{:06d}.png", "{:06d}"),
        ("frame-{:06d}.color.png", "frame-{:06d}"),
        ("color/{}.jpg", "mask_{}"),
        ("image/image{:05d}.png", "{:05d}"),
    ],
)
def test_the_log_s_names_go_first(pictures: str, masks: str) -> None:
    matching = match([masks.format(k) for k in range(1, COUNT)], sources(pictures))  # the last one has no mask
    assert matching.places == {k: k for k in range(COUNT - 1)}
    assert matching.ways == {"the log's own name": COUNT - 1}
    assert len(matching.warnings) == 1 and OTHER_WAY in matching.warnings[0]


def test_masks_of_pictures_that_were_left_out_are_passed_over() -> None:
    matching = match([f"frame_{k:05d}" for k in range(1, COUNT + 1)], sources("frame_{:05d}.jpg", every=3))
    assert matching.places == {0: 0, 1: 3, 2: 6, 3: 9} and not matching.warnings


def test_stamps_that_are_names_are_those_of_the_pictures() -> None:
    own = FrameSources(color=("rgb/10.000.png", "rgb/10.030.png"), depth=("d/10.016.png", "d/10.046.png"))
    pictures = [Picture("10.000"), Picture("10.030")]
    matching = match_pictures(pictures, np.array([10.016, 10.046]), 0.02, Path("m"), log_names(own))
    assert matching.places == {0: 0, 1: 1}  # 10.030 is nearer to the depth of the first


def test_stamped_masks_of_all_frames_serve_some_of_them() -> None:
    pictures = [Picture(f"{k / 10:.3f}") for k in range(11)]
    matching = match_pictures(pictures, np.array([[0.0], [0.5], [1.0]]), 0.02, Path("m"))
    assert matching.places == {0: 0, 1: 5, 2: 10} and "8 masks are of times" in matching.warnings[0]
    with pytest.raises(BadInput, match="outside the sequence"):  # a frame without a mask: another clock, perhaps
        match_pictures(pictures[:-1], np.array([[0.0], [0.5], [1.0]]), 0.02, Path("m"))


def test_numbers_count_when_no_name_is_the_log_s() -> None:
    own = sources("frame_{:05d}.jpg")
    assert match([f"{k:06d}" for k in range(COUNT)], own).ways == {"name": COUNT}
    late = match([f"m_{k}" for k in range(1, COUNT)], None)
    assert late.places == {k + 1: k for k in range(COUNT - 1)} and "begin at 1" in late.warnings[0]


def test_names_of_an_export_are_not_those_of_a_log() -> None:
    matching = match([f"frame_{k:06d}" for k in range(1, COUNT)], sources("frame_{:05d}.png"))
    assert matching.places == {k: k - 1 for k in range(1, COUNT)} and matching.ways == {"number": COUNT - 1}


def test_masks_counted_from_0_for_pictures_counted_from_1() -> None:
    names = [f"frame_{k:05d}" for k in range(COUNT)]
    matching = match(names, sources("frame_{:05d}.jpg"))
    assert matching.places == {k: k for k in range(COUNT)} and "'frame_00000' is of no image" in matching.warnings[0]
    by_name = match(names, sources("frame_{:05d}.jpg"), named_like="log")
    assert by_name.places == {k: k + 1 for k in range(COUNT - 1)} and "left out: frame_00000" in by_name.warnings[0]


def test_names_that_may_be_either_are_refused_and_both_options_work() -> None:
    own = FrameSources(color=tuple(f"frame_{2 * k:04d}.png" for k in range(COUNT)))  # a part of a longer recording
    names = [f"frame_{k:04d}" for k in range(COUNT)]
    with pytest.raises(BadInput, match="'frame_0001' is not") as caught:
        match(names, own)
    assert "--masks-named-like log, or --masks-named-like sequence" in str(caught.value)
    assert match(names, own, named_like="log").places == {k: 2 * k for k in range(COUNT // 2)}
    assert match(names, own, named_like="sequence").places == {k: k for k in range(COUNT)}


def test_a_name_of_two_frames_is_none() -> None:
    own = FrameSources(color=("left/0001.png", "right/0001.png", "left/0002.png"))
    assert match(["0002"], own).places == {2: 0}
    assert match(["0001"], own).ways == {"number": 1}
