"""The reasons of an artifact and of all that it was made from, by name."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from difflib import get_close_matches

from scenewright.cli.viewing.desk.generations import behind
from scenewright.schemas.artifact import Artifact
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.stages.kit.explaining.reason import Reason
from scenewright.stages.kit.explaining.sources import EXPLAINED, Source, name_as_later
from scenewright.stages.kit.explaining.sources import sentences as sentences_of

NEAREST = 5
"""Names that are offered in place of one that is not known."""


@dataclass(frozen=True)
class Explained:
    """What an artifact and its inputs record, the first made first."""

    artifact: Artifact
    sources: tuple[Source, ...]
    missing: tuple[str, ...]
    """Inputs that record reasons and are not at hand, a sentence each."""

    def names(self) -> list[str]:
        """Return what can be asked for, each name once, in the order in which it came up."""
        return list(dict.fromkeys(name for source in self.sources for name in source.reasons))

    def of(self, name: str) -> list[tuple[Artifact, list[Reason]]]:
        """Return the reasons of a name by artifact. Raises UsageError for an unknown name."""
        found = [(source.artifact, source.reasons[name]) for source in self.sources if name in source.reasons]
        if not found:
            names = self.names()
            near = get_close_matches(name, names, n=NEAREST, cutoff=0.5)
            hint = (
                f"the nearest: {', '.join(near)}"
                if near
                else f"scenewright explain {self.artifact.root} lists its names"
            )
            raise UsageError(f"{self.artifact.root}: has no {name!r:.80}", hint=hint)
        return found


def explain(artifact: Artifact) -> Explained:
    """Read the reasons of an artifact and of its inputs, as far as they are there still.

    Raises BadInput for a kind that records none, and for a payload of the artifact itself that cannot be read.
    """
    kinds = [kind for kind, _ in EXPLAINED]
    if not isinstance(artifact, tuple(kinds)):
        raise BadInput(
            f"{artifact.root}: a {artifact.kind!r} artifact records no reasons",
            hint=f"give one of {', '.join(kind.kind for kind in kinds)}",
        )
    sources: list[Source] = []
    missing: list[str] = []
    for kind, reasons_of in EXPLAINED:
        nearest = next(behind(artifact, kind), None)
        if nearest is None:
            continue
        try:
            sources.append(Source(nearest, reasons_of(nearest)))
        except BadInput as error:
            if nearest is artifact:
                raise
            missing.append(str(error))
    name_as_later(sources)
    return Explained(artifact, tuple(sources), (*missing, *_gone(sources)))


def sentences(artifact: Artifact) -> dict[str, list[str]]:
    """Return by name what is said of it, for a page; nothing where the artifact, or its kind, says nothing."""
    try:
        explained = explain(artifact)
    except BadInput:
        return {}
    return sentences_of(explained.sources)


def _gone(sources: list[Source]) -> Iterator[str]:
    """Yield which inputs that record reasons are not at hand."""
    there = {source.artifact.kind for source in sources}
    explained = {kind.kind for kind, _ in EXPLAINED}
    for source in sources:
        for record in () if source.artifact.manifest is None else source.artifact.manifest.inputs:
            if record.kind in explained - there:
                place = os.path.normpath(source.artifact.root / record.path)
                yield f"{place}: the {record.kind} is not there, or was made anew: what it records is left out"
