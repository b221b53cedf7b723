"""Drawing cases: commands and options out of their declarations, edits out of what the files hold. A seed, a case."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from enum import Enum
from functools import cache
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin

import numpy as np
from scenewright.schemas.artifact import KINDS, Artifact
from scenewright.schemas.manifest import MANIFEST_NAME
from scenewright.stages.engine.discovery import all_stages
from scenewright.stages.kit.stage import External, Optionally, Stage

from tests.fuzz.commands.base import FOREIGN, names_of, place_of
from tests.fuzz.commands.case import Case, Edit
from tests.fuzz.commands.values import FLOATS, INTEGERS, STRINGS, any_value, instead_of

UNREACHED = frozenset({"openai", "service", "huggingface", "ray", "slurm", "fast-downward"})
"""Values of options that would look for something outside of this machine, or for another program."""
FOREIGN_ROLES: dict[str, tuple[str, ...]] = {
    "log": ("@truth/log.mcap", "@stereo/log.mcap", "@tum", "@scan", "@sequence"),
    "from_mesh": ("@scan/points.npz", "@scenenn", "@map/mesh.ply", "@scan"),
    "labels": ("@settings/labels.toml", "@settings/words.txt"),
    "models": ("@models", "@models/crate", "@models/desk", "@models/stool", "@models/ball", "@models/lamp"),
    "mapping": ("@mapping/mapping.toml",),
    "problem": ("@packing/problem.json", "@packing/instance.json"),
    "transcript": ("@packing/transcript.jsonl",),
    "masks": ("@masks", "@stacks", "@eyes"),
    "image": ("@table", "@table/color.png", "@table/left.png"),
    "depth": ("@table/depth.png", "@table/depth.npz"),
    "camera": ("@table/camera.json", "@table/scene.json"),
    "annotation": ("@supports/supports.json", "@scenenn/011.xml"),
    "mesh": ("@scenenn/011.ply",),
    "perception": ("@settings/perception.toml",),
    "sidecar": ("@settings/config.toml",),
}
"""Inputs from outside: what of the base can be given."""
TEXTS = (".tum", ".urdf", ".xml", ".srdf", ".pddl", ".toml", ".txt", ".csv", ".obj", ".mtl")
PLACES = (f"{'@'}settings/config.toml", "@nothing", "@report", "/dev/null", "/dev/zero", "", "x" * 300, "@map/mesh.ply")
"""Paths that are no artifact of the kind that is asked for."""
WEIGHTS = {
    **{
        "run": 0.1,
        "batch": 0.15,
        "report": 0.6,
        "plan": 0.3,
        "cad": 0.25,
        "urdf": 0.7,
        "urdf-settle": 0.4,
        "suture simulate": 0.4,
    },
    **{"suture needle": 0.4, "suture thread": 0.5, "synthesize": 0.3, "pack": 0.5, "doctor": 0.05, "schemas": 0.1},
    **{
        "tableware plan": 0.6,
        "tableware simulate": 0.5,
        "tableware evaluate": 0.4,
        "convert-weights": 0.2,
        "view": 0.2,
    },
    **{
        "tableware scene": 0.15,
        "suture scene": 0.1,
        "graph": 0.7,
        "makefile": 0.3,
        "models": 0.3,
        "library build": 0.2,
    },
}
"""How often commands are drawn that take long, or take little from outside; else 1."""


USUAL = {
    "synthesize": "--frames 2 --width 96 --height 72 --clutter low",
    "library build": "--classes cup --classes table --shapes-per-class 1 --small-shapes-per-class 1",
    "tableware simulate": "--image-width 300",
    "tableware plan": "--image-width 300 --draws 2",
    "tableware evaluate": "--tier tier2 --scenes 1 --draws 1",
    "plan": "--image-width 64 --video-rate 0",
    "pack": "--image-width 240",
}
"""Options that keep a step small; later ones win over them."""


def draw_case(seed: int, base: Path) -> Case:
    """Return the case of a seed."""
    rng = random.Random(seed)
    names, weights = zip(*((name, WEIGHTS.get(name, 1.0)) for name in commands()), strict=True)
    name = rng.choices(names, weights)[0]
    words, long = commands()[name](name, rng, base)
    return Case(tuple(words), tuple(_edits(words, rng, base)), long)


@cache
def commands() -> dict[str, Callable[[str, random.Random, Path], tuple[list[str], bool]]]:
    """Return every command: its name -> what draws its words."""
    others = dict.fromkeys(_housekeeping(), _other_command)
    return {**dict.fromkeys(all_stages(), _step_command), **others}


@cache
def _housekeeping() -> dict[str, Any]:
    """Return the commands that are no steps: name -> click's command. `demo` is `run demo` and takes minutes."""
    import typer
    from scenewright.cli import housekeeping

    application = typer.Typer()
    for function, _ in housekeeping.COMMANDS:
        if function is not housekeeping.demo:
            application.command()(function)
    for name, alone, _, _ in housekeeping.GROUPS:
        application.command(name=name)(alone)
    return dict(typer.main.get_command(application).commands)  # type: ignore[attr-defined]


