"""Disparity beside OpenCV's matchers: bad-2, end-point error, coverage and CPU time, all in one run.

Parts of a picture have figures as `<case>_<part>`. Draws a picture of the first pair of every case.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
from pydantic import Field
from scenewright.stages.disparity import SMALL_UPDATES, gray_of
from scenewright.stages.disparity.search_range import search_range
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.kit.stereo.disparity_map import DisparityMap
from scenewright.stages.kit.stereo.pictures import confidence_colors, disparity_colors

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial
from benchmarks.experiments.disparity.arms import DERIVED, NETWORK, WORDS, Arm, arms_of
from benchmarks.experiments.disparity.cases import CASES, NEEDLE_SEEDS, TUNING_NEEDLES, Pair

UNITS = {
    "bad2": "bad-2, of known [%]",
    "bad2_all": "bad-2, holes are bad [%]",
    "epe": "end-point error [px]",
    "median": "median error [px]",
    "coverage": "known [%]",
    "cpu_seconds": "CPU s a frame",
}
SHOWN = ("opencv_default", "small_one_way", "ours")
"""Arms of the picture, as far as they ran."""
Scores = dict[str, dict[str, float]]
"""Part of the picture ("" is the whole) -> measure -> value; what is undefined is not there."""
PICTURE = "pair.png"
NEEDS_NETWORK = (*NETWORK, "filled")


class DisparityParameters(Parameters):
    """Options of the experiment."""

    data: Path = Field(Path("../shared/data"), description="Folder with the real logs")
    network: Path | None = Field(None, description="Checkpoint of RAFT-Stereo whose arms run too")
    updates: int = Field(SMALL_UPDATES, ge=1, description="Updates of the network's disparity")


def place(bench: Bench) -> tuple[Path, Path]:
    """Folder of the real logs, folder for what is made."""
    return bench.parameters.data, bench.out / "logs"


def inputs(bench: Bench, trial: Trial) -> list[Path]:
    """The checkpoint."""
    return [bench.parameters.network] if bench.parameters.network and trial.arm in NEEDS_NETWORK else []


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Scores]]:
    """Yield the scores of one pair, and leave its picture with those of `ours`."""
    cv2.setNumThreads(1)
    pair = CASES[trials[0].case].pair(*place(bench), trials[0].seed)
    wanted = {trial.arm: trial for trial in trials}
    needed = set(wanted) | {one for name in wanted if name in DERIVED for one in DERIVED[name][1]}
    arms = {n: arm for n, arm in arms_of(bench.parameters.network, bench.parameters.updates).items() if n in needed}
    maps, figures = measured(pair, arms)
    if SHOWN[-1] in wanted:
        folder = bench.folder(wanted[SHOWN[-1]])
        folder.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(folder / PICTURE), picture(pair, maps)[..., ::-1])
    for name, trial in wanted.items():
        yield trial, figures[name]


def scores(found: DisparityMap, truth: np.ndarray) -> dict[str, float]:
    """Return the figures of one map where the truth is known, as far as they are defined; shares are per cent."""
    there = np.isfinite(truth)
    both = there & found.known
    error = np.abs(found.disparity[both] - truth[both])
    wrong = float((error > 2).sum())
    if not there.any():
        return {}
    known = {"epe": float(error.mean()), "median": float(np.median(error))} if len(error) else {}
    return {
        **({"bad2": 100 * wrong / len(error)} if len(error) else {}),
        "bad2_all": 100 * (wrong + (there & ~found.known).sum()) / there.sum(),
        **known,
        "coverage": 100 * len(error) / there.sum(),
    }


def measured(pair: Pair, arms: Mapping[str, Arm]) -> tuple[dict[str, DisparityMap], dict[str, Scores]]:
    """Return what every arm makes of a pair, those that are made of others included, and arm -> part ("" is the whole
    picture) -> its scores with the CPU time of the arm (one thread)."""
    limits = search_range(gray_of(pair.left), gray_of(pair.right))
    maps, spent = {}, {}
    for name, arm in arms.items():
        started = time.process_time()
        maps[name] = arm(pair.left, pair.right, limits)
        spent[name] = time.process_time() - started
    for name, (_, needed, make) in DERIVED.items():
        if all(one in maps for one in needed):
            maps[name] = make(maps)
            spent[name] = sum(spent[one] for one in needed)
    whole = {"": np.ones(pair.truth.shape, bool)}
    figures = {
        name: {
            part: scores(found, np.where(inside, pair.truth, np.nan)) | {"cpu_seconds": spent[name]}
            for part, inside in (whole | pair.parts).items()
        }
        for name, found in maps.items()
    }
    return maps, figures


def picture(pair: Pair, maps: dict[str, DisparityMap]) -> np.ndarray:
    """Return left eye, truth (made visible where it is sparse), the shown arms and our confidence in one row."""
    limits = tuple(np.nanpercentile(pair.truth, [1, 99]))
    truth = pair.truth
    if np.isfinite(truth).mean() < 0.1:  # single features: draw them larger
        grown = cv2.dilate(np.nan_to_num(truth), np.ones((9, 9), np.uint8))
        truth = np.where(grown > 0, grown, np.nan)
    tiles = [pair.left, disparity_colors(truth, limits)]
    tiles += [disparity_colors(maps[arm].disparity, limits) for arm in SHOWN if arm in maps]
    tiles.append(confidence_colors(maps[SHOWN[-1]].confidence))
    height = 300
    sized = [cv2.resize(tile, (round(tile.shape[1] * height / tile.shape[0]), height)) for tile in tiles]
    return np.hstack(sized)


def of_part(name: str, part: str = "") -> Callable[[Sequence[Scores]], float | None]:
    """Mean over the pairs in which it is defined."""

    def figure(records: Sequence[Scores]) -> float | None:
        values = [record[part][name] for record in records if name in record.get(part, {})]
        return float(np.mean(values)) if values else None

    return figure


MEASURES = {
    name: Measure(of_part(name), words[words.rindex("[") + 1 : -1] if "[" in words else "s", name != "cpu_seconds")
    for name, words in UNITS.items()
}


def parts_of(results: Results, case: str) -> list[str]:
    """Parts of a case's pictures."""
    return list(dict.fromkeys(p for t, r in results.records.items() if t.case == case for p in r if p))


