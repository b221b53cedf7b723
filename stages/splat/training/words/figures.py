"""What an encoder knows of crops that it was not trained on: rooms and models of another library."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from scenewright.stages.kit.open_words.encoder import Encoder
from scenewright.stages.splat.training.words.batches import Crops, Drawer
from scenewright.stages.splat.training.words.lexicon import FALSE, TRUE, Lexicon, Phrase, truth_of
from scenewright.stages.splat.training.words.samples import Samples

CROPS = 1500
"""Crops that a figure is the mean of, at most."""
DISTRACTORS = 15
"""Wrong phrases beside the right one: chance is 1 in 16."""
AT_ONCE = 100
"""Crops that are encoded at once. By eye."""


def figures_of(encoder: Encoder, samples: Samples, words: Lexicon, seed: int = 7) -> dict[str, dict[str, float]]:
    """Return name -> {"share": right one of 16 phrases is the nearest, "count"}. `rooms`, `models`: nothing held out;
    the others are what the training never saw: combinations and styles in pictures, words in texts."""
    random, drawer = np.random.default_rng(seed), Drawer(samples, len(words.classes), "cpu")
    places, own = drawer.places, samples.things[samples.sprite_things]
    held = samples.held[places.things]
    combined = np.zeros(len(own), bool)
    for color, name in words.held_combinations:
        combined |= (own[:, words.number["color", color]] == TRUE) & (own[:, words.number["class", name]] == TRUE)
    kinds = {
        "rooms": drawn(drawer.of_rooms, random.permutation(np.flatnonzero(~held))[:CROPS], samples, random),
        "rooms_held_out": drawn(drawer.of_rooms, random.permutation(np.flatnonzero(held))[:CROPS], samples, random),
    }
    of_models = {
        "models": ~samples.held[samples.sprite_things],
        "held_out_styles": samples.held_style[samples.sprite_things],
        "held_out_combinations": combined,
    }
    for name, mask in of_models.items():
        kinds[name] = drawn(drawer.of_models, random.permutation(np.flatnonzero(mask))[:CROPS], samples, random)
    plain = [np.concatenate(parts) for parts in zip(kinds["rooms"], kinds["models"], strict=True)]
    asks: dict[str, Callable[[np.ndarray], Phrase | None]] = {
        "rooms": lambda row: words.training_phrase(row, random),
        "models": lambda row: words.training_phrase(row, random),
        "held_out_styles": lambda row: _noun(row, words, random),
        "held_out_combinations": lambda row: _combination(row, words),
        "rooms_held_out": lambda row: _noun(row, words, random),
    }
    result = {name: nearest(encoder, *kinds[name], words, random, ask) for name, ask in asks.items()}
    result["held_out_words"] = nearest(encoder, plain[0], plain[1], words, random, lambda row: _held_word(row, words))
    return result


def drawn(
    draw: Callable[[np.ndarray, np.random.Generator], Crops],
    which: np.ndarray,
    samples: Samples,
    random: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Return crops (N, SIDE, SIDE, 3) uint8 and what is true of their main things (N, A)."""
    pictures, rows = [], []
    for start in range(0, len(which), AT_ONCE):
        crops = draw(which[start : start + AT_ONCE], random)
        valid = crops.valid
        pictures.append((crops.pictures[valid].permute(0, 2, 3, 1) * 255 + 0.5).to(torch.uint8).numpy())
        rows.append(samples.things[crops.main[valid].numpy()])
    return np.concatenate(pictures), np.concatenate(rows)


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


def nearest(
    encoder: Encoder,
    pictures: np.ndarray,
    rows: np.ndarray,
    words: Lexicon,
    random: np.random.Generator,
    ask: Callable[[np.ndarray], Phrase | None],
) -> dict[str, float]:
    """Return how often the right phrase is nearest among DISTRACTORS wrong ones of the same making."""
    asked = [(k, phrase) for k, row in enumerate(rows) if (phrase := ask(row)) is not None]
    if not asked:
        return {"share": 0.0, "count": 0}
    pool = [words.phrase(row, random) for row in rows for _ in range(2)]
    pool = [phrase for phrase in pool if not words.is_held_phrase(phrase)]
    pool = list({phrase.text: phrase for phrase in [*pool, *(phrase for _, phrase in asked)]}.values())
    texts = {phrase.text: k for k, phrase in enumerate(pool)}
    vectors = encoder.texts([phrase.text for phrase in pool])
    found = encoder.pictures(pictures)
    truth = truth_of(rows, pool)
    right, count = 0, 0
    for k, phrase in asked:
        wrong = np.flatnonzero(truth[k] == FALSE)
        if len(wrong) < DISTRACTORS:
            continue
        chosen = random.choice(wrong, DISTRACTORS, replace=False)
        right += bool(vectors[texts[phrase.text]] @ found[k] > (vectors[chosen] @ found[k]).max())
        count += 1
    return {"share": round(right / max(count, 1), 4), "count": count}
