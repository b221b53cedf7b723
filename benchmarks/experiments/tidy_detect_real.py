"""Vision on real images: oblique RealSense frames of tabletops, and photographs of a restaurant table.

`--data` holds `realsense_tabletop` (colour and depth PNGs; the truth is data/annotations/tableware, by eye) and `meal`
(photographs with YOLO boxes). A detection in a frame counts when its rim's middle lies within 30 px of one of its kind;
`planned` is what `tableware plan` would take of what was found, by the command's defaults, `refused` what it would
leave alone. `stackings` are those that Ours and Stack together plan of it with a tier's times, right where both things
are. The case `frames_left_out` chooses what counts as a dish (`Limits`) for each scene by the frames of the others
alone: the greatest F1 over dishes of a grid, the first of equals. An outline in a photograph counts when its box
overlaps one of its class by half (intersection over union), or, the weaker measure, when its middle lies in one. Beside
each record lies the picture.
"""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path

import cv2
import numpy as np
from pydantic import Field
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.measurement.bootstrap import Interval, figure_interval
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.tableware import (
    EXACT,
    FastWorld,
    Gripper,
    Limits,
    Outline,
    Setting,
    Sight,
    Sizes,
    Stack,
    Table,
    draw_outlines,
    draw_sight,
    estimated_dishes,
    estimated_setting,
    find_outlines,
    make_policy,
    read_image,
    run_in,
    see,
    seen_from_the_side,
    setting_seen,
    understood,
)
from scenewright.stages.tableware.planning.time_model import fitted
from scenewright.stages.tableware.simulation.trial import Done
from scipy.optimize import linear_sum_assignment

from benchmarks.experiment import Bench, Experiment, Results, Trial
from benchmarks.tabulation import Figure

ANNOTATIONS = Path(__file__).resolve().parents[2] / "data" / "annotations" / "tableware" / "realsense_tabletop.toml"
NEAR = 30.0
"""[px]"""
PICTURE_WIDTH = 1.6
"""What the photographs' width shows of the table [m]: our guess."""
CLASSES = {6: "plate", 7: "plate", 8: "cup", 9: "cup"}
"""Of the photographs' classes plate, plate bottom, shot and tea; the others are food and a board."""
OVERLAP = 0.5
LEFT_OUT = "frames_left_out"
SIZES: dict[str, Sizes] = {"frames_known": "known", "frames_estimated": "estimated", LEFT_OUT: "estimated"}
GRID = tuple(Limits(least_round=share, slimmest=slim) for share in (0.35, 0.3, 0.4, 0.5) for slim in (10.0, 5.0, 4.0))
LEAST_CONFIDENCE = 0.5
"""Of what is planned for, as the command's."""
STACKING, TIMES_OF = ("ours", "stack"), "tier2"
"""Policies whose stackings are counted, and by which fit's times."""
Box = tuple[float, float, float, float]
Counts = Counter[tuple[str, str]]
"""(class, true | found | right) -> count."""


def matched(gain: np.ndarray, least: float) -> list[tuple[int, int]]:
    """Return pairs of rows and columns of greatest total gain, each at least `least`."""
    if gain.size == 0:
        return []
    rows, columns = linear_sum_assignment(-np.where(gain >= least, gain, -1e3))
    return [(int(r), int(c)) for r, c in zip(rows, columns, strict=True) if gain[r, c] >= least]


def frame_counts(truth: list[tuple[str, float, float]], sight: Sight) -> Counts:
    """Return counts by (class, true | found | right) of a frame; things of unknown kind count as `unknown`."""
    camera_from_world = np.linalg.inv(sight.world_from_camera)
    counts: Counts = Counter((kind, "true") for kind, _, _ in truth)
    planned = names_planned(sight)
    seen = []
    for number, one in enumerate(sight.detections, start=1):
        counts[one.kind or "unknown", "found"] += 1
        if one.kind is not None:
            counts[one.kind, "planned" if f"{one.kind}_{number}" in planned else "refused"] += 1
        point = camera_from_world @ np.array([one.position[0], one.position[1], one.lip, 1.0])
        seen.append(
            (
                one.kind,
                sight.camera.fx * point[0] / point[2] + sight.camera.cx,
                sight.camera.fy * point[1] / point[2] + sight.camera.cy,
            )
        )
    right = set()
    gain = np.array(
        [[-np.hypot(u - x, v - y) if kind == other else -1e6 for other, x, y in seen] for kind, u, v in truth]
    ).reshape(len(truth), len(seen))
    for row, column in matched(gain, -NEAR):
        kind = truth[row][0]
        counts[kind, "right"] += 1
        counts[kind, "planned_right"] += f"{kind}_{column + 1}" in planned
        right.add(f"{kind}_{column + 1}")
    for pair in stackings(sight):
        counts["stackings", "planned"] += 1
        counts["stackings", "planned_right"] += right >= set(pair)
    return counts


