"""Goals in words name nodes."""

from __future__ import annotations

from pathlib import Path

import pytest
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.language_map import LanguageMap, LanguageMapFile, LanguageRegion
from scenewright.schemas.scene_parts import Box
from scenewright.stages.kit.open_words.vectors import of_regions, write_vectors
from scenewright.stages.plan import open_goals
from scenewright.stages.plan.open_goals import has_words, named_goal

from tests.unit.open_words.stand_ins import ColorEncoder

OBJECTS = {"cup_1": "item", "cup_2": "item", "table_3": "surface"}


@pytest.fixture
def language(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> LanguageMap:
    monkeypatch.setattr(open_goals, "EmbeddedEncoder", ColorEncoder)
    box = Box(center=(0, 0, 0), size=(0.1, 0.1, 0.1))
    LanguageMapFile(
        source="panoptic_map",
        encoder="colours",
        width=3,
        sizes=(),
        gaussians=0,
        steps=0,
        loss=0.0,
        regions=tuple(LanguageRegion(instance=k, class_name="thing", box=box, looks=2) for k in (1, 2, 3)),
    ).write(tmp_path / "language.json")
    write_vectors(tmp_path, of_regions(ColorEncoder().texts(("red", "blue", "red"))))
    return LanguageMap(tmp_path)


def graph() -> ContactGraphFile:
    nodes = [GraphNode(id=name, instance=k, class_name="thing", node_type="rigid") for k, name in enumerate(OBJECTS, 1)]
    return ContactGraphFile(nodes=tuple(nodes), links=())


def test_words_name_what_may_stand_there(language: LanguageMap) -> None:
    goal = ('on("red", table_3)', 'on("blue","red")', "on(cup_1,table_3)")
    assert has_words(goal) and not has_words(goal[2:])
    named = named_goal(goal, OBJECTS, graph(), language)
    assert named == ("on(cup_1, table_3)", named[1], "on(cup_1,table_3)")
    assert named[1].startswith("on(cup_2,")


def test_what_the_scene_has_not_is_said(language: LanguageMap) -> None:
    with pytest.raises(UsageError, match="the scene has no 'green'.*is the likeliest"):
        named_goal(('on("green",table_3)',), OBJECTS, graph(), language)
    with pytest.raises(UsageError, match="in open words"):
        named_goal(('on("red",table_3)',), OBJECTS, graph(), None)
    with pytest.raises(UsageError, match="10000 characters"):
        named_goal((f'on("{"x" * 10_000}",table_3)',), OBJECTS, graph(), language)
    other = ContactGraphFile(nodes=(GraphNode(id="cup_9", instance=9, class_name="cup", node_type="rigid"),), links=())
    with pytest.raises(BadInput, match="none of its places"):
        named_goal(('on("red",cup_9)',), {"cup_9": "item"}, other, language)


def test_a_word_that_was_never_read_is_unknown(language: LanguageMap, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(open_goals, "LEAST_PROBABILITY", 0.6)
    with pytest.raises(UsageError, match="whether the scene has 'red guitar' is unknown, .* never read 'guitar': cup_"):
        named_goal(('on("red guitar",table_3)',), OBJECTS, graph(), language)


def test_a_class_that_the_scene_names_is_taken_at_its_word(
    language: LanguageMap, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The encoder of colours knows no table and no cup: what the map calls so is meant; more words need likeness."""
    monkeypatch.setattr(open_goals, "LEAST_PROBABILITY", 0.6)
    classes = zip(OBJECTS, ("cup", "cup", "coffee_table"), strict=True)
    nodes = tuple(
        GraphNode(id=name, instance=k, class_name=each, node_type="rigid") for k, (name, each) in enumerate(classes, 1)
    )
    named = named_goal(('on("cup","coffee table")',), OBJECTS, ContactGraphFile(nodes=nodes, links=()), language)
    assert named[0].endswith(",table_3)") and named[0].startswith("on(cup_")
    with pytest.raises(UsageError, match="'purple cup' is unknown, .* never read 'purple', 'cup': cup_"):
        named_goal(('on("purple cup","coffee table")',), OBJECTS, ContactGraphFile(nodes=nodes, links=()), language)
