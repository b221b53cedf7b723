"""`python -m benchmarks.words.nouns NOUNS.jsonl.gz`: write data/words/nouns.txt.gz from Open English WordNet.

Its nouns for what has physical existence, a line a sense, without definitions. Ids of WordNet are left out: senses are
found by their nouns and hypernyms (data/words/anchors.toml).
"""

from __future__ import annotations

import gzip
import io
import json
import sys
from collections import defaultdict
from pathlib import Path

from scenewright.schemas.places import data_file
from scenewright.stages.kit.open_words.reading.nouns import FILE

ROOT = "physical entity"
"""Only what is a kind of this is kept."""


def table_of(source: Path) -> str:
    """Return the text of the table made of WordNet's noun senses, JSON a line with `id`, `members`, `hypernym`."""
    with gzip.open(source, "rt", encoding="utf-8") as stream:
        rows = [json.loads(line) for line in stream]
    below = defaultdict(list)
    for row in rows:
        for above in row["hypernym"]:
            below[above].append(row["id"])
    edge = [row["id"] for row in rows if ROOT in row["members"]]
    kept = set(edge)
    while edge:
        edge = [each for above in edge for each in below[above] if each not in kept]
        kept.update(edge)
    order = [row for row in rows if row["id"] in kept]
    number = {row["id"]: k for k, row in enumerate(order)}
    lines = [
        f"{';'.join(row['members'])}\t{' '.join(str(number[h]) for h in row['hypernym'] if h in number)}"
        for row in order
    ]
    return "\n".join(lines) + "\n"


def main(source: Path) -> None:
    """Write the table, byte for byte the same each time."""
    packed = io.BytesIO()
    with gzip.GzipFile(fileobj=packed, mode="wb", compresslevel=9, mtime=0, filename="") as stream:
        stream.write(table_of(source).encode("utf-8"))
    data_file(FILE).write_bytes(packed.getvalue())


if __name__ == "__main__":
    main(Path(sys.argv[1]))
