"""The embedded encoder, queries as texts, relevancy, calibration."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.stages.kit.open_words.calibration import UNFITTED, Calibration, calibration_of, log_odds, recognised
from scenewright.stages.kit.open_words.embedded import BUNDLED, EmbeddedEncoder
from scenewright.stages.kit.open_words.encoder import check_width, checked_text, unit
from scenewright.stages.kit.open_words.relevancy import CANONICAL, margins, query_rows, relevancy
from scenewright.stages.kit.open_words.two_towers import parts_of, tokens, words_of

from tests.unit.open_words.stand_ins import ColorEncoder


@pytest.fixture(scope="module")
def encoder() -> EmbeddedEncoder:
    return EmbeddedEncoder()


def test_what_comes_with_the_project_is_small_and_says_what_it_has_read(encoder: EmbeddedEncoder) -> None:
    assert BUNDLED.stat().st_size < 5_000_000
    assert {"mug", "red", "fridge"} <= encoder.vocabulary and "settee" not in encoder.vocabulary
    assert encoder.unread("the red settee") == ("settee",) and encoder.unread("a red mug") == ()


def test_vectors_have_length_one_and_are_the_same_again(encoder: EmbeddedEncoder) -> None:
    crops = np.random.default_rng(0).integers(0, 256, (3, encoder.side, encoder.side, 3)).astype(np.uint8)
    pictures, texts = encoder.pictures(crops), encoder.texts(("red mug", "mug red", ""))
    for found in (pictures, texts):
        assert found.shape == (3, encoder.width)
        np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-5)
    np.testing.assert_array_equal(EmbeddedEncoder().pictures(crops), pictures)
    assert encoder.pictures(crops[:0]).shape == (0, encoder.width)


def test_a_red_thing_is_nearer_to_red_than_a_blue_one(encoder: EmbeddedEncoder) -> None:
    y, x = np.mgrid[: encoder.side, : encoder.side]
    disc = (np.hypot(y - 15.5, x - 15.5) < 10)[..., None]
    crops = [np.where(disc, color, (200, 200, 198)).astype(np.uint8) for color in ((190, 50, 45), (60, 105, 175))]
    pictures = encoder.pictures(np.stack(crops))
    fits = pictures @ encoder.texts(("red thing", "blue thing")).T
    assert fits[0, 0] > fits[1, 0] and fits[1, 1] > fits[0, 1]


def test_a_word_is_its_parts_and_texts_may_be_long() -> None:
    assert words_of("The Red-mug, 2!") == ["the", "red", "mug", "2"]
    assert len(set(parts_of("bookcase")) & set(parts_of("book"))) >= 2
    assert tokens(("word " * 40,)).shape == tokens(("word",)).shape


@pytest.mark.parametrize(
    ("text", "message"), [("", "needs words"), (" ?! ", "needs words"), ("x" * 10_000, "10000 characters")]
)
def test_texts_that_ask_for_nothing_are_refused(text: str, message: str) -> None:
    with pytest.raises(UsageError, match=message) as error:
        checked_text(text)
    assert len(str(error.value)) < 200
    assert checked_text("  red \n mug ") == "red mug"


def test_words_in_other_letters_are_refused_and_foreign_ones_named(encoder: EmbeddedEncoder) -> None:
    for text in ("красная кружка", "红色杯子"):
        with pytest.raises(UsageError, match="English") as error:
            encoder.texts((text, "object"))
        assert len(str(error.value)) < 200
    assert encoder.unread("rote Tasse") == ("rote", "tasse")
    assert encoder.texts(("rote Tasse",)).shape == (1, encoder.width)


def test_an_encoder_of_another_width_is_one_line(encoder: EmbeddedEncoder) -> None:
    with pytest.raises(BadInput, match="512 wide.*64 wide") as error:
        check_width(encoder, 512, "clip", "language")
    assert "\n" not in str(error.value)
    check_width(encoder, encoder.width, encoder.label, "language")


@pytest.mark.parametrize(
    "damage", [lambda data: data[:1000], lambda data: data.replace(b"two towers", b"one towers"), lambda data: b""]
)
def test_damaged_files_are_refused(damage, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "weights.safetensors"
    path.write_bytes(damage(BUNDLED.read_bytes()))
    with pytest.raises(BadInput, match="weights.safetensors"):
        EmbeddedEncoder(path)


def test_relevancy_is_lerfs() -> None:
    stand_in, random = ColorEncoder(), np.random.default_rng(0)
    features, rows = unit(random.normal(size=(20, 3))), query_rows(stand_in, "red")
    assert len(rows) == 1 + len(CANONICAL)
    shares = [
        [np.exp(10 * f @ rows[0]) / (np.exp(10 * f @ rows[0]) + np.exp(10 * f @ c)) for c in rows[1:]] for f in features
    ]
    np.testing.assert_allclose(relevancy(margins(features, rows)), np.min(shares, axis=1), rtol=1e-4)
    assert margins(features.reshape(4, 5, 3), rows).shape == (4, 5)


def test_probabilities_rise_with_relevancy_and_unseen_regions_have_none(tmp_path: Path) -> None:
    fitted = Calibration(-1.0, 1.0, 0.5, 0.0, 0.0)
    looks, field = np.array([0.0, 0.2, 0.8]), np.array([0.9, 0.5, 0.5])
    found = fitted.probabilities(looks, field, np.ones(3))
    assert found[0] == 0 and 0 < found[1] < found[2] < 1
    np.testing.assert_allclose(UNFITTED.probabilities(looks, None, np.ones(3)), looks)
    np.testing.assert_allclose(log_odds(np.array([0.5, 2.0])), [0, np.log(0.9999 / 1e-4)], rtol=1e-6)
    path = tmp_path / "calibration.toml"
    path.write_text(
        'fit = [{source="splat", encoder="e", bias=1, looks=2, field=3, extent=0, extent_squared=0, class_bias=0, '
        "class_name=0, least_recognised=0.1, strange=0.2}]"
    )
    assert calibration_of("splat", "e", path).looks == 2 and calibration_of("splat", "e", path).strange == 0.2
    assert calibration_of("splat", "other", path) == UNFITTED
    path.write_text('fit = [{source="splat", encoder="e", bias=1}]')
    with pytest.raises(BadInput, match="lacks"):
        calibration_of("splat", "e", path)


def test_a_place_is_recognised_by_how_near_it_is_to_names() -> None:
    class Names(ColorEncoder):
        """Knows chairs (red) and tables (green)."""

        def texts(self, texts: Sequence[str]) -> np.ndarray:
            known = {"chair": (1.0, 0.0, 0.0), "table": (0.0, 1.0, 0.0)}
            return unit(np.array([known[text] for text in texts], np.float32))

        def unread(self, text: str) -> tuple[str, ...]:
            return tuple(word for word in text.split() if word not in ("chair", "table"))

    near, far = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    regions, extents = np.stack([near, far, np.zeros(3)]), np.array([1.0, 3.0, 9.0])
    assert recognised(regions, extents, Names()) == pytest.approx(0.25)
    assert recognised(regions[2:], extents[2:], Names()) == 0.0
    assert recognised(regions[:1], extents[:1], Names()) == pytest.approx(1.0)
