"""Vision on rendered tables: precision, recall, errors, heights, calibration; per class, tier, light and colours.

    python -m benchmarks.tidy.detect --out FOLDER [--scenes N] [--tuning] [--quick] [--one] [--jobs 1] [--seconds S]

Reporting seeds are 1000 and up, tuning seeds (`--tuning`) 0 and up; the tier goes round with the seed, and every scene
is seen at three levels of light and noise in two schemes of colour (`--one`: in one of the six, which goes round).
`--quick` takes six scenes. A stopped run goes on where it was. Writes runs.jsonl, metrics.json
(`<arm>/detect/<class>/<measure>`, and `<arm>/detect_<case>/<class>/<measure>`) and table.md. Milliseconds are CPU time
of one thread for a frame of 1280 x 720; `quiet` is the least of five looks at a frame, for a machine that others use.
"""

from __future__ import annotations

import argparse
import json
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import cv2

from benchmarks.tidy.detect_tables import metrics, table_text
from benchmarks.tidy.detection_score import Match, compare
from schemas.base import Model
from stages.tableware.vision.detection import detect
from stages.tableware.vision.thesis_detection import detect_thesis
from stages.tableware.world.overhead import LEVELS, SCHEMES, Scheme, overhead_camera, render_overhead
from stages.tableware.world.scenes import TIERS, make_table

ARMS = {"ours": detect, "thesis": detect_thesis}
REPORTING, TUNING = 1000, 0
SCENES, QUICK = 200, 6
LOOKS = 5


class Look(Model):
    """One arm's look at one image."""

    arm: str
    tier: str
    seed: int
    level: str
    scheme: str
    seconds: float
    quiet: float | None = None
    """Least of LOOKS times [s], of one image a scene."""
    matches: tuple[Match, ...]


def conditions(seed: int, one: bool) -> list[tuple[str, Scheme]]:
    """Return the light levels and schemes in which a seed's scene is seen."""
    every = [(level, scheme) for level in LEVELS for scheme in SCHEMES]
    return [every[seed // len(TIERS) % len(every)]] if one else every


def tier_of(seed: int) -> str:
    """Return the tier of a seed's scene."""
    return list(TIERS)[seed % len(TIERS)]


def look_at(seed: int, one: bool) -> list[Look]:
    """Render a seed's scene under its conditions and return what both arms see."""
    cv2.setNumThreads(1)
    tier, view, looks = tier_of(seed), overhead_camera(), []
    table = make_table(tier, seed)
    for number, (level, scheme) in enumerate(conditions(seed, one)):
        color, depth = render_overhead(table, seed, level, scheme, view=view)
        for arm, look in ARMS.items():
            if number == 0:
                look(color, depth, view)  # compiles what is compiled; its time is not kept
            times = []
            for _ in range(LOOKS if number == seed % len(LEVELS) and arm == "ours" else 1):
                started = time.process_time()
                found = look(color, depth, view)
                times.append(time.process_time() - started)
            looks.append(
                Look(
                    arm=arm, tier=tier, seed=seed, level=level, scheme=scheme, seconds=times[0],
                    quiet=min(times) if len(times) > 1 else None, matches=tuple(compare(table, found)),
                )
            )  # fmt: skip
    return looks


def read_looks(path: Path) -> list[Look]:
    """Return the looks of a log; a line that was cut off at the end is taken out of the file."""
    if not path.exists():
        return []
    text = path.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        path.write_text(whole, encoding="utf-8")
    return [Look.model_validate_json(line) for line in whole.splitlines()]


def main() -> None:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.tidy.detect", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--scenes", type=int, default=SCENES)
    parser.add_argument("--quick", action="store_true", help=f"{QUICK} scenes")
    parser.add_argument("--tuning", action="store_true", help="tuning seeds instead of reporting seeds")
    parser.add_argument("--one", action="store_true", help="one light and one scheme a scene")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=None, help="no new scene after so much wall time")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    log = options.out / "runs.jsonl"
    first = TUNING if options.tuning else REPORTING
    seeds = range(first, first + (QUICK if options.quick else options.scenes))
    done: dict[int, int] = {}
    for look in read_looks(log):
        done[look.seed] = done.get(look.seed, 0) + 1
    waiting = [seed for seed in seeds if done.get(seed, 0) < len(ARMS) * len(conditions(seed, options.one))]
    begun = time.monotonic()

    def keep(looks: list[Look]) -> bool:
        with log.open("a", encoding="utf-8") as stream:
            stream.writelines(look.model_dump_json() + "\n" for look in looks)
        return options.seconds is None or time.monotonic() - begun < options.seconds

    if options.jobs == 1:
        for seed in waiting:
            if not keep(look_at(seed, options.one)):
                break
    else:
        with ProcessPoolExecutor(options.jobs) as pool:
            for looks in pool.map(look_at, waiting, [options.one] * len(waiting)):
                if not keep(looks):
                    pool.shutdown(wait=False, cancel_futures=True)
                    break
    write(options.out, [look for look in read_looks(log) if look.seed in seeds])


def write(out: Path, looks: list[Look]) -> None:
    """Write metrics.json and table.md."""
    result = metrics(looks)
    (out / "metrics.json").write_text(json.dumps(result, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    (out / "table.md").write_text(table_text(looks, result), encoding="utf-8")


if __name__ == "__main__":
    main()
