"""Names of scenes from paths: unique, safe, recognisable, and stable when a glob finds more."""

from __future__ import annotations

from pathlib import Path, PurePath

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenewright.stages.engine.batch.names import (
    as_folder_name,
    distinct,
    is_folder_name,
    matched_part,
    names_from_paths,
)


@pytest.mark.parametrize(
    ("path", "pattern", "name"),
    [
        ("/data/kitchen/log.mcap", "/data/*/log.mcap", "kitchen"),
        ("/data/kitchen.mcap", "/data/*.mcap", "kitchen"),
        ("/data/a/b/log.mcap", "/data/*/*/log.mcap", "a-b"),
        ("/data/a/b/c/log.mcap", "/data/**/log.mcap", "a-b-c"),
        ("/data/log.mcap", "/data/**/log.mcap", "log"),
        ("/data/scene_1/frames", "/data/scene_?/frames", "scene_1"),
        ("../logs/k.v1.mcap", "../logs/*", "k.v1.mcap"),
    ],
)
def test_a_scene_is_named_after_what_the_wildcards_stand_for(path: str, pattern: str, name: str) -> None:
    assert matched_part(PurePath(path), pattern) == name


def test_equal_last_parts_get_the_folders_above(tmp_path: Path) -> None:
    for name in ("a/log.mcap", "b/log.mcap", "b/other.mcap"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("")
    paths = [tmp_path / "a/log.mcap", tmp_path / "b/log.mcap", tmp_path / "b/other.mcap"]
    assert names_from_paths(paths) == ["a-log", "b-log", "other"]
    assert names_from_paths(paths[:1]) == ["log"]


def test_reserved_and_odd_names() -> None:
    assert as_folder_name("results.jsonl") == "results.jsonl_"
    assert as_folder_name("../../etc") == "_.._etc"
    assert as_folder_name("") == "scene" == as_folder_name("...")
    assert as_folder_name("a b/c:d") == "a_b_c_d"
    assert len(as_folder_name("ü" * 500).encode()) <= 100
    for name in ("", ".", "..", ".x", "-x", "a/b", "a\nb", "Slurm", "x" * 201):
        assert not is_folder_name(name)
    assert is_folder_name("kitchen 2 (ü)")


@given(st.lists(st.lists(st.text(min_size=1, max_size=6), min_size=1, max_size=3), min_size=1, max_size=12))
def test_names_are_safe_and_differ_whatever_the_paths(candidates: list[list[str]]) -> None:
    names = distinct(candidates)
    assert len({name.casefold() for name in names}) == len(names)
    assert all(is_folder_name(name) for name in names)


@given(st.text(max_size=300))
def test_any_text_gives_a_folder_name(text: str) -> None:
    assert is_folder_name(as_folder_name(text))
