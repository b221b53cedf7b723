"""What real segmenters get wrong on real frames, for the errors that are put into true masks.

python -m benchmarks.segmenter_rates --runs FOLDER_OF_MAKE_REAL --data DATA --out FOLDER

Truth are the annotated boxes of data/annotations/real: a pixel belongs to the smallest box around its point. Segmenters
are the detector (yolox_nano), the detector with DeepLab as its witness, and our own network. Of each annotated thing in
each frame it is told whether it was found, in one mask or in pieces, alone or with a neighbour, and under which name;
of each mask of a thing, whether it lies on none; and how alike the errors of a thing are in two frames from the same
region of views, and from two regions. Boxes are rough, so that a small overlap is enough. What lies in no box counts
for nothing. It writes data/errors/segmenters.toml (`segmenters.toml` in the folder).
"""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field
from scenewright.schemas.sequence import Sequence as SequenceArtifact
from scenewright.schemas.vocabulary import UNNAMED, load_vocabulary
from scenewright.stages.agent import PrintedEyes
from scenewright.stages.kit.acting.errors import view_region
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.segment.choice import BackendRequest, choose_backend
from scenewright.stages.segment.geometric import segment_depth
from scenewright.stages.segment.parameters import SegmentParameters
from scenewright.stages.segment.settings import geometric_settings
from scenewright.stages.truth.annotated_points import instances_of
from scenewright.stages.truth.support_annotation import SupportAnnotation, read_support_annotation

from benchmarks.board.real import ANNOTATIONS
from benchmarks.options import Recipe, asked
from benchmarks.results import write_figures
from benchmarks.steps import opened
from benchmarks.tabulation import Figure

STRIDE = 4
LEAST_PIXELS = 50
"""Of every 16th pixel that a thing must have in a frame."""
BOUNDARY = 2.4
"""**Assumed**: standard deviation of where masks end [pixels at a width of 640]."""
FOUND_IOU, MASK_ON_NOTHING, COVERED, PIECE, PIECE_INSIDE = 0.3, 0.1, 0.5, 0.15, 0.8
"""A thing is found by a mask of this overlap (over union); a mask that shares less than the second of itself with
things is a false one; a mask that covers the third of two things merges them; pieces are masks of at least the fourth
of a thing that lie in it to the fifth."""


ABOUT = {
    "title": "What real segmenters get wrong on real frames",
    "simulated": "Nothing, but the living room's images are rendered; things annotated by eye, with rough boxes.",
    "knows": "Colour, depth, camera and poses of three logs that thresholds of these segmenters were chosen on.",
    "does_not_show": "How often segmenters err in general: three logs, one annotator. A thing counts as found at an "
    "overlap of {all/rule/found_iou bare .1} with what lies in its rough box, and a mask that takes half of two boxes "
    "in merges them, so that missed and merged are too many rather than too few. Sights of one thing are no "
    "independent draws.",
}


class RateOptions(Recipe):
    """Options of the measurement."""

    runs: Path = Field(description="Folder that `make real` wrote (its sequences)")
    data: Path = Field(Path("../shared/data"), description="Folder with the networks of others")
    frames: int = Field(40, ge=2, description="Frames of every log, evenly spread")
    only: str | None = Field(None, description="One segmenter; its rates are put beside those that are there")


@dataclass(frozen=True)
class Seen:
    """What a segmenter made of one annotated thing in one frame."""

    thing: str
    class_name: str
    region: tuple[int, ...]
    outcome: str
    """found, missed, merged or split."""
    named: str | None
    """Class of its mask."""