# ---- steps


def _step_command(name: str, rng: random.Random, base: Path) -> tuple[list[str], bool]:
    stage = all_stages()[name]
    words = name.split()
    for role, declared in stage.reads.items():
        what = declared.what if isinstance(declared, Optionally) else declared
        usual = {"report": 0.5, "evaluate": 0.6}.get(name, 0.35)
        if isinstance(declared, Optionally) and rng.random() > usual and role not in _needed(name, rng):
            continue
        words += [f"--{role.replace('_', '-')}", _input(role, what, rng, base)]
    words += USUAL.get(name, "").split()
    extra, long = _options(stage, rng)
    words += extra
    words += ["--out", "@out" if rng.random() < 0.97 else f"@out/{rng.choice(STRINGS)}".replace("\0", "")]
    if rng.random() < 0.2:
        words += ["--seed", str(rng.choice((0, 1, 7, 2**31 - 1, 2**32, 2**63 - 1, 1, 2, 3, 2**64, -1)))]
    for flag, share in (("--json", 0.3), ("--quiet", 0.2), ("--dry-run", 0.04), ("--force", 0.05)):
        words += [flag] if rng.random() < share else []
    return [word.encode("utf-8", "replace").decode().replace("\0", "") for word in words], long


def _needed(name: str, rng: random.Random) -> tuple[str, ...]:
    """Return roles that are optional by themselves, and without which a step has little to do."""
    choices: dict[str, tuple[tuple[str, ...], ...]] = {
        "fuse": (("sequence", "segments"), ("sequence", "segments"), ("from_mesh",)),
        "tableware detect": (("image",),),
        "tableware plan": (("detections",), ("scene",)),
        "suture evaluate": (("trials",), ("scene", "needle")),
        "pack": ((), ("problem",)),
        "library add": (("models",),),
    }
    return rng.choice(choices[name]) if name in choices else ()


def _input(role: str, what: type[Artifact] | External, rng: random.Random, base: Path) -> str:
    if rng.random() < 0.04:
        return rng.choice(PLACES)
    if isinstance(what, External):
        return rng.choice(FOREIGN_ROLES.get(role, PLACES))
    fitting = [name for name, kind in kinds_of(base).items() if issubclass(KINDS[kind], what)]
    return f"@{rng.choice(fitting)}" if fitting and rng.random() < 0.96 else f"@{rng.choice(list(kinds_of(base)))}"


@cache
def kinds_of(base: Path) -> dict[str, str]:
    """Return the kind of every base artifact by name."""
    found = {}
    for name in names_of(base):
        manifest = place_of(base, name) / MANIFEST_NAME
        if manifest.exists():
            found[name] = json.loads(manifest.read_text())["kind"]
    return found


