"""Which backend names the masks. A backend is loaded only when it is chosen: some need what others do without."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.sequence import Sequence
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.segment.full_pictures import OnFullPictures
from scenewright.stages.segment.panoptic import Backend
from scenewright.stages.segment.parameters import SegmentParameters
from scenewright.stages.segment.registry import AUTO, BackendDeclaration, all_backends, automatic, backends_for
from scenewright.stages.segment.several import SeveralBackends

STREAM_WORDS = {"color": "colour", "labels": "ground-truth labels"}
"""What a missing stream of the sequence is called in messages."""

Own = TypeVar("Own", bound=Parameters)

logger = logging.getLogger("scenewright")


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


def chosen_backends(request: BackendRequest) -> tuple[BackendDeclaration, ...]:
    """Return the declarations of the backends that the parameters ask for. Raises ValueError for a name of none."""
    if request.parameters.backend == AUTO:
        return (automatic(request.weights),)
    return backends_for(request.parameters.backend)


def choose_backend(request: BackendRequest) -> Backend:
    """Return the backend that the parameters ask for; of several, or of a folder of weights, all of them as one.

    Raises UsageError, BadInput or MissingDependency. Of several networks those that cannot be used are left out, each
    with a warning, as long as one is left.
    """
    chosen = chosen_backends(request)
    _refuse_options_of_others(request, chosen)
    if request.sequence is not None:
        for declared in chosen:
            _require_streams(request.sequence, declared)
    asked = list(_requests(request, chosen))
    opened: list[Backend] = []
    for position, (declared, part) in enumerate(asked):
        try:
            backend = declared.load("backend").open_backend(part)
            shown = declared.of_pictures and request.reader is not None and "picture" in request.reader.streams
            opened.append(OnFullPictures(backend, request.reader) if shown and request.reader else backend)
        except BadInput as error:
            if position == len(asked) - 1 and not opened:
                raise
            logger.warning("left out, the other networks go on: %s", error.message)
    return opened[0] if len(opened) == 1 else SeveralBackends(request.parameters.backend, opened)


def _requests(
    request: BackendRequest, chosen: tuple[BackendDeclaration, ...]
) -> Iterator[tuple[BackendDeclaration, BackendRequest]]:
    """Yield what each backend is asked for: of a folder of weights one request for each file that it can run, with the
    sidecar that lies beside it; of one file, that file where it can. Semantic weights go to the first that takes them.

    A network of the folder that none of them runs is said. Raises UsageError for two that go by one ending, BadInput
    for weights that nobody can run.
    """
    weights, semantic = request.weights, request.semantic_weights
    by_ending = [declared for declared in chosen if declared.endings]
    endings = [ending for declared in by_ending for ending in declared.endings]
    if weights is not None and len(set(endings)) < len(endings):
        ending = next(ending for ending in endings if endings.count(ending) > 1)
        names = " and ".join(declared.name for declared in by_ending if ending in declared.endings)
        raise UsageError(f"{names} take files of one ending: {ending}", hint="name one of them")
    in_folder = weights is not None and weights.is_dir() and bool(by_ending)
    files = sorted(weights.iterdir()) if in_folder and weights is not None else [weights] if weights else []
    runnable = {file for file in files if file.suffix in endings}
    if in_folder and request.sidecar is not None:
        raise UsageError("--sidecar is for one network", hint=f"lay NAME.toml beside NAME{endings[0]} in the folder")
    if in_folder and not runnable:
        raise BadInput(f"{weights}: holds no network", hint=f"its files end with {', '.join(endings)}")
    known = {ending for declared in all_backends() for ending in declared.endings}
    for other in files if in_folder else ():
        if other.suffix in known and other not in runnable:
            logger.warning("%s: no backend that was asked for runs it", other.name)
    all_by_ending = all(declared.endings or not declared.weights for declared in chosen)
    if len(chosen) > 1 and by_ending and all_by_ending and files and not runnable:
        raise BadInput(
            f"{files[0].name}: none of {', '.join(declared.name for declared in chosen)} can run it",
            hint=f"their files end with {', '.join(endings)}",
        )
    for declared in chosen:
        own = semantic if "semantic_weights" in declared.takes else None
        semantic = None if own is not None else semantic
        mine: list[Path | None] = [weights]
        if declared.endings and (in_folder or len(chosen) > 1):
            mine = [file for file in sorted(runnable) if file.suffix in declared.endings] or [None]
        for position, file in enumerate(mine):
            beside = file.with_suffix(".toml") if in_folder and file is not None else None
            sidecar = beside if beside is not None and beside.is_file() else request.sidecar
            yield (
                declared,
                replace(request, weights=file, semantic_weights=own if position == 0 else None, sidecar=sidecar),
            )


def _refuse_options_of_others(request: BackendRequest, chosen: tuple[BackendDeclaration, ...]) -> None:
    parameters, names = request.parameters, {declared.name for declared in chosen}
    for declared in all_backends():
        for option in declared.exclusive:
            is_set = getattr(parameters, option) != type(parameters).model_fields[option].default
            if is_set and declared.name not in names:
                raise UsageError(
                    f"--{option.replace('_', '-')} is for --backend {declared.name} alone",
                    hint="leave it out, or choose that backend",
                )
    given = {"tiles": parameters.tiles is not None, "semantic_weights": request.semantic_weights is not None}
    for option, is_given in given.items():
        if is_given and not any(option in declared.takes for declared in chosen):
            takers = [declared.name for declared in all_backends() if option in declared.takes]
            raise UsageError(
                f"--{option.replace('_', '-')} is for --backend {', '.join(takers)}",
                hint="leave it out, or choose that backend",
            )


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
