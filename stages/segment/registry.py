"""The backends of `segment`, found in `backends/`, and what each says of itself before it is loaded. Cheap."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

from scenewright.stages.kit.declared import Found, found_in, load_beside, module_of
from scenewright.stages.kit.library_versions import library_version
from scenewright.stages.kit.services.address import check_address
from scenewright.stages.kit.stage import Extra, Parameters

AUTO = "auto"


def _nothing(parameters: Any) -> tuple[str, ...]:
    return ()


@dataclass(frozen=True)
class BackendDeclaration:
    """A backend, as the `__init__.py` of its folder declares it under the name BACKEND.

    `backend.py` of that folder holds `open_backend(request: BackendRequest) -> Backend`; it is loaded when it is used.
    """

    name: str
    """What `--backend` calls it; its folder has `_` where this has `-`."""
    summary: str
    """Where its masks come from, for the help."""
    order: int
    """Its place in the help, and among those that `auto` may take."""
    automatic: bool = False
    """Whether `auto` may take it: nothing has to be installed, given, or known of the log."""
    needs: frozenset[Literal["color", "labels"]] = frozenset()
    """Streams without which it sees nothing in a sequence."""
    weights: str = ""
    """What `--weights` is to it, for the help; empty: it takes none."""
    parameters: type[Parameters] | None = None
    """Options that are its own; they become options of `segment`."""
    exclusive: tuple[str, ...] = ()
    """Those of them that must not be given when another backend is asked for."""
    libraries: tuple[str, ...] = ()
    """Distributions whose versions decide its masks beside those of the step."""
    extras: tuple[Extra, ...] = ()
    """Those of them that do not come with the project."""
    data_files: Callable[[Any], tuple[str, ...]] = _nothing
    """Parameters -> files of data/ that it reads."""
    versions: str = ""
    """Module of its folder whose function `versions(parameters)` returns what else decides its masks, by name, as that
    of a step does (Stage.versions)."""
    apart: bool = False
    """Whether it judges a frame by that frame alone and needs little memory, so that frames may be segmented in
    processes of their own."""
    address: str = ""
    """How an http address reads that is given in place of the name; empty: it goes by its name."""

    def load(self, module: str) -> Any:
        """Return a module of its folder, loaded now: `backend` has `open_backend`."""
        return load_beside(module_of(_found(), self.name), module)


@cache
def _found() -> tuple[Found[BackendDeclaration], ...]:
    return found_in("scenewright.stages.segment.backends", BackendDeclaration, "BACKEND", "scenewright.backends")


@cache
def all_backends() -> tuple[BackendDeclaration, ...]:
    """Return every declared backend in its order. Imports declarations only."""
    return tuple(found.declaration for found in _found())


def backend_for(backend: str) -> BackendDeclaration:
    """Return what `--backend` asks for: a name, `auto`, or an address. Raises ValueError for anything else."""
    if backend == AUTO:
        return next(declared for declared in all_backends() if declared.automatic)
    by_address = backend.startswith(("http://", "https://"))
    for declared in all_backends():
        if bool(declared.address) == by_address and (by_address or declared.name == backend):
            return declared
    names = [declared.name for declared in all_backends() if not declared.address] + [AUTO]
    close = get_close_matches(backend, names, n=1)
    guess = f"did you mean {close[0]}? " if close else ""
    addresses = [declared.address for declared in all_backends() if declared.address]
    raise ValueError(f"no such backend; {guess}one of {', '.join((*names, *addresses))}")


def automatic(weights: Path | None) -> BackendDeclaration:
    """Return the backend that `auto` takes with these weights, or with none: a detector taught on photographs before
    our own network, which was taught in generated rooms."""
    without_detector = weights is None or weights.suffix == ".safetensors"
    return backend_for(AUTO if without_detector else "detector")


def usual_detector(parameters: Any, given: Mapping[str, Any]) -> str:
    """Return the known model that `auto` takes for a detector where the cache has it."""
    return "yolox_nano" if parameters.backend == AUTO else ""


def usual_witness(parameters: Any, given: Mapping[str, Any]) -> str:
    """Return the known model that `auto` takes as the detector's witness where the cache has it and it can be run."""
    detecting = "weights" in given and automatic(Path(given["weights"])).name == "detector"
    usable = parameters.backend == AUTO and detecting and find_spec("ai_edge_litert") is not None
    return "deeplab_voc" if usable else ""


def check_backend(backend: str) -> str:
    """Return the name of a backend, or an address without its closing slash. Raises ValueError."""
    declared = backend_for(backend)
    return check_address(backend, form=declared.address) if declared.address else backend


def backend_help() -> str:
    """Return the names and what stands behind each, for the help of `--backend`."""
    summaries = [f"`{declared.name}`: {declared.summary}" for declared in all_backends() if not declared.address]
    addresses = [f"or {declared.address}" for declared in all_backends() if declared.address]
    unasked = (
        f"`{AUTO}`: `detector` where --weights is an ONNX file or the cache of models has yolox_nano (`scenewright "
        f"models`), else what needs nothing: `{backend_for(AUTO).name}`"
    )
    return "; ".join([*summaries, unasked, *addresses])


def weights_help() -> str:
    """Return what `--weights` is to the backends that take some."""
    takers: dict[str, list[str]] = {}
    for declared in all_backends():
        if declared.weights:
            takers.setdefault(declared.weights, []).append(declared.name)
    return "; ".join(f"{weights} ({', '.join(names)})" for weights, names in takers.items())


def data_files(parameters: Any) -> tuple[str, ...]:
    """Return the files of data/ that the backend of the parameters reads."""
    return backend_for(parameters.backend).data_files(parameters)


def versions(parameters: Any) -> dict[str, str]:
    """Return name -> version of what decides the masks beside the code and the step's libraries.

    Raises MissingDependency or BadInput when a backend has to ask for that and is not answered.
    """
    declared = backend_for(parameters.backend)
    further: dict[str, str] = declared.load(declared.versions).versions(parameters) if declared.versions else {}
    backends = (declared, backend_for("detector")) if parameters.backend == AUTO else (declared,)
    return {name: library_version(name) for backend in backends for name in backend.libraries} | further
