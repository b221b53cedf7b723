"""Kind `cutting_model`: types of fragments, rules and networks learned from demonstrations of cutting."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field, model_validator
from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Model, Vector3

TypeNumber = Annotated[int, Field(ge=0, lt=64)]


class CuttingRule(Model):
    """A piece of a type cut across an axis of its own (0 the shortest) into two types, ascending; how often."""

    parent: TypeNumber
    axis: int = Field(ge=0, le=2)
    children: tuple[TypeNumber, TypeNumber]
    seen: int = Field(ge=1)


class FragmentType(Model):
    """A Gaussian over logarithms of edges, shortest first, of the box with a fragment's moments; edges in metres."""

    mean: Vector3
    deviation: Vector3
    share: float = Field(gt=0.0, le=1.0)
    named: tuple[int, int, int, int]
    """Fragments of this type that were left in the end as chunks, slices, strips, cubes."""


class CuttingGrammar(Model):
    """What `ours` learned."""

    types: tuple[FragmentType, ...] = Field(min_length=1, max_length=64)
    rules: tuple[CuttingRule, ...] = Field(min_length=1)
    ratios: tuple[tuple[tuple[float, float], tuple[float, float]], ...] = Field(min_length=4, max_length=4)
    """Of chunks, slices, strips, cubes: mean and deviation of the logarithms of edge over next shorter edge."""
    scatter: tuple[float, float, float, float]
    """Deviation of logarithms of edges and volume among fragments that were meant to be alike."""
    bits: float
    """Description length of the demonstrations."""

    @model_validator(mode="after")
    def _rules_name_types(self) -> CuttingGrammar:
        count = len(self.types)
        if any(max(rule.parent, *rule.children) >= count for rule in self.rules):
            raise ValueError(f"a rule names a type beyond {count - 1}")
        deviations = [d for kind in self.types for d in kind.deviation] + [d for _, pair in self.ratios for d in pair]
        if min(*deviations, *self.scatter) <= 0.0:
            raise ValueError("a deviation is not positive")
        return self


class ThesisProduction(Model):
    """alpha -> beta (Han 2024, section 6.2)."""

    left: TypeNumber
    right: tuple[TypeNumber, ...] = Field(min_length=2)
    chance: float = Field(gt=0.0, le=1.0)


class CuttingModelFile(Model):
    """model.json."""

    trials: int = Field(ge=1)
    """That were learned from."""
    unfinished: int = Field(ge=0)
    """Of these: they teach cuts, but not what is wanted."""
    pieces: int
    cuts: int
    grammar: CuttingGrammar
    thesis: tuple[ThesisProduction, ...] = ()
    """The thesis's productions; its networks stand in networks.safetensors."""
    methods: tuple[str, ...]
    statement: str


class CuttingModel(Artifact):
    """`model.json`; `networks.safetensors` with the networks of the thesis's method and its rivals, where they were
    asked for."""

    kind: ClassVar[str] = "cutting_model"
    description: ClassVar[str] = "what was learned of cutting"
    info = Document(CuttingModelFile, "model.json")
