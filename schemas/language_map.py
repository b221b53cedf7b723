"""Kinds `language_map` and `answers`: places of a room that words find, and what was found."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field
from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Count, Model, Vector3
from scenewright.schemas.scene_parts import Box


class LanguageRegion(Model):
    """A piece of a splat, or an entity of a panoptic map."""

    instance: int = 0
    """Instance label of an entity, or of the one that a piece of a splat belongs to; 0: of none."""
    class_name: str = ""
    """Class of that entity."""
    box: Box
    """Of a piece of a thing that a map knows, the thing's."""
    point: Vector3 | None = Field(default=None, exclude_if=lambda point: point is None)
    """Of an entity: the point of its surface nearest the median of that [m]; an answer points there."""
    looks: Count
    """Pieces of pictures that its vector is the mean of; 0: no picture shows it, and no word finds it by them."""
    names: dict[str, float] = Field(default_factory=dict, exclude_if=lambda names: not names)
    """Class -> posterior by the map's evidence; what is missing to 1 is for none of them. Absent without a map."""
    seen: float = Field(default=0.0, exclude_if=lambda seen: not seen)
    """In how many images the map saw that entity; absent where that is not known."""
    said: float = Field(default=0.0, exclude_if=lambda said: not said)
    """In how many of them masks gave it its class (sum of scores)."""
    colors: dict[str, float] = Field(default_factory=dict, exclude_if=lambda colors: not colors)
    """Name of a colour -> share of its surface; absent without a map."""


class LanguageMapFile(Model):
    """language.json."""

    source: Literal["splat", "panoptic_map"]
    encoder: str
    """Label of the encoder whose vectors these are."""
    width: int = Field(ge=1, le=65536)
    sizes: tuple[float, ...]
    """At which the field was asked for every Gaussian, ascending [m]; none for a map."""
    gaussians: Count
    steps: Count
    """Of training the field."""
    loss: float
    """Mean over its last fifty steps."""
    regions: tuple[LanguageRegion, ...]


class LanguageMap(Artifact):
    """`language.json` and `vectors.npz`: `regions` (R, width) float16, unit vectors of what pictures show of each
    region; of a splat also `means` (N, 3) float32 [m], `opacities` (N,) float32, `vectors` (N, sizes, width) float16,
    the field at every Gaussian, and `pieces` (granularities, N) int32, the region of every Gaussian, fine to coarse, -1
    none (a map has N = 0)."""

    kind: ClassVar[str] = "language_map"
    description: ClassVar[str] = "places of a room with vectors that open words find"
    info = Document(LanguageMapFile, "language.json")


class Answer(Model):
    """One place that fits a text, the likeliest first."""

    region: int
    """Number of the region in the language map."""
    probability: float = Field(ge=0, le=1)
    """That it is what was asked for."""
    relevancy: float = Field(ge=0, le=1)
    """Of what pictures show of it (LERF)."""
    field_relevancy: float | None = Field(default=None, ge=0, le=1)
    """Mean over its Gaussians, each at its best size; None of a map."""
    size: float | None = None
    """Size at which the field fits best [m]; None of a map."""
    instance: int = 0
    node: str = ""
    """Node of the contact graph, where one was given."""
    other: str = ""
    """Node that it stands on, in or beside, where the words say so."""
    doubtful: bool = Field(default=False, exclude_if=lambda doubtful: not doubtful)
    """Whether it rests on one name that few images gave, or that is little likelier than others."""
    place: Vector3 | None = None
    """On it, where its box has nothing in the middle; None in files of before."""
    box: Box
    gaussians: Count


class AnswersFile(Model):
    """answers.json."""

    text: str
    encoder: str
    calibrated: bool
    """Whether probabilities were fitted to right and wrong answers of this encoder; else they are relevancies."""
    recognised: float | None = None
    """How alike what pictures show and the nearest names are, on the mean (cosine); None: not looked at."""
    strange: bool = False
    """Whether that is so little that probabilities are small for whatever is asked."""
    least_probability: float
    understood: str = Field(default="", exclude_if=lambda line: not line)
    """What of the text was understood, and what not, in a line."""
    unread: tuple[str, ...]
    """Words that the encoder is known never to have read."""
    relation: str = ""
    """What the words say of two things, where a contact graph was asked."""
    answers: tuple[Answer, ...]
    next_best: Answer | None = None
    """The likeliest place below the least probability."""


class Answers(Artifact):
    """`answers.json`, and `masks.npz`: `gaussians` (K,) int32, those of all answers one after another, `starts`
    (answers + 1,) int64. Outcomes where nothing is as likely as was asked for: `absent`, or
    `unknown` when the encoder never read a word of the text or has learned no such pictures."""

    kind: ClassVar[str] = "answers"
    description: ClassVar[str] = "places of a room that fit a text, with probabilities"
    info = Document(AnswersFile, "answers.json")
