"""`python -m benchmarks.words.meanings`: fit data/words/meanings.toml.

Pairs are the nouns and groups of the encoder's lexicon with every class of the vocabulary; a pair is right where the
lexicon gives the noun to the class. Of relations by WordNet the share of right pairs counts, with one right and one
wrong pair added (Laplace). Nothing that is reported on was looked at.
"""

from __future__ import annotations

from collections import defaultdict

from scenewright.schemas.places import data_file
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.open_words.reading.meaning import FILE, relation_of
from scenewright.stages.kit.open_words.reading.names import class_named
from scenewright.stages.kit.open_words.reading.nouns import Nouns, nouns
from scenewright.stages.splat import lexicon

CLOSE = ("same", "kind", "broader")
HEAD = """# How likely a thing with a name is what a noun means, layer by layer: {pairs} pairs of a noun and a class,
# written by `python -m benchmarks.words.meanings`.
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


def _table() -> Nouns:
    table = nouns()
    assert table is not None
    return table


def main() -> None:
    """Fit and write."""
    rows = pairs()
    synonyms = [right for noun, name, right in rows if class_named(noun) == name and noun != name.replace("_", " ")]
    by_relation = shares(rows)
    lines = [
        HEAD.format(pairs=len(rows)),
        "[vocabulary]",
        "named = 0.97  # by eye: tables of labels have few errors",
        f"synonym = {(sum(synonyms) + 1) / (len(synonyms) + 2):.3f}",
        "\n[wordnet]",
        *(f"{name} = {value:.3f}" for name, value in by_relation.items()),
        "",
    ]
    data_file(FILE).write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
