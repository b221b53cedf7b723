"""Kind `segments`: per-frame panoptic and geometric segments, fused (Han 2024, section 2.3.1)."""

from __future__ import annotations

from typing import ClassVar

from pydantic import ConfigDict, Field
from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Model


class Witness(Model):
    """What one of several networks said of a mask."""

    network: int
    """Its place in `networks` of segments.json."""
    class_id: int
    """Class id of data/vocabulary.toml."""
    score: float


class FrameSegment(Model):
    """One fused segment (P_k, c_k, o_k) of a frame: geometrically connected pixels with one panoptic label."""

    model_config = ConfigDict(validate_by_name=True, validate_by_alias=True, serialize_by_alias=True)

    id: int
    """Value in the frame's panoptic PNG (COCO: R + 256 G + 65536 B); 0 is void."""
    class_id: int = Field(validation_alias="category_id", serialization_alias="category_id")
    """Class id of data/vocabulary.toml; 0 = background (geometric segment without a label). `category_id` is COCO's
    name, which the file has."""
    instance: int
    """Instance o_k within the frame (the same number on all segments of one instance); 0 = background."""
    is_thing: bool
    score: float
    area: int
    """Pixels."""
    witnesses: tuple[Witness, ...] = Field(default=(), exclude_if=lambda witnesses: not witnesses)
    """What each network said, where several found this; class and score are the leading sum of theirs."""


class FrameSegments(Model):
    """The segments of one frame."""

    frame: int
    """Frame index in the sequence."""
    segments: tuple[FrameSegment, ...]


class SegmentsFile(Model):
    """segments.json: COCO-panoptic-like annotations for every frame, and the label source."""

    backend: str
    """Name of the backend (a folder of stages/segment/backends); `masks` also when a service gave them."""
    label: str
    """Name to print beside every figure, e.g. `ground-truth masks, corruption 0.2`."""
    corruption: float = 0.0
    recognised: float | None = None
    """Share of the area of masks of things that got a name, where `object` says that the segmenter did not recognise
    what it saw (our own network); None where `object` is a class like any other."""
    networks: tuple[str, ...] = Field(default=(), exclude_if=lambda networks: not networks)
    """The networks that `witnesses` number; empty: there was one."""
    width: int
    height: int
    frames: tuple[FrameSegments, ...]


class Segments(Artifact):
    """`segments.json`, `panoptic.zip` (stored, not deflated; `<frame:06d>.png` COCO panoptic PNGs of fused
    segment ids; stages/kit/formats/masks.py reads and writes it)."""

    kind: ClassVar[str] = "segments"
    description: ClassVar[str] = "per-frame fused panoptic and geometric segments"
    info = Document(SegmentsFile, "segments.json")
