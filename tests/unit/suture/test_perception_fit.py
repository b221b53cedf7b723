"""The error model that is fitted to measured estimates."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.stages.suture.evaluation.judgement import Estimate
from scenewright.stages.suture.trials.perception import FOLDER, perception_model
from scenewright.stages.suture.trials.sight import Looked

from benchmarks.stitch.perception import as_toml, by_place, by_place_looked, fitted, persistence


def estimate(case: str, seed: int, holder: str = "air", answered: bool = True, wrong: str = "") -> Estimate:
    swapped, stray = wrong == "swapped", wrong == "stray"
    return Estimate(
        arm="ours",
        case=case,
        seed=seed,
        holder=holder,
        place="corner",
        degrees_from_edge_on=40.0,
        seen=0.9,
        answered=answered,
        guessed=True,
        reason="" if answered else "why",
        normal_error_deg=20.0 if stray else 2.0,
        centre_error_mm=3.0 if stray else 0.3,
        tip_error_mm=24.0 if swapped else 1.0,
        swage_error_mm=24.0 if swapped else 12.0 if stray else 1.0,
        end_error_mm=1.0,
        swapped=swapped,
        mahalanobis=4.0,
        tip_probability=0.9,
    )


def records() -> list[Estimate]:
    found = []
    for case in ("geometry_corner_left", "geometry_corner_right", "rendered"):
        found += [estimate(case, seed) for seed in range(16)]
        found += [estimate(case, 16, answered=False), estimate(case, 17, wrong="swapped")]
        found += [estimate(case, 18, wrong="stray"), estimate(case, 19, answered=False)]
    return [*found, *(estimate("geometry", seed, holder="tissue") for seed in range(10))]


def test_shares_and_spreads_are_those_of_the_estimates(tmp_path: Path) -> None:
    thesis = perception_model(FOLDER / "perception_thesis.toml")
    model = fitted(by_place(records()), thesis, 0.2, 0.05, "Measured here and now, for a test.")
    assert model.measured and model.right_share.corner_left == model.right_share.elsewhere == 0.8
    assert model.right_share.tissue == 1.0 and model.abstained_share.tissue == 0.5
    assert model.abstained_share.corner_right == 0.5  # four failures: those of all places count
    assert model.right.normal_degrees == pytest.approx(np.sqrt(2.0), abs=1e-3)
    assert model.right.end_millimetres == pytest.approx(np.sqrt(1.0 / 3.0), abs=1e-3)
    assert model.wrong.stray_end_share == 1.0 and model.wrong.stray_end_millimetres == 12.0
    assert model.wrong.swapped_share == 0.5
    assert model.persistence == thesis.persistence
    path = tmp_path / "model.toml"
    path.write_text(as_toml(model))
    assert perception_model(path).model_dump(exclude={"provenance"}) == model.model_dump(exclude={"provenance"})
    with pytest.raises(ValueError, match="tissue: 0 views"):
        fitted(by_place(records()[:-10]), thesis, 0.2, 0.05, "Measured here and now, for a test.")


def look(place: str, fate: str = "right", again: bool = False) -> Looked:
    return Looked(place, fate, again, estimate("trial", 0, answered=fate != "abstained", wrong=fate))


def test_of_looks_the_first_at_each_needle_gives_the_shares() -> None:
    seen = [look("corner_right"), look("corner_right", "swapped", again=True), look("tissue", "swapped")]
    places = by_place_looked(seen)
    assert [len(places[name]) for name in ("corner_left", "corner_right", "elsewhere", "tissue")] == [1, 1, 0, 1]
    assert places["tissue"][0].swapped


def test_persistence_is_what_chance_does_not_give() -> None:
    apart = [look("tissue"), look("tissue", "swapped")]
    same = [*apart[:1], look("tissue", again=True), *apart[1:], look("tissue", "swapped", again=True)]
    assert persistence(same) == 1.0
    other = [look("tissue"), look("tissue", "swapped", again=True), look("tissue", "right", again=True)]
    assert persistence(other) == 0.0
    with pytest.raises(ValueError, match="again"):
        persistence(apart)
