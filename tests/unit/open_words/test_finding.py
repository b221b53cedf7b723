"""Where an encoder knows no such images, the names that networks gave answer; one that nobody fitted is a witness."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.language_map import LanguageMap, LanguageMapFile, LanguageRegion
from scenewright.schemas.scene_parts import Box
from scenewright.stages.kit.open_words.finding import Finder, with_witness
from scenewright.stages.kit.open_words.reading.meaning import calibration
from scenewright.stages.kit.open_words.vectors import Vectors, write_vectors

from tests.unit.open_words.stand_ins import ColorEncoder


def box(place: int) -> Box:
    return Box(center=(place, 0, 0), size=(0.1, 0.1, 0.1))


NAMES = ({"cup": 0.9}, {"cup": 0.9}, {"chair": 0.6}, {})
"""Of four pieces, of which the first two belong to one entity."""


@pytest.fixture
def language(tmp_path: Path) -> LanguageMap:
    regions = tuple(
        LanguageRegion(
            instance=k, class_name=next(iter(names), "object"), box=box(n), looks=1, names=names, seen=40, said=20
        )
        for n, (k, names) in enumerate(zip((7, 7, 8, 9), NAMES, strict=True))
    )
    LanguageMapFile(
        source="splat", encoder="colours", width=3, sizes=(0.1,), gaussians=4, steps=0, loss=0.0, regions=regions
    ).write(tmp_path / "language.json")
    vectors = ColorEncoder().texts(("red", "red", "blue", "green"))
    means = np.eye(4, 3, dtype=np.float32)
    write_vectors(
        tmp_path, Vectors(vectors, means, np.ones(4, np.float32), np.array([[0, 1, 2, -1]], np.int32), vectors[:, None])
    )
    return LanguageMap(tmp_path)


def test_names_answer_where_pictures_are_strange(language: LanguageMap) -> None:
    finder = Finder(language, ColorEncoder())
    finder.is_strange = True
    assert finder.by_names
    (cup,) = finder.find("mug")
    assert cup.region == 0
    assert cup.probability == pytest.approx(0.9 * calibration().synonym) and not cup.doubtful
    fits = finder.fits("mug")
    assert fits.gaussians is not None and fits.field is None
    np.testing.assert_allclose(fits.gaussians, fits.probabilities[[0, 1, 2, 3]] * [1, 1, 1, 0])
    assert finder.find("chair")[0].doubtful
    assert finder.cannot_tell("gizmowatt") and not finder.cannot_tell("mug")


def test_without_names_nothing_changes(language: LanguageMap) -> None:
    finder = Finder(language, ColorEncoder())
    finder.has_names = False
    assert not finder.by_names and finder.fits("red").probabilities.argmax() in (0, 1)


def test_an_encoder_that_nobody_fitted_is_one_more_witness(language: LanguageMap) -> None:
    named, looks = np.array([0.5, 0.8, 0.5]), np.array([0.5, 0.8, 0.0])
    np.testing.assert_allclose(with_witness(named, looks), [0.5, 16 / 17, 0.5], atol=1e-6)
    finder = Finder(language, ColorEncoder())
    assert finder.by_names and not finder.is_strange
    assert finder.find("cup")[0].region in (0, 1)
