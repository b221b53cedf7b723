"""What an encoder knows of crops that it was not trained on: rooms and models of another library."""

from __future__ import annotations

import numpy as np

from benchmarks.words.lexicon import FALSE, TRUE, Lexicon, Phrase, truth_of
from benchmarks.words.rooms import Furnished
from benchmarks.words.samples import Crop, RoomCrops, composed, rendered_models
from schemas.cad_library import CadLibrary
from stages.kit.open_words.encoder import Encoder

CROPS = 1500
DISTRACTORS = 15
"""Wrong phrases beside the right one: chance is 1 in 16."""
VIEWS = 3


def figures_of(
    encoder: Encoder, rooms: list[Furnished], models: CadLibrary, words: Lexicon, seed: int = 7
) -> dict[str, dict[str, float]]:
    """Return name -> {"share": right one of 16 phrases is the nearest, "count"}. `rooms`: nothing held out; the others
    are what the training never saw: combinations and styles in pictures, words in texts."""
    random = np.random.default_rng(seed)
    crops = RoomCrops(rooms, words, keep_held_out=True)
    free, held = _kinds(crops, words)
    rendered = [(each, words.row(each.thing)) for each in rendered_models([models], VIEWS, seed)]
    plain = [composed(each, crops.frames, row, random) for each, row in rendered if not words.is_held_out(each.thing)]
    styles = [
        composed(each, crops.frames, row, random)
        for each, row in rendered
        if (each.thing.class_name, each.thing.style) in words.held_styles
    ]
    combined = [
        composed(each, crops.frames, row, random)
        for each, row in rendered
        if any((c, each.thing.class_name) in words.held_combinations and share >= 0.5 for c, share in each.thing.colors)
    ]
    seen = _sampled(crops, free, random)
    result = {
        "rooms": _nearest(encoder, seen, words, random, lambda row: words.training_phrase(row, random)),
        "models": _nearest(encoder, plain, words, random, lambda row: words.training_phrase(row, random)),
        "held_out_styles": _nearest(encoder, styles, words, random, lambda row: _noun(row, words, random)),
        "held_out_combinations": _nearest(encoder, combined, words, random, lambda row: _combination(row, words)),
        "held_out_words": _nearest(encoder, [*seen, *plain], words, random, lambda row: _held_word(row, words)),
    }
    if held:
        result["rooms_held_out"] = _nearest(
            encoder, _sampled(crops, held, random), words, random, lambda row: _noun(row, words, random)
        )
    return result


def _kinds(crops: RoomCrops, words: Lexicon) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    places = [place for name in crops.classes for place in crops.places[name]]
    return [p for p in places if not crops.held[p[1]]], [p for p in places if crops.held[p[1]]]


def _sampled(crops: RoomCrops, places: list[tuple[int, int]], random: np.random.Generator) -> list[Crop]:
    chosen = random.permutation(len(places))[:CROPS]
    found = (crops.about(*places[int(k)], random) for k in chosen)
    return [crop for crop in found if crop is not None]


def _noun(row: np.ndarray, words: Lexicon, random: np.random.Generator) -> Phrase:
    own = [k for k, (kind, _) in enumerate(words.attributes) if kind == "class" and row[k] == TRUE]
    free = [text for text in words.nouns(own[0]) if not words.is_held_phrase(Phrase(text, ()))]
    return Phrase(str(random.choice(free)), (own[0],))


def _combination(row: np.ndarray, words: Lexicon) -> Phrase | None:
    for color, name in sorted(words.held_combinations):
        pair = (words.number["color", color], words.number["class", name])
        if all(row[k] == TRUE for k in pair):
            return Phrase(f"{color} {words.nouns(pair[1])[0]}", pair)
    return None


def _held_word(row: np.ndarray, words: Lexicon) -> Phrase | None:
    for k, (kind, _) in enumerate(words.attributes):
        if row[k] == TRUE:
            texts = words.nouns(k) if kind in ("class", "style", "group") else words.adjectives(k)
            for text in texts:
                if words.is_held_phrase(Phrase(text, ())):
                    return Phrase(text, (k,))
    return None


def _nearest(encoder, crops, words, random, ask) -> dict[str, float]:  # type: ignore[no-untyped-def]
    """Return how often the right phrase is nearest among DISTRACTORS wrong ones of the same making."""
    asked = [(crop, phrase) for crop in crops if (phrase := ask(crop.main)) is not None]
    if not asked:
        return {"share": 0.0, "count": 0}
    pool = [words.training_phrase(crop.main, random) for crop in crops for _ in range(2)]
    pool = list({phrase.text: phrase for phrase in [*pool, *(phrase for _, phrase in asked)]}.values())
    texts = {phrase.text: k for k, phrase in enumerate(pool)}
    vectors = encoder.texts([phrase.text for phrase in pool])
    pictures = encoder.pictures(np.stack([crop.picture for crop, _ in asked]))
    truth = truth_of(np.stack([crop.main for crop, _ in asked]), pool)
    right, count = 0, 0
    for k, (_, phrase) in enumerate(asked):
        wrong = np.flatnonzero(truth[k] == FALSE)
        if len(wrong) < DISTRACTORS:
            continue
        chosen = random.choice(wrong, DISTRACTORS, replace=False)
        fits = vectors[chosen] @ pictures[k]
        right += bool(vectors[texts[phrase.text]] @ pictures[k] > fits.max())
        count += 1
    return {"share": round(right / max(count, 1), 4), "count": count}