def main() -> None:
    """Measure; write rates.json and segmenter_rates.json, in the form of docs/results."""
    options = asked(RateOptions)
    detectors = options.data / "detectors"
    weights = {"weights": detectors / "yolox_nano.onnx"}
    witness = {"semantic_weights": detectors / "deeplab_voc_tflite" / "deeplabv3_mnv2_pascal_quant.tflite"}
    segmenters: dict[str, tuple[str, Mapping[str, Path]]] = {
        "detector": ("detector", weights),
        "detector and DeepLab": ("detector", weights | witness),
        "our network": ("network", {}),
    }
    logs = [
        file.stem for file in sorted(ANNOTATIONS.glob("*.json")) if (options.runs / file.stem / "sequence").is_dir()
    ]
    options.out.mkdir(parents=True, exist_ok=True)
    file = options.out / "rates.json"
    made: dict[str, Any] = json.loads(file.read_text()) if options.only and file.is_file() else {}
    for name, (backend, files) in segmenters.items():
        if options.only not in (None, name):
            continue
        seen: list[Seen] = []
        false: list[int] = []
        names: Counter[str] = Counter()
        for log in logs:
            told = read_support_annotation(ANNOTATIONS / f"{log}.json")
            sequence = opened(SequenceArtifact, options.runs / log / "sequence")
            for things, on_nothing in frames_of(sequence, told, backend, files, options.frames):
                seen += [replace(one, thing=f"{log}/{one.thing}") for one in things]
                false.append(len(on_nothing))
                names.update(on_nothing)
        # A class that it has no word for is no error of a sight: nobody would ask this segmenter for it.
        said = {str(one.named) for one in seen} | set(names)
        made[name] = rates_of([one for one in seen if one.class_name in said], false, names)
        made[name]["sights_of_all_classes"] = len(seen)
        made[name]["missed_of_all_classes"] = float(np.mean([one.outcome == "missed" for one in seen])) if seen else 0.0
        raw = [[one.thing, one.class_name, *one.region, one.outcome, one.named] for one in seen]
        (options.out / f"sights_{name.replace(' ', '_')}.json").write_text(json.dumps(raw) + "\n")
        print(name, json.dumps(made[name], indent=1))
    file.write_text(json.dumps({**made, "logs": logs}, indent=1) + "\n")
    named = {"detector": made["detector"], "network": made["our network"]}
    (options.out / "segmenters.toml").write_text(rates_file(named, len(logs)))
    write_figures(
        options.out, "segmenter_rates", ABOUT, figures_of({name: made[name] for name in segmenters if name in made})
    )


def rates_file(made: Mapping[str, Mapping[str, Any]], logs: int) -> str:
    """Return data/errors/segmenters.toml: the rates that simulated segmenters err at. Where two regions of views came
    out more alike than one, both have the greater value."""
    printed = PrintedEyes()
    counts = ", ".join(f"{name}: {own['sights']} sights" for name, own in made.items())
    about = [
        "What segmenters get wrong, for simulated eyes and masks: written by `python -m benchmarks.segmenter_rates`.",
        f"{counts} of things on {logs} annotated logs.",
        "Boxes of the annotation are rough, so that missed and merged are upper bounds. thesis: table 3.4 (Han 2024).",
        "Missed, merged, split and wrong_name are shares of all sights, false_masks is a frame; boundary (assumed) in",
        "pixels at a width of 640. confusion: true class -> wrong class -> sights; without it, any class asked for.",
    ]
    lines = [f"# {line}" for line in about]
    lines += ["", "[thesis]", f"missed = {printed.missed:.4f}", "merged = 0.0", "split = 0.0"]
    lines += [f"wrong_name = {printed.wrong_name:.4f}", "false_masks = 0.0", "boundary = 0.0"]
    lines += ["missed_alike = { same_region = 1.0, other_region = 0.0 }"]
    lines += [f"name_alike = {{ same_region = 1.0, other_region = {printed.other_region:.3f} }}"]
    for name, own in made.items():
        lines += ["", f"[{name}]"]
        lines += [f"{rate} = {own[rate]:.3f}" for rate in ("missed", "merged", "split", "wrong_name")]
        lines += [f"false_masks = {own['false_masks_a_frame']:.3f}", f"boundary = {BOUNDARY}"]
        for key, error in (("missed_alike", "missed"), ("name_alike", "wrong_name")):
            other = own["alike"][error]["other_region"]
            same = max(own["alike"][error]["same_region"], other)
            lines.append(f"{key} = {{ same_region = {same:.3f}, other_region = {other:.3f} }}")
        lines.append(f"false_names = {_table(own['false_names'])}")
        wrong = {
            true: {name: count for name, count in row.items() if name != true} for true, row in own["confusion"].items()
        }
        lines.append("confusion = { " + ", ".join(f"{k} = {_table(row)}" for k, row in wrong.items() if row) + " }")
    return "\n".join(lines) + "\n"


