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
AND = "+"
"""Between the names of backends of which each judges every frame."""
RUNTIMES = ("onnxruntime", "ai-edge-litert")
"""What runs networks given as files: one given with --weights, or the semantic one beside it."""
LITERT = Extra(
    "ai-edge-litert", "ai_edge_litert", "segment with a .tflite network: pip install ai-edge-litert (make extras)"
)


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
    endings: tuple[str, ...] = ()
    """Of those, how the names of files end that it can run; empty: it does not go by the name."""
    takes: frozenset[Literal["tiles", "semantic_weights"]] = frozenset()
    """Common options and inputs that say something to it."""
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
    of_pictures: bool = False
    """Whether its masks come of the picture alone, whatever its size: it is shown full pictures where there are any."""
    address: str = ""
    """How an http address reads that is given in place of the name; empty: it goes by its name."""
    nameless: bool = False
    """Whether it gives no masks, by design: geometric segments are all that is asked of it."""

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


def backends_for(backend: str) -> tuple[BackendDeclaration, ...]:
    """Return what `--backend` asks for, `a+b` for several that judge every frame. Raises ValueError as `backend_for`
    does, and for one that is asked for twice."""
    names = backend.split(AND)
    if len(names) > 1 and AUTO in names:
        raise ValueError(f"`{AUTO}` is one backend; name those that are to be used together")
    if len(set(names)) < len(names):
        raise ValueError("names a backend twice; several networks of one backend are a folder of --weights")
    return tuple(backend_for(name) for name in names)


def automatic(weights: Path | None) -> BackendDeclaration:
    """Return the backend that `auto` takes with these weights, or with none: a detector taught on photographs before
    our own network, which was taught in generated rooms."""
    if weights is None or weights.suffix == ".safetensors":
        return backend_for(AUTO)
    return backend_for("tflite" if weights.suffix == ".tflite" else "detector")


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
    return AND.join(
        check_address(name, form=declared.address) if declared.address else name
        for name, declared in zip(backend.split(AND), backends_for(backend), strict=True)
    )


def backend_help() -> str:
    """Return the names and what stands behind each, for the help of `--backend`."""
    summaries = [f"`{declared.name}`: {declared.summary}" for declared in all_backends() if not declared.address]
    addresses = [f"or {declared.address}" for declared in all_backends() if declared.address]
    unasked = (
        f"`{AUTO}`: `detector` where --weights is an ONNX file or the cache of models has yolox_nano (`scenewright "
        f"models`), `tflite` where they are a .tflite file, else what needs nothing: `{backend_for(AUTO).name}`"
    )
    several = "`a+b`: each of them, and what they agree on"
    return "; ".join([*summaries, unasked, several, *addresses])


def weights_help() -> str:
    """Return what `--weights` is to the backends that take some."""
    takers: dict[str, list[str]] = {}
    for declared in all_backends():
        if declared.weights:
            takers.setdefault(declared.weights, []).append(declared.name)
    return "; ".join(f"{weights} ({', '.join(names)})" for weights, names in takers.items())


def data_files(parameters: Any) -> tuple[str, ...]:
    """Return the files of data/ that the backend of the parameters reads."""
    backends = _may_run(parameters.backend)
    return tuple(dict.fromkeys(file for declared in backends for file in declared.data_files(parameters)))


def versions(parameters: Any) -> dict[str, str]:
    """Return name -> version of what decides the masks beside the code and the step's libraries.

    Raises MissingDependency or BadInput when a backend has to ask for that and is not answered.
    """
    backends = _may_run(parameters.backend)
    found = {name: library_version(name) for declared in backends for name in declared.libraries}
    for declared in backends:
        if declared.versions:
            found |= declared.load(declared.versions).versions(parameters)
    return found


def _may_run(backend: str) -> tuple[BackendDeclaration, ...]:
    """Return what `--backend` may come to, before the weights are known."""
    return tuple(map(backend_for, (AUTO, "detector", "tflite"))) if backend == AUTO else backends_for(backend)
