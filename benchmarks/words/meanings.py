"""`python -m benchmarks.words.meanings [--sentences FOLDER]`: fit data/words/meanings.toml.

Pairs are the nouns and groups of the encoder's lexicon with every class of the vocabulary; a pair is right where the
lexicon gives the noun to the class. Of relations by WordNet the share of right pairs counts, with one right and one
wrong pair added (Laplace). The sentence encoder's logistic function is fitted where WordNet knows no close relation;
its probabilities end where the surest tenth of its pairs is right. Nothing that is reported on was looked at.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path

import numpy as np
from scenewright.schemas.places import data_file
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.open_words.reading.meaning import FILE, relation_of
from scenewright.stages.kit.open_words.reading.names import class_named
from scenewright.stages.kit.open_words.reading.nouns import Nouns, nouns
from scenewright.stages.kit.open_words.reading.sentences import SentenceEncoder, installed_sentences
from scenewright.stages.splat import lexicon
from scipy.optimize import minimize

CLOSE = ("same", "kind", "broader")
SUREST = 0.01
"""Share of the pairs whose cosine is highest: their share of right ones bounds the layer."""
HEAD = """# How likely a thing with a name is what a noun means, layer by layer: {pairs} pairs of a noun and a class,
# {encoder}. Written by `python -m benchmarks.words.meanings`.
"""


def pairs() -> list[tuple[str, str, bool]]:
    """Return noun, class, and whether the lexicon gives the noun to the class."""
    table = lexicon().table
    classes = [entry.name for entry in load_vocabulary().classes if entry.name in table["nouns"]]
    given = defaultdict(set)
    for name, words in table["nouns"].items():
        for word in words:
            given[word].add(name)
    for group, members in table["groups"].items():
        given[group].update(members)
    for name, styles in table["styles"].items():
        for words in styles.values():
            for word in words:
                given[word].add(name)
    return [(noun, name, name in right) for noun, right in sorted(given.items()) for name in classes]


def shares(rows: list[tuple[str, str, bool]]) -> dict[str, float]:
    """Return relation by WordNet -> share of right pairs."""
    told: dict[str, list[bool]] = defaultdict(list)
    for noun, name, right in rows:
        told[relation_of(_table(), noun, name)].append(right)
    return {each: (sum(told[each]) + 1) / (len(told[each]) + 2) for each in (*CLOSE, "sister", "cousin", "none")}


def logistic(cosines: np.ndarray, right: np.ndarray) -> tuple[float, float, float]:
    """Return bias, slope and the most that is believed of cosines (N,) with right (N,) bool."""

    def loss(x: np.ndarray) -> float:
        odds = x[0] + x[1] * cosines
        return float(np.mean(np.logaddexp(0, np.where(right, -odds, odds))))

    bias, slope = minimize(loss, np.array([-5.0, 5.0])).x
    surest = np.argsort(-cosines)[: max(10, int(SUREST * len(cosines)))]
    return float(bias), float(slope), float((right[surest].sum() + 1) / (len(surest) + 2))


def _table() -> Nouns:
    table = nouns()
    assert table is not None
    return table


def main(folder: Path) -> None:
    """Fit and write."""
    rows = pairs()
    synonyms = [right for noun, name, right in rows if class_named(noun) == name and noun != name.replace("_", " ")]
    by_relation = shares(rows)
    encoder = SentenceEncoder(folder)
    far = [row for row in rows if relation_of(_table(), row[0], row[1]) not in CLOSE]
    first, second = encoder.texts([noun for noun, _, _ in far]), encoder.texts([n.replace("_", " ") for _, n, _ in far])
    bias, slope, most = logistic((first * second).sum(axis=1), np.array([right for _, _, right in far]))
    lines = [
        HEAD.format(pairs=len(rows), encoder=encoder.label),
        "[vocabulary]",
        "named = 0.97  # by eye: tables of labels have few errors",
        f"synonym = {(sum(synonyms) + 1) / (len(synonyms) + 2):.3f}",
        "\n[wordnet]",
        *(f"{name} = {value:.3f}" for name, value in by_relation.items()),
        "\n[sentences]",
        f"bias = {bias:.3f}\nslope = {slope:.3f}\nmost = {most:.3f}\n",
    ]
    data_file(FILE).write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sentences", type=Path, default=installed_sentences(), help="folder of all-MiniLM-L6-v2")
    main(parser.parse_args().sentences)