def _table(row: Mapping[str, int]) -> str:
    return "{ " + ", ".join(f"{name} = {count}" for name, count in row.items()) + " }"


def figures_of(rates: Mapping[str, Mapping[str, Any]]) -> dict[str, Figure]:
    """Return the rates of each segmenter as figures, and the rule of finding."""
    figures = {"all/rule/found_iou": Figure(FOUND_IOU, None, None, None, "")}
    for name, own in rates.items():
        shares = {key: 100 * own[key] for key in ("missed", "merged", "split", "wrong_name", "missed_of_all_classes")}
        alike = {
            f"{error}_{where}": own["alike"][error][where] for error in own["alike"] for where in own["alike"][error]
        }
        others = alike | {"false_masks_a_frame": own["false_masks_a_frame"]}
        for unit, values in (("%", shares), ("", others)):
            for key, value in values.items():
                figures[f"{name}/real frames/{key}"] = Figure(round(value, 3), None, None, own["sights"], unit)
    return figures


def frames_of(
    sequence: SequenceArtifact, told: SupportAnnotation, backend: str, files: Mapping[str, Path], count: int
) -> Iterator[tuple[list[Seen], list[str]]]:
    """Yield what a segmenter makes of the annotated things of a frame, and the classes of its false masks."""
    vocabulary = load_vocabulary()
    classes = {entry.id: entry.name for entry in vocabulary.classes}
    layout = {entry.name for entry in vocabulary.classes if entry.is_layout}
    parameters = SegmentParameters.model_validate({"backend": backend})
    with FrameReader(sequence.path("frames.mcap")) as reader:
        segment = choose_backend(
            BackendRequest(
                parameters,
                files.get("weights"),
                semantic_weights=files.get("semantic_weights"),
                sequence=sequence,
                reader=reader,
            )
        )
        for frame in reader.frames(every=max(1, len(reader) // count)):
            if frame.depth is None or frame.world_from_camera is None:
                continue
            camera = reader.cameras[frame.camera_name]
            geometric = segment_depth(frame.depth, camera, geometric_settings(parameters))
            masks = segment(frame, geometric, np.random.default_rng(0))
            valid = (frame.depth > 0)[::STRIDE, ::STRIDE]
            points = apply(frame.world_from_camera, back_project(frame.depth, camera, stride=STRIDE)[valid])
            _, owner = instances_of(told, points, np.zeros(len(points), np.int64), None, 0.0)
            ids = masks.ids[::STRIDE, ::STRIDE][valid]
            present = {int(k): classes[masks.masks[int(k)].class_id] for k in np.unique(ids) if int(k) in masks.masks}
            present = {k: name for k, name in present.items() if name not in layout}
            shared = np.array(
                [[np.sum((owner == t) & (ids == k)) for k in present] for t in range(len(told.nodes) + 1)]
            )
            shared = shared.reshape(len(told.nodes) + 1, len(present))
            things = {
                t: node for t, node in enumerate(told.nodes, 1) if node.class_name not in layout and not node.optional
            }
            place = frame.world_from_camera[:3, 3]
            yield (
                [
                    thing_of(
                        t,
                        node.name,
                        node.class_name,
                        shared,
                        ids,
                        owner,
                        present,
                        view_region(place, points[owner == t]),
                    )
                    for t, node in things.items()
                    if np.sum(owner == t) >= LEAST_PIXELS
                ],
                false_masks(shared, present, set(things), told, layout),
            )


def thing_of(
    number: int,
    name: str,
    class_name: str,
    shared: np.ndarray,
    ids: np.ndarray,
    owner: np.ndarray,
    present: Mapping[int, str],
    region: tuple[int, ...],
) -> Seen:
    """Judge one thing by the pixels (things, masks) that it shares with the masks of the frame."""
    own = shared[number]
    whole = np.array([np.sum(ids == k) for k in present])
    truth = float(np.sum(owner == number))
    names = list(present.values())
    if not len(own) or own.max() == 0:
        return Seen(name, class_name, region, "missed", None)
    iou = own / (whole + truth - own)
    best = int(iou.argmax())
    sizes = np.array([max(1, np.sum(owner == t)) for t in range(len(shared))])
    covers = [np.flatnonzero(shared[1:, k] / sizes[1:] >= COVERED) + 1 for k in range(len(own))]
    if any(number in c and len(c) > 1 for c in covers):
        return Seen(name, class_name, region, "merged", None)
    pieces = (own >= PIECE * truth) & (own >= PIECE_INSIDE * whole)
    if pieces.sum() > 1:
        return Seen(name, class_name, region, "split", names[best])
    if iou[best] >= FOUND_IOU:
        return Seen(name, class_name, region, "found", names[best])
    return Seen(name, class_name, region, "missed", None)


def false_masks(
    shared: np.ndarray, present: Mapping[int, str], things: set[int], told: SupportAnnotation, layout: set[str]
) -> list[str]:
    """Return the classes of masks of things that lie on annotated floor and walls, hardly on a thing."""
    building = [t for t, node in enumerate(told.nodes, 1) if node.class_name in layout]
    found = []
    for column, class_name in enumerate(present.values()):
        total = max(1, int(shared[:, column].sum()))
        on_things = shared[1:, column].sum() - shared[building, column].sum()
        if on_things <= MASK_ON_NOTHING * total and shared[building, column].sum() > total / 2:
            found.append(class_name)
    return found


def rates_of(seen: Sequence[Seen], false: Sequence[int], names: Counter[str]) -> dict[str, Any]:
    """Return rates a sight of a thing, the confusion of names, and how alike errors are."""
    count = max(1, len(seen))
    outcomes = Counter(one.outcome for one in seen)
    named = [one for one in seen if one.named is not None and one.class_name != UNNAMED]
    confusion: dict[str, Counter[str]] = defaultdict(Counter)
    for one in named:
        confusion[one.class_name][str(one.named)] += 1
    return {
        "sights": len(seen),
        "frames": len(false),
        "missed": outcomes["missed"] / count,
        "merged": outcomes["merged"] / count,
        "split": outcomes["split"] / count,
        "wrong_name": sum(one.named != one.class_name for one in named) / max(1, len(named)),
        "false_masks_a_frame": float(np.mean(false)) if false else 0.0,
        "false_names": dict(names.most_common()),
        "confusion": {true: dict(given.most_common()) for true, given in sorted(confusion.items())},
        "alike": {
            "missed": alikeness([(one.thing, one.region, one.outcome == "missed") for one in seen]),
            "wrong_name": alikeness([(one.thing, one.region, one.named != one.class_name) for one in named]),
        },
    }


def alikeness(sights: Sequence[tuple[str, tuple[int, ...], bool]]) -> dict[str, float]:
    """Return the correlation of an error in two sights of one thing: from one region of views, and from two."""
    rate = float(np.mean([wrong for _, _, wrong in sights])) if sights else 0.0
    spread = max(rate * (1 - rate), 1e-9)
    by_thing: dict[str, list[tuple[tuple[int, ...], bool]]] = defaultdict(list)
    for thing, region, wrong in sights:
        by_thing[thing].append((region, wrong))
    both: dict[bool, list[float]] = {True: [], False: []}
    for found in by_thing.values():
        for (a, first), (b, second) in combinations(found, 2):
            both[a == b].append((first - rate) * (second - rate) / spread)
    return {
        "same_region": float(np.mean(both[True])) if both[True] else 0.0,
        "other_region": float(np.mean(both[False])) if both[False] else 0.0,
    }


if __name__ == "__main__":
    main()
