"""The page stands alone, is well-formed, escapes what logs say, and is written whole or not at all."""

from __future__ import annotations

import os
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from scenewright.schemas.errors import MachineFailure
from scenewright.stages.ingest.preflight.page import render, write_page
from scenewright.stages.ingest.preflight.text import as_text

from benchmarks.experiments.preflight.faults import FAULTS
from tests.unit.ingest.preflight.textured_room import inspected, source

VOID = {"meta", "img", "br", "hr", "link", "input"}


class Balanced(HTMLParser):
    """Fails on tags that do not close in order; collects what the page refers to."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.references: list[str] = []
        self.tags: set[str] = set()

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.references += [value or "" for name, value in attributes if name in ("src", "href", "srcset", "data")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open and self.open[-1] == tag, f"</{tag}> closes {self.open[-3:]}"
        self.open.pop()


def checked(text: str) -> Balanced:
    page = Balanced()
    page.feed(text)
    assert not page.open
    assert all(reference.startswith("data:image/") for reference in page.references)
    assert "script" not in page.tags and "@import" not in text and not re.search(r"url\(", text)
    return page


def test_page_of_a_good_and_of_a_bad_log() -> None:
    good = render(inspected(source(20), keep_pictures=True))
    page = checked(good)
    assert {"svg", "img", "table"} <= page.tags and "ready" in good
    bad = render(inspected(FAULTS["inverse poses"][0](source(20)), keep_pictures=True))
    checked(bad)
    assert "wasted" in bad and "--pose-convention inverse" in bad and "the worst pair" in bad


@pytest.mark.parametrize("options", [{"depth": False}, {"color": False}, {"posed": False}], ids=str)
@pytest.mark.parametrize("count", [0, 1, 12])
def test_page_of_incomplete_logs(count: int, options: dict) -> None:
    found = inspected(source(count, **options), keep_pictures=True)
    checked(render(found))
    assert as_text(found.report).startswith("verdict")


def test_same_log_same_bytes() -> None:
    assert len({render(inspected(source(14), keep_pictures=True)) for _ in range(2)}) == 1


def test_what_logs_say_is_escaped() -> None:
    nasty = "<script>alert(1)</script>"
    what = source(3, rule=nasty, notes=(nasty,), damage=(nasty,), other_cameras=(nasty,))
    text = render(inspected(what, keep_pictures=True))
    checked(text)
    assert "<script>" not in text and "&lt;script&gt;" in text


def test_page_is_whole_or_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = inspected(source(3))
    target = tmp_path / "new" / "page.html"
    write_page(found, target)
    before = target.read_text()
    assert [path.name for path in target.parent.iterdir()] == ["page.html"]

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(MachineFailure, match="No space left"):
        write_page(found, target)
    assert target.read_text() == before and [path.name for path in target.parent.iterdir()] == ["page.html"]