def _options(stage: Stage, rng: random.Random) -> tuple[list[str], bool]:
    """Draw options in range, at the edge and a step beyond; whether they may ask for more work than usual."""
    words, long = [], False
    fields = stage.parameters.model_fields
    beyond = rng.random() < 0.12
    for name, field in fields.items():
        if rng.random() > min(1.0, 1.6 / len(fields)) and not (name == "backend" and rng.random() < 0.7):
            continue
        flag = f"--{name.replace('_', '-')}"
        bare = _bare(field.annotation)
        default = field.get_default(call_default_factory=True)
        bounds = {
            key: getattr(entry, key)
            for entry in field.metadata
            for key in ("ge", "gt", "le", "lt")
            if hasattr(entry, key)
        }
        if bare is bool:
            words.append(flag if rng.random() < 0.5 else f"--no-{flag[2:]}")
            continue
        values = _values_of(bare, default, bounds, rng, beyond)
        for value in values:
            words += [flag, value]
        long = long or _asks_for_more(bare, default, values)
    return words, long


def _bare(annotation: Any) -> Any:
    if get_origin(annotation) in (Union, UnionType):
        return next(item for item in get_args(annotation) if item is not NoneType)
    return annotation


def _values_of(bare: Any, default: Any, bounds: dict[str, Any], rng: random.Random, beyond: bool) -> list[str]:
    if get_origin(bare) is Literal:
        return [rng.choice([str(v) for v in get_args(bare) if v not in UNREACHED] + ["nonsense"] * beyond)]
    if isinstance(bare, type) and issubclass(bare, Enum):
        return [rng.choice([str(item.value) for item in bare])]
    if get_origin(bare) is tuple:
        inner = get_args(bare)[0]
        usual = [str(v) for v in default] if isinstance(default, tuple) and default else ["chair"]
        drawn = [
            rng.choice(usual) if rng.random() < 0.7 else _values_of(inner, None, {}, rng, beyond)[0] for _ in range(3)
        ]
        return drawn[: rng.randint(1, 3)]
    if bare in (int, float):
        return [_number(bare, default, bounds, rng, beyond)]
    known = (str(default), "geometric", "ground-truth", "network", "objects", "masks", "chair", "floor")
    return [rng.choice(STRINGS if beyond else known)]


