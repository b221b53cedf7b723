"""An error model of perception for the simulator of trials, fitted to what the needle benchmark measured of ours.

    python -m benchmarks.stitch.perception --needle FOLDER --commit HASH
    python -m benchmarks.stitch.perception --looks FOLDER --seconds 0.82 --commit HASH --out FILE

The second is of the network's masks, from what trials by pictures saw (stitch_sight): the first look at each needle
that has moved gives the shares, the looks after it how often its fate comes again. Of views of the needle world the
tissue hides half of a needle, of trials a quarter, and the corner is of the right driver's needles alone, which stand
for the left one's.

Right: answered, centre within 1 mm, plane within 10 degrees, and the tip not taken for the swage. Corner shares of
views are of those in which the needle is more than 15 degrees from edge-on, as pose correction turns it to face the
cameras; the others are of all views. What is not measured (of views how often the same mistake is made again, of all
how much of an error stays) is kept as the thesis's model has it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from pydantic import Field
from scenewright.schemas.errors import UsageError
from scenewright.stages.kit.measurement.proportions import wilson_interval
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.suture.evaluation.judgement import Estimate
from scenewright.stages.suture.trials.perception import FOLDER, Errors, PerceptionModel, perception_model
from scenewright.stages.suture.trials.sight import Looked

from benchmarks.keeping import kept_records
from benchmarks.options import asked

STRAY = 5.0
"""An end farther off than this [mm] strays: thread, a jaw or the other end was taken for it."""
FEWEST, FEWEST_FAILURES = 10, 5
SPREADS = ("normal_degrees", "end_millimetres")
"""What right estimates have of Errors."""


def right(record: Estimate) -> bool:
    """Whether a robot that believes the estimate is right to."""
    return record.within and not record.swapped


def by_place_looked(looked: Sequence[Looked]) -> dict[str, list[Estimate]]:
    """Return the simulator's places with the first look at each needle there."""
    places = {"corner_left": "corner_right", "corner_right": "corner_right"}
    return {
        place: [look.estimate for look in looked if look.place == places.get(place, place) and not look.again]
        for place in ("corner_left", "corner_right", "elsewhere", "tissue")
    }


def persistence(looked: Sequence[Looked]) -> float:
    """Return how often a look at a needle that stays has the fate of the look before, beyond what chance gives (0 to
    1). `looked` are the looks of trials, one trial after the other. Raises ValueError where nothing was looked at
    again."""
    pairs = [(before.fate, look.fate) for before, look in pairwise(looked) if look.again]
    if not pairs:
        raise ValueError("no needle was looked at again")
    alike = float(np.mean([before == after for before, after in pairs]))
    seen = Counter(after for _, after in pairs)
    chance = sum((count / len(pairs)) ** 2 for count in seen.values())
    return round(max(0.0, (alike - chance) / (1.0 - chance)), 3) if chance < 1.0 else 0.0


def by_place(records: list[Estimate]) -> dict[str, list[Estimate]]:
    """Return the simulator's places with the views that stand for them."""
    free = [r for r in records if r.case in ("rendered", "geometry")]
    return {
        "corner_left": [r for r in records if r.case == "geometry_corner_left" and r.visible],
        "corner_right": [r for r in records if r.case == "geometry_corner_right" and r.visible],
        "elsewhere": [r for r in free if r.holder != "tissue"],
        "tissue": [r for r in free if r.holder == "tissue"],
    }


def fitted(
    places: dict[str, list[Estimate]], other: PerceptionModel, seconds: float, thread: float, told: str
) -> PerceptionModel:
    """Return the model of ours from the views that stand for the places; `other` gives what is not measured. Raises
    ValueError for too few views of a place."""
    for place, found in places.items():
        if len(found) < FEWEST:
            raise ValueError(f"{place}: {len(found)} views, {FEWEST} are needed")
    # A record that stands for several places counts once.
    seen = list({id(record): record for found in places.values() for record in found}.values())
    good = [record for record in seen if right(record)]
    bad = [record for record in seen if record.answered and not record.within]
    swapped = [record for record in seen if record.within and record.swapped]
    return other.model_copy(
        update={
            "name": "ours",
            "measured": True,
            "provenance": told + _counts(places) + f" Wrong answers behind their size of errors: {len(bad)}; "
            f"right but for the names of the ends: {len(swapped)}.",
            "seconds_an_estimate": seconds,
            "thread_length_error": thread,
            "right_share": type(other.right_share)(**{p: _share(f, right) for p, f in places.items()}),
            "abstained_share": type(other.abstained_share)(**{p: _abstained(f, seen) for p, f in places.items()}),
            "right": _errors(good, other, False),
            "wrong": _errors(bad, other, True, swapped).model_copy(
                update={"swapped_share": round(len(swapped) / max(1, len(bad) + len(swapped)), 3)}
            ),
        }
    )


def _share(records: list[Estimate], test: Callable[[Estimate], bool]) -> float:
    return round(float(np.mean([test(record) for record in records])), 3)


def _abstained(records: list[Estimate], every: list[Estimate]) -> float:
    """Return the share of abstentions among what is not right; of every place where this one has too few of them."""
    failed = [record for record in records if not right(record)]
    if len(failed) < FEWEST_FAILURES:
        failed = [record for record in every if not right(record)]
    return round(float(np.mean([not record.answered for record in failed])), 3) if failed else 0.0


