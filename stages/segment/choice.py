"""Which backend names the masks. A backend is loaded only when it is chosen: some need what others do without."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.sequence import Sequence
from scenewright.stages.kit.formats.frames import Frame, FrameReader
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.segment.geometric import GeometricFrame
from scenewright.stages.segment.panoptic import PanopticFrame
from scenewright.stages.segment.parameters import SegmentParameters
from scenewright.stages.segment.registry import AUTO, BackendDeclaration, all_backends, automatic, backend_for

STREAM_WORDS = {"color": "colour", "labels": "ground-truth labels"}
"""What a missing stream of the sequence is called in messages."""

Own = TypeVar("Own", bound=Parameters)


class Backend(Protocol):
    """Names panoptic masks in a frame."""

    name: str
    label: str
    """Printed beside every figure that rests on these masks."""
    streams: tuple[str, ...]
    """Streams of the sequence it looks at."""

    def __call__(self, frame: Frame, geometric: GeometricFrame, random: np.random.Generator) -> PanopticFrame:
        """Return the masks of one frame."""
        ...


@dataclass(frozen=True)
class BackendRequest:
    """What a backend may be made of."""

    parameters: SegmentParameters
    weights: Path | None = None
    mask_weights: Path | None = None
    semantic_weights: Path | None = None
    labels: Path | None = None
    """Label table or list of words."""
    sidecar: Path | None = None
    masks: Path | None = None
    """Folder of masks."""
    device: str = "cpu"
    sequence: Sequence | None = None
    """The log, for backends that look at all of it; None when single frames are served (`models serve`)."""
    reader: FrameReader | None = None
    seed: int = 0
    ask_again: bool = False
    """Do not use what is kept of earlier runs (`--force`)."""

    def log(self) -> tuple[Sequence, FrameReader]:
        """Return the log. Raises UsageError when there is none."""
        if self.sequence is None or self.reader is None:
            raise UsageError(
                f"--backend {self.parameters.backend} looks at a whole log and cannot be served",
                hint="serve a backend that judges single frames",
            )
        return self.sequence, self.reader

    def own(self, kind: type[Own]) -> Own:
        """Return the parameters as those that a backend declared for itself."""
        assert isinstance(self.parameters, kind)
        return self.parameters


def fitting(request: BackendRequest) -> BackendRequest:
    """Return the request, without the weights of a detector where `auto` took them for a log that has no colour: our
    own network finds things by depth alone."""
    if request.parameters.backend != AUTO or request.sequence is None:
        return request
    missing = automatic(request.weights).needs - set(request.sequence.info.streams)
    return replace(request, weights=None, semantic_weights=None) if missing else request


def chosen_backend(request: BackendRequest) -> BackendDeclaration:
    """Return the declaration of the backend that the parameters ask for. Raises ValueError for a name of none."""
    if request.parameters.backend == AUTO:
        return automatic(request.weights)
    return backend_for(request.parameters.backend)


def choose_backend(request: BackendRequest) -> Backend:
    """Return the backend that the parameters ask for. Raises UsageError, BadInput or MissingDependency."""
    chosen = chosen_backend(request)
    _refuse_options_of_others(request.parameters, chosen)
    if request.sequence is not None:
        _require_streams(request.sequence, chosen)
    backend: Backend = chosen.load("backend").open_backend(request)
    return backend


def _refuse_options_of_others(parameters: SegmentParameters, chosen: BackendDeclaration) -> None:
    for declared in all_backends():
        for option in declared.exclusive:
            is_set = getattr(parameters, option) != type(parameters).model_fields[option].default
            if is_set and declared.name != chosen.name:
                raise UsageError(f"--{option.replace('_', '-')} is for --backend {declared.name} alone")


def _require_streams(sequence: Sequence, chosen: BackendDeclaration) -> None:
    missing = sorted(chosen.needs - set(sequence.info.streams))
    if missing:
        others = [
            declared.name for declared in all_backends() if missing[0] not in declared.needs and not declared.address
        ]
        raise BadInput(
            f"this sequence has no {STREAM_WORDS[missing[0]]} for --backend {chosen.name}",
            hint=f"use another --backend: {', '.join(others)}",
        )