def setting_for(sight: Sight) -> Setting:
    """Return the sizes and the hand that `tableware plan` goes by."""
    setting = estimated_setting(sight.detections, Gripper()) if sight.estimated else Setting()
    return setting_seen(sight.detections, setting)


def planned_table(sight: Sight) -> Table:
    """Return what `tableware plan` takes of what was seen."""
    return understood(sight.detections, LEAST_CONFIDENCE, setting_for(sight)).table


def names_planned(sight: Sight) -> set[str]:
    """Return the names of what `tableware plan` takes of what was seen."""
    return {item.name for item in planned_table(sight).items}


def stackings(sight: Sight) -> set[tuple[str, ...]]:
    """Return what would be put onto what, and what is taken to stand on what, in the plans of Ours and of Stack."""
    table, setting, model = planned_table(sight), setting_for(sight), fitted(TIMES_OF)
    pairs: set[tuple[str, ...]] = {(item.name, item.on) for item in table.items if item.on is not None}
    for name in STACKING:
        done: list[Done] = []
        run_in(
            FastWorld(table, model, EXACT, 0, setting), make_policy(name, model, EXACT, 0, setting), hear=done.append
        )
        pairs |= {one.action.about for one in done if isinstance(one.action, Stack)}
    return pairs


def dish_f1(counts: Iterable[Counts]) -> float:
    """Return the F1 of the dishes of some frames."""
    whole = sum(counts, Counter[tuple[str, str]]())
    true, found, right = (
        sum(whole[kind, what] for kind in ("cup", "bowl", "plate")) for what in ("true", "found", "right")
    )
    return 2.0 * right / max(true + found, 1)


def chosen_by_others(by_limits: dict[Limits, dict[str, Counts]], own: set[str]) -> Limits:
    """Return the limits with the greatest F1 on the frames that are not of `own` scene, the first of equals."""
    return max(
        by_limits, key=lambda limits: dish_f1(count for frame, count in by_limits[limits].items() if frame not in own)
    )


def overlap(a: Box, b: Box) -> float:
    """Return the intersection over union of two boxes (left, top, right, bottom)."""
    width, height = (max(0.0, min(a[k + 2], b[k + 2]) - max(a[k], b[k])) for k in (0, 1))
    areas = [(box[2] - box[0]) * (box[3] - box[1]) for box in (a, b)]
    return width * height / max(sum(areas) - width * height, 1e-9)


def middle_inside(a: Box, b: Box) -> float:
    """Return 1 when the middle of box b lies in box a, else 0."""
    u, v = 0.5 * (b[0] + b[2]), 0.5 * (b[1] + b[3])
    return float(a[0] <= u <= a[2] and a[1] <= v <= a[3])


def photograph_counts(
    truth: list[tuple[str, Box]], outlines: tuple[Outline, ...], gain: Callable[[Box, Box], float], any_class: bool
) -> Counts:
    """Return counts by (class, true | found | right) of a photograph; with `any_class` kinds do not matter."""
    counts: Counts = Counter()
    for kind, _ in truth:
        counts["any" if any_class else kind, "true"] += 1
    for one in outlines:
        counts["any" if any_class else str(one.kind), "found"] += 1
    gains = np.array(
        [[gain(box, one.box) if any_class or one.kind == kind else -1.0 for one in outlines] for kind, box in truth]
    ).reshape(len(truth), len(outlines))
    for row, _ in matched(gains, OVERLAP):
        counts["any" if any_class else truth[row][0], "right"] += 1
    return counts


