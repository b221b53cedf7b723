"""Backend `masks`: which folder of masks this is, which frame each belongs to, and their classes."""

from __future__ import annotations

import logging
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.declared import declared_in
from scenewright.stages.kit.formats.frames import Frame
from scenewright.stages.kit.geometry.cameras import seen_by
from scenewright.stages.kit.labels import ANYTHING, Label, LabelSet, match_labels, read_label_file
from scenewright.stages.segment.backends.masks import MasksParameters
from scenewright.stages.segment.backends.masks.given import GivenFrame, MaskFormat, MaskSource, ReadSettings
from scenewright.stages.segment.backends.masks.listing import HINT, Listing
from scenewright.stages.segment.backends.masks.log_names import log_names
from scenewright.stages.segment.backends.masks.matching import WAYS, match_pictures
from scenewright.stages.segment.backends.masks.unread import kinds_of_files, way_of
from scenewright.stages.segment.choice import BackendRequest
from scenewright.stages.segment.geometric import GeometricFrame, pixels_at
from scenewright.stages.segment.naming import NamedSegment, name_segments
from scenewright.stages.segment.panoptic import PanopticFrame

UNCLASSED = Label(name=ANYTHING, class_name=ANYTHING)
"""What masks without a class are: things that nobody named."""

logger = logging.getLogger("scenewright")


@dataclass
class Tally:
    """What was left out or changed on the way, over all frames."""

    overlapping: int = 0
    frames: int = 0
    """In which masks overlapped."""
    faint: int = 0
    empty: int = 0
    ignored_frames: int = 0