def _number(bare: type, default: Any, bounds: dict[str, Any], rng: random.Random, beyond: bool) -> str:
    low, high = bounds.get("ge", bounds.get("gt")), bounds.get("le", bounds.get("lt"))
    step = 1 if bare is int else 1e-9
    edges: list[float] = [value for value in (low, high) if value is not None]
    edges += [value + step for value in edges] + [value - step for value in edges]
    if isinstance(default, int | float) and not isinstance(default, bool):
        edges += [default, default / 2 if bare is float else default // 2, 2 * default, 0]
    if rng.random() < 0.25 or not edges:
        edges = list(INTEGERS if bare is int else FLOATS)
    if not beyond and bare is int and isinstance(default, int) and rng.random() < 0.6:
        bounds = {**bounds, "le": min(default, bounds.get("le", default))}
    if not beyond:
        edges = [value for value in edges if _within(value, bounds)] or edges
    value = rng.choice(edges)
    return repr(int(value) if bare is int and value == value and abs(value) < 1e300 else float(value))


def _within(value: float, bounds: dict[str, Any]) -> bool:
    return (
        abs(value) < float("inf")
        and value >= bounds.get("ge", value)
        and value <= bounds.get("le", value)
        and ("gt" not in bounds or value > bounds["gt"])
        and ("lt" not in bounds or value < bounds["lt"])
    )


def _asks_for_more(bare: Any, default: Any, values: list[str]) -> bool:
    if bare is int and isinstance(default, int):
        return any(int(value) > default for value in values)
    if bare is float and isinstance(default, int | float):
        return any(float(value) != default for value in values)
    return bare not in (int, float)


# ---- other commands


def _other_command(name: str, rng: random.Random, base: Path) -> tuple[list[str], bool]:
    words = [name]
    for parameter in _housekeeping()[name].params:
        if parameter.name in ("help", "debug"):
            continue
        needed = parameter.required or parameter.param_type_name == "argument"
        needed = needed or (name, parameter.name) == ("view", "save")  # without it, it serves until it is interrupted
        if not needed and rng.random() > 0.25:
            continue
        if name == "run" and parameter.name == "dry_run" or name == "batch" and parameter.name == "dry_run":
            continue
        if parameter.param_type_name == "argument":
            words += [
                _argument(name, parameter.name, rng, base)
                for _ in range(rng.choice((1, 1, 2)) if parameter.nargs < 0 else 1)
            ]
        elif parameter.is_flag:
            words.append(rng.choice([option for option in parameter.opts if option.startswith("--")]))
        else:
            words += [max(parameter.opts, key=len), _option_value(name, parameter, rng, base)]
    if name in ("run", "batch") and rng.random() < 0.9:
        words.append("--dry-run")
    return [word.encode("utf-8", "replace").decode().replace("\0", "") for word in words], name in ("run", "batch")


def _argument(command: str, name: str, rng: random.Random, base: Path) -> str:
    if rng.random() < 0.06:
        return rng.choice((*PLACES, *STRINGS))
    whole = [f"@{entry}" for entry in kinds_of(base)]
    if command in ("run", "makefile"):
        return rng.choice(("demo", "reconstruct", "@settings/chain.toml", "@settings/chain.toml"))
    if command == "batch":
        return "@settings/batch.toml"
    if command == "urdf-check":
        return rng.choice(("@urdf/scene.urdf", "@urdf/static.urdf", "@cad/models", "@truth/room/scene.urdf"))
    if command == "urdf-settle":
        return rng.choice(("@urdf", "@truth/room", "@urdf"))
    if command == "timeline":
        return "@graph"
    if command == "convert-weights":
        return rng.choice(("@settings/config.toml", "@table/color.png", "@map/counts.npz"))
    if command == "inspect":
        logs = [option for option in FOREIGN_ROLES["log"]]
        return rng.choice((*whole, *logs, *logs))
    if command == "gc":
        return rng.choice(("@", *whole))
    if command == "diff":
        return rng.choice(("@graph", "@map", "@sequence", "@cad", "@urdf", *whole))
    return rng.choice(whole)


def _option_value(command: str, parameter: Any, rng: random.Random, base: Path) -> str:
    kind = _bare(parameter.type_descriptor.annotation)
    kind = _bare(get_args(kind)[0]) if get_origin(kind) is list else kind
    name = parameter.name
    if name == "out":
        return "@out"
    if name in ("save", "html"):
        return rng.choice(("@out.rrd", "@out.html", "@out", "@nothing/x.html"))
    if name == "settings":
        return rng.choice(
            (
                "frames=3",
                "voxel_size=0.1",
                "log=@truth/log.mcap",
                "seed=1",
                "every=0",
                "depth_scale=nan",
                "x",
                "=",
                "a=b",
            )
        )
    if name in ("add", "check", "root"):
        return rng.choice(("@settings/config.toml", "@table/color.png", "@urdf", "@nothing"))
    if get_origin(kind) is Literal:
        return rng.choice([*get_args(kind), "nonsense"])
    if kind is int:
        return str(rng.choice(INTEGERS)) if rng.random() < 0.3 else str(rng.choice((0, 1, 2, 3, 10)))
    if kind is float:
        return repr(rng.choice(FLOATS)) if rng.random() < 0.5 else repr(rng.choice((0.0, 0.1, 1.0, 3.0)))
    if kind is Path:
        return rng.choice(("@graph", "@out", "@nothing"))
    return rng.choice((*STRINGS, "ok", "empty", "4GiB", "made", "fuse"))


# ---- edits


def _edits(words: list[str], rng: random.Random, base: Path) -> list[Edit]:
    places = [word[1:].partition("/") for word in words if word.startswith("@") and not word.startswith("@out")]
    targets = [(name, inside) for name, _, inside in places if name and place_of(base, name).is_dir()]
    if not targets:
        return []
    edits: list[Edit] = []
    for _ in range(rng.choice((0, 1, 1, 1, 1, 2, 2, 3))):
        name, inside = rng.choice(targets)
        files = files_of(base, name)
        if inside in files and rng.random() < 0.8:
            chosen = inside
        else:
            inner = [file for file in files if file.startswith(inside)] or files
            chosen = rng.choices(inner, [_importance(file) for file in inner])[0]
        edit = _edit(name, chosen, rng, base)
        if edit is not None:
            edits.append(edit)
    return edits


@cache
def files_of(base: Path, name: str) -> list[str]:
    """Return the files of a base artifact or of a thing from outside."""
    folder = place_of(base, name)
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


def _importance(file: str) -> float:
    """Files of documents are few, and decide more than one of many meshes does."""
    if file in ("timings.json", "report.html"):
        return 0.2
    depth = file.count("/")
    return (4.0 if file.endswith(".json") else 3.0) if depth == 0 else 0.6 / (1 + depth)


def _edit(name: str, file: str, rng: random.Random, base: Path) -> Edit | None:
    path = place_of(base, name) / file
    if rng.random() < 0.05:
        how, arguments = rng.choice(
            (
                ("cut", (rng.choice((0.0, 0.1, 0.5, 0.9, 0.999)),)),
                ("flip", (rng.randrange(2**31), rng.randrange(256))),
                ("remove", ()),
                ("content", (rng.choice(("", "{}", "[]", "null", "\0", "nan", "<a/>", "0")),)),
            )
        )
        return Edit(name, file, how, arguments)
    if rng.random() < 0.04:
        others = [other for other in files_of(base, name) if other != file and Path(other).suffix == path.suffix]
        if others:
            return Edit(name, file, "swap", (rng.choice(others),))
    drawer = _DRAWERS.get(path.suffix) or (_text if path.suffix in TEXTS else _bytes)
    if path.name in ("frames.mcap", "log.mcap"):
        drawer = _frames
    if path.name == "panoptic.zip":
        drawer = _masks
    drawn = drawer(path, rng)
    return None if drawn is None else Edit(name, file, *drawn)


Drawn = tuple[str, tuple[Any, ...]] | None


@cache
def _document(path: Path) -> Any:
    return json.loads(path.read_text())


def _json(path: Path, rng: random.Random) -> Drawn:
    try:
        document = _document(path)
    except ValueError:
        return _bytes(path, rng)
    place, value = _somewhere(document, rng)
    if not place:
        return "content", (json.dumps(any_value(rng)),)
    kind = rng.random()
    if kind < 0.08:
        return "delete", (place,)
    if kind < 0.13:
        holder = place[:-1] if rng.random() < 0.5 else place
        return "add", (holder, rng.choice(STRINGS), any_value(rng))
    if kind < 0.2 and isinstance(value, list):
        return "times", (place, rng.choice((2, 3, 10_000)))
    texts = names_within(path)
    if kind < 0.3 and texts:
        return "rename", (rng.choice(texts), rng.choice(STRINGS))
    if kind < 0.36 and texts:
        return "clone", ("name", rng.choice(texts), rng.choice((1, 30, 1000)))
    if isinstance(value, str) and texts and rng.random() < 0.5:
        return "put", (place, rng.choice(texts))  # dangling, cyclic, named twice
    return "put", (place, instead_of(value, rng))


def _somewhere(document: Any, rng: random.Random) -> tuple[list[Any], Any]:
    """Return a place in a document, and what stands there."""
    place: list[Any] = []
    value = document
    while isinstance(value, dict | list) and value and not (place and rng.random() < 0.12):
        part = rng.choice(list(value)) if isinstance(value, dict) else rng.randrange(len(value))
        place.append(part)
        value = value[part]
    return place, value


@cache
def names_within(path: Path) -> list[str]:
    """Return names that occur in a document more than once: of nodes, links, joints, models, classes."""
    counts: dict[str, int] = {}
    waiting = [_document(path)]
    while waiting:
        value = waiting.pop()
        if isinstance(value, dict | list):
            waiting += value.values() if isinstance(value, dict) else value
        elif isinstance(value, str):
            counts[value] = counts.get(value, 0) + 1
    return sorted(name for name, count in counts.items() if count > 1)


@cache
def _arrays(path: Path) -> dict[str, int]:
    with np.load(path, allow_pickle=False) as archive:
        return {name: archive[name].size for name in archive.files}


def _array(path: Path, rng: random.Random) -> Drawn:
    name, size = rng.choice(list(_arrays(path).items())) if path.suffix == ".npz" else ("", 1000)
    if rng.random() < 0.5:
        value = rng.choice((*INTEGERS, *FLOATS))
        return "array", (name, rng.choice(("all", "one", "some")), value, rng.randrange(max(size, 1)))
    what = rng.choice(
        ("none", "half", "first", "twice", "backwards", "square", "transposed", "flat", "deep", "kind", "gone")
    )
    return "array", (name, what, 0, rng.randrange(10))


def _text(path: Path, rng: random.Random) -> Drawn:
    kind = rng.random()
    if kind < 0.5:
        return "number", (rng.randrange(2**31), repr(rng.choice((*FLOATS, *INTEGERS))))
    if kind < 0.7:
        return "attribute", (rng.randrange(2**31), rng.choice(STRINGS))
    if kind < 0.78 and path.suffix in (".urdf", ".xml"):
        return "rename", (
            rng.choice(("table", "floor", "scene", "world", "body", "revolute", "fixed", "mesh")),
            rng.choice(STRINGS),
        )
    return "line", (rng.randrange(2**31), rng.choice(("drop", "repeat", "first", "many")))


def _mesh(path: Path, rng: random.Random) -> Drawn:
    if path.suffix == ".obj" and rng.random() < 0.4:
        return _text(path, rng)
    kinds = ("empty", "points", "one", "same", "flat", "line", "put", "scale", "shift", "many", "inside_out", "twice")
    return "mesh", (
        rng.choice(kinds),
        rng.choice((0, 1, 2, -1.0, 1e-9, 1e3, 1e9, 1e20, 3e38, float("nan"), float("inf"))),
    )


def _picture(path: Path, rng: random.Random) -> Drawn:
    return "picture", (
        rng.choice(("black", "white", "noise", "dot", "row", "half", "turned", "gray", "deep", "large")),
    )


def _frames(path: Path, rng: random.Random) -> Drawn:
    kinds = (
        *("none", "one", "far", "poses", "no_poses", "no_color", "no_depth", "no_labels", "depth", "black", "labels"),
        *("noise", "focal", "center", "small", "late"),
    )
    return "frames", (rng.choice(kinds), rng.choice((0.0, 1e-9, 0.001, 1.0, -1.0, 60.0, 1e4, 1e9, 1e20, 65535.0)))


def _masks(path: Path, rng: random.Random) -> Drawn:
    kinds = ("put", "none", "first", "shift", "small", "noise")
    return "masks", (rng.choice(kinds), rng.choice((0, 1, 255, 65535, 2**24 - 1, 1000)))


def _bytes(path: Path, rng: random.Random) -> Drawn:
    return rng.choice((("cut", (rng.random(),)), ("flip", (rng.randrange(2**31), rng.randrange(256)))))


_DRAWERS: dict[str, Callable[[Path, random.Random], Drawn]] = {
    **{".json": _json, ".npz": _array, ".npy": _array, ".png": _picture, ".jpg": _picture},
    **{".ply": _mesh, ".obj": _mesh, ".glb": _mesh, ".stl": _mesh},
}
__all__ = ["FOREIGN", "commands", "draw_case"]