def read_boxes(path: Path, width: int, height: int) -> list[tuple[str, Box]]:
    """Return the boxes [px] of a YOLO label file that map to our classes."""
    boxes = []
    for line in path.read_text(encoding="utf-8").splitlines():
        number, *numbers = line.split()
        if int(number) in CLASSES:
            u, v, w, h = (float(value) for value in numbers[:4])
            box = ((u - w / 2) * width, (v - h / 2) * height, (u + w / 2) * width, (v + h / 2) * height)
            boxes.append((CLASSES[int(number)], box))
    return boxes


GAINS: dict[str, Callable[[Box, Box], float]] = {"photographs_overlap": overlap, "photographs_middle": middle_inside}


class RealParameters(Parameters):
    """Options of the experiment."""

    data: Path = Field(Path("../shared/data/tableware"), description="Folder of realsense_tabletop and meal")


def annotated() -> tuple[Camera, dict[str, list[tuple[str, float, float]]]]:
    """Return the camera of the frames, and by frame what lies in it: kind, column, row [px]."""
    told = tomllib.loads(ANNOTATIONS.read_text(encoding="utf-8"))
    frames = {name: [(str(k), float(u), float(v)) for k, u, v in marks] for name, marks in told["frames"].items()}
    return Camera(**told["camera"]), dict(sorted(frames.items()))


def scenes() -> list[set[str]]:
    """Return the frames of each scene: the same things on the same table."""
    return [set(frames) for frames in tomllib.loads(ANNOTATIONS.read_text(encoding="utf-8"))["scenes"]["frames"]]


def with_limits(sight: Sight, limits: Limits) -> Sight:
    """Return a sight of estimated dishes with other limits."""
    return replace(sight, detections=seen_from_the_side(estimated_dishes(sight.heights, 0, limits)))


def left_out(sights: dict[str, Sight]) -> dict[str, Sight]:
    """Return for every frame what is seen with the limits that the other scenes choose; `sights`: with estimated
    sizes."""
    by_limits = {
        limits: {
            frame: frame_counts(marks, with_limits(sights[frame], limits)) for frame, marks in annotated()[1].items()
        }
        for limits in GRID
    }
    chosen = {frame: chosen_by_others(by_limits, scene) for scene in scenes() for frame in scene}
    return {frame: with_limits(sight, chosen[frame]) for frame, sight in sights.items()}


def photographs(data: Path) -> dict[str, Path]:
    """Return the photographs by name."""
    return {f"{p.parent.parent.name}_{p.stem}": p for p in sorted((data / "meal").glob("*/images/*.jpg"))}


def seeds_of(bench: Bench, case: str) -> Sequence[str]:
    """The frames, the photographs."""
    data: Path = bench.parameters.data
    if case in GAINS:
        return tuple(photographs(data))
    return tuple(annotated()[1]) if (data / "realsense_tabletop").is_dir() else ()


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, dict[str, int]]]:
    """Yield `<class>/<true | found | right>` -> count of images."""
    seen = lru_cache(partial(frame_sight, bench.parameters.data))
    chosen: dict[str, Sight] = {}
    for trial in trials:
        if trial.case == LEFT_OUT and not chosen:
            chosen = left_out({frame: seen(frame, "estimated")[1] for frame in annotated()[1]})
        if trial.case in GAINS:
            counts, picture = photograph_seen(bench.parameters.data, trial)
        else:
            color, sight = seen(trial.seed, SIZES[trial.case])
            sight = chosen.get(trial.seed, sight) if trial.case == LEFT_OUT else sight
            counts, picture = frame_counts(annotated()[1][trial.seed], sight), draw_sight(color, sight)
        bench.folder(trial).mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(bench.folder(trial) / "picture.png"), cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
        yield trial, {"/".join(key): count for key, count in counts.items()}


def frame_sight(data: Path, frame: str, sizes: Sizes) -> tuple[np.ndarray, Sight]:
    """Return a frame's picture and what is seen in it."""
    folder = data / "realsense_tabletop"
    read = read_image(folder / f"{frame}-color.png", folder / f"{frame}-depth.png")
    return read.color, see(read.color, read.depth, annotated()[0], sizes=sizes)


