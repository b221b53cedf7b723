"""Pages that somebody wrote are short and few, and their sentences are short (docs/WRITING.md)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from statistics import median

import pytest

from tests.contract.readability import prose, sentences, words, words_of

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
MEDIAN, LONGEST = 20, 35
"""Words of a sentence."""


@dataclass(frozen=True)
class Group:
    """Pages that share limits: every page of `folders` below docs/ whose name is not in `apart`."""

    folders: tuple[str, ...]
    most_pages: int
    most_words: int
    apart: tuple[str, ...] = ()

    def pages(self) -> list[Path]:
        found = [page for folder in self.folders for page in sorted((DOCS / folder).glob("*.md"))]
        return [page for page in found if page.name not in self.apart]


RECORDS = ("DECISIONS.md", "LEFT_OUT.md")
REFERENCE = ("FORMATS.md",)
"""Long as what it lists, like the pages that docs/reference.py generates."""
GROUPS = {
    "guides": Group((".", "tutorials"), most_pages=25, most_words=32_000, apart=(*RECORDS, *REFERENCE)),
    "results": Group(("results",), most_pages=13, most_words=12_000),
}
PAGES = [
    ROOT / "README.md",
    *(DOCS / name for name in RECORDS),
    *(page for group in GROUPS.values() for page in group.pages()),
]


@pytest.mark.parametrize("name", GROUPS)
def test_pages_are_few_and_short(name: str) -> None:
    group = GROUPS[name]
    pages = group.pages()
    assert len(pages) <= group.most_pages
    assert sum(words_of(page) for page in pages) <= group.most_words


def test_records_are_short() -> None:
    assert words_of(DOCS / "DECISIONS.md") <= 1_200
    assert words_of(DOCS / "LEFT_OUT.md") <= 1_200
    assert len((ROOT / "CHANGELOG.md").read_text().splitlines()) <= 50


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_sentences_are_short(page: Path) -> None:
    text = page.read_text()
    assert [sentence for sentence in sentences(text) if words(sentence) > LONGEST] == []
    assert median(map(words, prose(text))) <= MEDIAN


@pytest.mark.parametrize("name", REFERENCE)
def test_sentences_of_reference_are_short_outside_of_tables(name: str) -> None:
    text = (DOCS / name).read_text()
    assert [sentence for sentence in prose(text) if words(sentence) > LONGEST] == []


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("One two. Three\nfour five.", [2, 3]),
        ("- Items are apart\n- from others.", [3, 2]),
        ("| a cell | another one; cut here |\n", [2, 2, 2]),
        ("```\nnot read\n```\nRead `scenewright fuse --out x` [here](there.md).", [3]),
        ("<!-- table x\n-->\n| 1 |\n<!-- /table -->\nAt <!--f a:b/c/d-->0.5 m<!--/f--> it ends.", [5]),
        ("Figures such as 0.5 m or e.g. this end nothing.", [10]),
    ],
)
def test_sentences_are_found(text: str, expected: list[int]) -> None:
    assert [words(sentence) for sentence in sentences(text)] == expected