class MasksBackend:
    """Masks of a folder. Raises BadInput when it is of no known format, its masks are of frames
    that are not there, or nothing says what its categories are."""

    name = "masks"
    streams: tuple[str, ...] = ("depth",)

    def __init__(self, request: BackendRequest) -> None:
        sequence, reader = request.log()
        assert request.masks is not None  # segment.parameters.check
        options = request.own(MasksParameters)
        self._root, self._reader = request.masks, reader
        label_set = read_label_file(request.labels) if request.labels else None
        numbered = {label.id: label.name for label in label_set.labels if label.id is not None} if label_set else {}
        listing = Listing(request.masks, numbered)
        form, self._source = open_folder(listing)
        times, own = reader.times, sequence.sources
        matching = match_pictures(
            self._source.pictures,
            times if own is None else own.times_beside(times),
            options.masks_tolerance,
            self._root,
            log_names(own),
            options.masks_named_like,
        )
        self._places = matching.places
        matches_text = ", ".join(f"{matching.ways[way]} by {way}" for way in WAYS if matching.ways[way]) or "none"
        for warning in matching.warnings:
            logger.warning("%s: %s", self._root, warning)
        logger.info(
            "%s: %s, masks of %d of %d frames: %s", self._root, form.name, len(self._places), len(times), matches_text
        )
        if not self._places:
            raise BadInput(f"{self._root}: holds masks of no frame", hint=HINT)
        if len(self._places) < len(times):
            first = next(index for index in range(len(times)) if index not in self._places)
            logger.warning(
                "%s: %d of %d frames have no masks, the first is %d; they add geometry alone",
                self._root,
                len(times) - len(self._places),
                len(times),
                first,
            )
        if self._source.lacks:
            lost = " and ".join(self._source.lacks)
            logger.info("%s: holds no %s: what the network said of them is lost", self._root, lost)
        self._labels = _labels(self._source, label_set, str(self._root))
        if not self._labels:
            logger.info("%s: says no classes (classes.json would): every mask is an object", self._root)
        self._vocabulary = load_vocabulary()
        stuff = {entry.name for entry in self._vocabulary.classes if entry.kind == "stuff"}
        self._behind = frozenset(number for number, label in self._labels.items() if label.class_name in stuff)
        self._settings = request.parameters.score_threshold, request.parameters.small_object_pixels
        self._tally, self._last = Tally(), max(self._places)
        self.label = f"masks of {options.masks_model or self._root.resolve().stem}"

    def __call__(self, frame: Frame, geometric: GeometricFrame, random: np.random.Generator) -> PanopticFrame:
        """Return the masks of a frame; a frame that the folder has none for has none. Raises BadInput."""
        height, width = geometric.labels.shape
        picture_index = self._places.get(frame.index)
        if picture_index is None:
            return PanopticFrame(np.zeros((height, width), dtype=np.int32))
        least = pixels_at(self._settings[1], (height, width))
        try:
            masks = self._read(picture_index, (height, width), frame.camera_name)
            segments = {number: segment for number, segment in self._named_segments(masks)}
        except BadInput as error:
            raise BadInput(f"frame {frame.index}: {error.message}", hint=error.hint) from None
        self._count(masks)
        if frame.index == self._last:
            self._report()
        # Small numbers in the same order, as those of a service: tables over ids stay small.
        numbers = sorted(set(np.unique(masks.ids).tolist()) - {0})
        ids = np.searchsorted(np.array([0, *numbers]), masks.ids).astype(np.int32)
        listed = {k: segments[number] for k, number in enumerate(numbers, start=1) if number in segments}
        return name_segments(ids, listed, self._vocabulary, minimum_pixels=least)

    def _read(self, picture_index: int, shape: tuple[int, int], camera_name: str) -> GivenFrame:
        """Return masks of the frame's size, or those of its full picture brought to it. Raises BadInput."""

        def masks_of(size: tuple[int, int]) -> GivenFrame:
            settings = ReadSettings(self._settings[0], pixels_at(self._settings[1], size), self._behind)
            return self._source.read(picture_index, size, settings)

        picture = self._reader.picture_cameras.get(camera_name)
        try:
            return masks_of(shape)
        except BadInput:
            if picture is None:
                raise
            with suppress(BadInput):
                full = masks_of((picture.height, picture.width))
                return replace(full, ids=seen_by(full.ids, picture, self._reader.cameras[camera_name]))
            raise

    def _named_segments(self, frame_masks: GivenFrame) -> list[tuple[int, NamedSegment]]:
        segments = []
        for number, mask in frame_masks.masks.items():
            if mask.category is None:
                segments.append((number, NamedSegment(UNCLASSED, mask.score)))
                continue
            if mask.category not in self._source.categories and mask.category not in self._labels:
                raise BadInput(
                    f"{self._root}: nothing says what category {mask.category} is",
                    hint="list it among the categories or in classes.json, or all of them with their ids in "
                    "--labels FILE.toml",
                )
            if mask.category in self._labels:
                segments.append((number, NamedSegment(self._labels[mask.category], mask.score)))
        return segments

    def _count(self, frame_masks: GivenFrame) -> None:
        self._tally.overlapping += frame_masks.overlapping
        self._tally.frames += frame_masks.overlapping > 0
        self._tally.faint += frame_masks.faint
        self._tally.empty += frame_masks.empty
        self._tally.ignored_frames += frame_masks.ignored > 0

    def _report(self) -> None:
        if self._tally.overlapping:
            logger.warning(
                "%s: masks overlap in %d frames: of equal ones the best scored was kept, smaller ones lie over larger "
                "ones; %d masks lost pixels or all of them",
                self._root,
                self._tally.frames,
                self._tally.overlapping,
            )
        if self._tally.faint:
            logger.info(
                "%s: %d masks score under --score-threshold %g and were left out",
                self._root,
                self._tally.faint,
                self._settings[0],
            )

        if self._tally.empty:
            logger.warning(
                "%s: annotations without a mask (a box, a line, `segmentation: []`) or a pixel, left out: %d",
                self._root,
                self._tally.empty,
            )
        if self._tally.ignored_frames:
            logger.info(
                "%s: 255 (of 16 bits also 65535) is in no list of classes and was taken for no mask in %d frames",
                self._root,
                self._tally.ignored_frames,
            )


def open_folder(listing: Listing) -> tuple[MaskFormat, MaskSource]:
    """Return the format of a folder and its masks. Raises BadInput when it is of none, or broken."""
    formats = declared_in(
        "scenewright.stages.segment.backends.masks.formats", MaskFormat, "FORMAT", "scenewright.mask_formats"
    )
    for form in formats:
        source = form.open(listing)
        if source is not None:
            return form, source
    format_list = "; ".join(f"{form.name} ({form.summary})" for form in formats)
    raise BadInput(
        f"{listing.root}: holds no masks that are read here ({kinds_of_files(listing)})",
        hint=way_of(listing) or f"formats: {format_list}",
    )


def _labels(source: MaskSource, label_set: LabelSet | None, where: str) -> dict[int, Label]:
    """Return number -> label."""
    if not source.categories:
        return {}
    matched = match_labels(
        {number: category.name for number, category in source.categories.items()}, label_set, where=where
    )
    if matched.unknown:
        logger.warning(
            "%s: %d of its categories are in no table and stay void: %s",
            where,
            len(matched.unknown),
            ", ".join(matched.unknown[:10]),
        )
    labels = {}
    for number, label in matched.labels.items():
        thing = source.categories[number].is_thing
        kind = label.kind if thing is None else "thing" if thing else "stuff"
        labels[number] = label.model_copy(update={"kind": kind})
    return labels


def open_backend(request: BackendRequest) -> MasksBackend:
    """Return the backend that the request asks for. Raises as the class does, and BadInput for damaged labels."""
    return MasksBackend(request)