def photograph_seen(data: Path, trial: Trial) -> tuple[Counts, np.ndarray]:
    """Return the counts of a photograph, by class and of any class, and its picture."""
    path = photographs(data)[trial.seed]
    color = read_image(path).color
    outlines = find_outlines(color, PICTURE_WIDTH)
    boxes = read_boxes(path.parent.parent / "labels" / f"{path.stem}.txt", color.shape[1], color.shape[0])
    counts = Counter[tuple[str, str]]()
    for any_class in (False, True):
        counts.update(photograph_counts(boxes, outlines, GAINS[trial.case], any_class))
    return counts, draw_outlines(color, outlines, "a photograph without depth: heights are unknown")


def grouped(case: str, records: dict[str, dict[str, int]]) -> list[Counter[str]]:
    """Return the counts of what is drawn together for intervals: a scene's frames, a photograph."""
    if case not in SIZES:
        return [Counter(record) for record in records.values()]
    groups = []
    for scene in scenes():
        counts = sum((Counter(records[frame]) for frame in scene if frame in records), Counter[str]())
        for name in ("true", "found", "right", "planned", "planned_right", "refused"):
            counts[f"dish/{name}"] = sum(counts[f"{kind}/{name}"] for kind in ("cup", "bowl", "plate"))
        groups.append(counts)
    return groups


def ratio(groups: Sequence[Counter[str]], part: str, whole: str) -> Interval | None:
    """Return a share over all groups, with its interval over groups; None where there is nothing of `whole`."""

    def share(drawn: Sequence[Counter[str]]) -> float | None:
        among = sum(counts[whole] for counts in drawn)
        return sum(counts[part] for counts in drawn) / among if among else None

    return figure_interval(share, groups, np.random.default_rng(0), resamples=2000)


def more_figures(results: Results) -> dict[str, Figure]:
    """`ours/<case>/<class>/<measure>` over all images, of how many things there are."""
    flat: dict[str, Figure] = {}
    for case in results.cases:
        records = dict(zip(results.seeds(case), results.of("ours", case), strict=True))
        groups = grouped(case, records)
        counts = sum(groups, Counter[str]())
        kinds = {name.split("/")[0] for name in counts} | ({"stackings"} if case in SIZES else set())
        for kind in sorted(kinds):
            true, found, right = (counts[f"{kind}/{name}"] for name in ("true", "found", "right"))
            values: dict[str, int] = {"true": true, "found": found, "right": right, "false": found - right}
            if case in SIZES and kind not in ("unknown", "stackings"):
                values["refused"] = counts[f"{kind}/refused"]
            if kind == "stackings":
                values = {}
            if case in SIZES and kind != "unknown":
                meant = counts[f"{kind}/planned_right"]
                values |= {"planned_right": meant, "planned_false": counts[f"{kind}/planned"] - meant}
            for name, value in values.items():
                flat[f"ours/{case}/{kind}/{name}"] = Figure(float(value), None, None, true, "count")
            for name, whole in (("precision", "found"), ("recall", "true")) if kind != "stackings" else ():
                if (said := ratio(groups, f"{kind}/right", f"{kind}/{whole}")) is not None:
                    flat[f"ours/{case}/{kind}/{name}"] = Figure(said.value, said.low, said.high, true, "")
    return flat


EXPERIMENT = Experiment(
    name="tidy_detect_real",
    title="Vision of tableware on real images",
    simulated="Nothing: nine RealSense frames, twelve photographs.",
    knows=(
        "Intrinsics and depth; the standard dish sizes, or none. The limits of `left out` are chosen on the "
        "other scenes. Developed on these frames."
    ),
    does_not_show=(
        "A clean test: `--sizes estimated` was developed on these nine frames of six scenes, and the truth "
        "was marked by eye. `left out` chooses its limits on the other scenes, not its method. There is no "
        "utensil. Nothing is stacked from estimated sizes. Known sizes are the standard ones, which these "
        "dishes do not have."
    ),
    arms={"ours": "ours"},
    cases=(*SIZES, *GAINS),
    seeds_of=seeds_of,
    together=lambda trial: "frames" if trial.case in SIZES else (trial.case, trial.seed),
    measure=measure,
    record=dict[str, int],
    measures={},
    more_figures=more_figures,
    parameters=RealParameters,
    places=frozenset({"data"}),
    steps=("tableware detect", "tableware plan"),
)