def more_figures(results: Results) -> dict[str, float | None]:
    """Parts of pictures, and how many pairs there were."""
    flat: dict[str, float | None] = {}
    for case in results.cases:
        flat[f"pairs/{case}/count"] = float(len(results.seeds(case)))
        for part in parts_of(results, case):
            flat[f"pairs/{case}_{part}/count"] = float(len(results.seeds(case)))
            for arm in results.arms(case):
                records = results.of(arm, case)
                flat |= {f"{arm}/{case}_{part}/{name}": of_part(name, part)(records) for name in UNITS}
    return flat


def copy_pictures(results: Results) -> None:
    """Put the picture of the first pair of every case into the output folder."""
    for case in results.cases:
        file = results.bench.folder(Trial(SHOWN[-1], case, results.seeds(case)[0])) / PICTURE
        if file.is_file():
            (results.bench.out / f"{case}.png").write_bytes(file.read_bytes())


EXPERIMENT = Experiment(
    name="disparity",
    title="Disparity beside OpenCV's matchers",
    simulated="The rooms and needles with their pictures; Middlebury's pair and the endoscope's frames are recordings.",
    knows="The rectified pair; OpenCV's matchers are given the range that ours finds.",
    does_not_show="Rectification errors of real rigs; the endoscope's truth is that of matched features.",
    arms=WORDS,
    cases=tuple(CASES),
    default_arms=lambda bench: [arm for arm in WORDS if bench.parameters.network or arm not in NEEDS_NETWORK],
    tuning=tuple(map(str, TUNING_NEEDLES)),
    reporting=tuple(map(str, NEEDLE_SEEDS)),
    seeds_of=lambda bench, case: CASES[case].names(*place(bench), bench.quick, bench.tuning),
    together=lambda trial: (trial.case, trial.seed),
    measure=measure,
    record=Scores,
    measures=MEASURES,
    more_figures=more_figures,
    parameters=DisparityParameters,
    places=frozenset({"data", "network"}),
    inputs=inputs,
    steps=("ingest", "synthesize", "library build"),
    pairs=(("ours", "opencv_usual"), ("ours", "opencv_default")),
    compared=("bad2", "bad2_all", "epe", "coverage"),
    pictures=copy_pictures,
)