def _errors(records: list[Estimate], other: PerceptionModel, strays: bool, swapped: Sequence[Estimate] = ()) -> Errors:
    """Return the spreads: per axis of the normal (two), of the ends (three; of a swapped needle both are as far off as
    the worse one); strays apart."""
    errors = other.wrong if strays else other.right
    if not records and not swapped:
        return errors
    ends = np.array([max(r.tip_error_mm, r.swage_error_mm) for r in records] or [0.0])
    near = [e for r in records for e in (r.tip_error_mm, r.swage_error_mm) if not strays or e < STRAY]
    near += [r.end_error_mm for r in swapped for _ in range(2)]
    turned = [r.normal_error_deg for r in (*records, *swapped)]
    normal = np.array([angle for angle in turned if not strays or angle < 45.0] or [10.0])
    update = {
        "normal_degrees": round(float(np.sqrt((normal**2).mean() / 2.0)), 3),
        "end_millimetres": round(float(np.sqrt((np.array(near or [1.0]) ** 2).mean() / 3.0)), 3),
    }
    if strays:
        update["stray_end_share"] = round(float((ends >= STRAY).mean()), 3)
        update["stray_end_millimetres"] = (
            round(float(np.median(ends[ends >= STRAY])), 2) if (ends >= STRAY).any() else 0.0
        )
    return errors.model_copy(update=update)


def _counts(places: dict[str, list[Estimate]]) -> str:
    parts = []
    for place, found in places.items():
        hits = sum(right(record) for record in found)
        low, high = wilson_interval(hits, len(found))
        parts.append(f"{place} {hits} of {len(found)} right ({100 * low:.0f} to {100 * high:.0f} %)")
    return " " + "; ".join(parts) + "."


def as_toml(model: PerceptionModel) -> str:
    """Return the model as the file that `perception_model` reads."""
    lines = [
        "# How the needle is seen: an error model for the simulator of trials (stages/suture/trials/perception.py)."
    ]
    lines += [f'name = "{model.name}"', f"measured = {str(model.measured).lower()}", 'provenance = """']
    words, line = model.provenance.split(), ""
    for word in words:
        if len(line) + len(word) > 118:
            lines.append(line)
            line = ""
        line = f"{line} {word}".strip()
    lines += [line, '"""']
    lines += [f"{name} = {getattr(model, name)}" for name in ("seconds_an_estimate", "persistence", "systematic")]
    lines += [f"thread_length_error = {model.thread_length_error}"]
    for table in ("right_share", "abstained_share", "right", "wrong"):
        lines += ["", f"[{table}]"]
        values = getattr(model, table).model_dump()
        lines += [f"{name} = {value}" for name, value in values.items() if table != "right" or name in SPREADS]
    return "\n".join(lines) + "\n"


class Options(Parameters):
    """Options of the fit."""

    needle: Path | None = Field(None, description="Output folder of stitch_needle")
    looks: Path | None = Field(None, description="Output folder of stitch_sight, case pictures, instead")
    commit: str = Field(description="Of the estimator that was measured")
    out: Path = Field(FOLDER / "perception_ours.toml", description="File")
    seconds: float = Field(0.2, description="An estimate with its network")
    thread_length_error: float = Field(0.05, description="Relative standard deviation")


def of_needle(folder: Path, commit: str) -> tuple[dict[str, list[Estimate]], str]:
    """Return the views by place and where they come from."""
    records: list[Estimate] = [r for r in kept_records("stitch_needle", folder).values() if r.arm == "ours"]
    seeds = sorted({record.seed for record in records})
    told = (
        f"Measured by python -m benchmarks stitch_needle at commit {commit}, seeds {seeds[0]} to {seeds[-1]}, "
        "fitted by python -m benchmarks.stitch.perception. Masks are the rendered truth spoiled as a learned mask's, "
        "not a network's; elsewhere and tissue are of all views whose place was drawn. An estimate takes 0.13 s of one "
        "core; what a network adds to it, persistence, systematic share and the error of the thread's length are "
        "assumed."
    )
    return by_place(records), told


def of_looks(folder: Path, commit: str) -> tuple[list[Looked], str]:
    """Return the looks of trials by pictures, one trial after the other, and where they come from."""
    kept = kept_records("stitch_sight", folder)
    runs = [run for trial, run in kept.items() if (trial.arm, trial.case) == ("ours", "pictures")]
    seeds, looked = sorted(run.seed for run in runs), [look for run in runs for look in run.looked]
    told = (
        f"Measured by python -m benchmarks stitch_sight --cases pictures at commit {commit}, {len(looked)} looks of "
        f"trials with tuning seeds {seeds[0]} to {seeds[-1]}, fitted by python -m benchmarks.stitch.perception. Masks "
        "are the network's. Shares are of the first look at each needle, persistence of those after it; the left "
        "driver's corner is taken to be as the right one's, systematic share and the error of the thread's length are "
        "assumed."
    )
    return looked, told


def main() -> None:
    """Fit and write."""
    options = asked(Options)
    other = perception_model(FOLDER / "perception_thesis.toml")
    if options.looks is not None:
        looked, told = of_looks(options.looks, options.commit)
        places, other = by_place_looked(looked), other.model_copy(update={"persistence": persistence(looked)})
    elif options.needle is not None:
        places, told = of_needle(options.needle, options.commit)
    else:
        raise UsageError("nothing was measured", hint="--needle FOLDER or --looks FOLDER")
    model = fitted(places, other, options.seconds, options.thread_length_error, told)
    options.out.write_text(as_toml(model), encoding="utf-8")
    perception_model(options.out)
    print(options.out)


if __name__ == "__main__":
    main()
