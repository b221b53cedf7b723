"""One reading of words: phrases, nouns, meanings, names and how they come together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.errors import UsageError
from scenewright.schemas.panoptic_map import Because, Entity
from scenewright.schemas.scene_parts import Relation
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.open_words.reading.evidence import Names, colors_of, names_of
from scenewright.stages.kit.open_words.reading.matching import (
    ANYTHING,
    LEAST,
    MOST,
    Thing,
    color_probability,
    matches,
    size_probability,
)
from scenewright.stages.kit.open_words.reading.meaning import Meanings, calibration, relation_of
from scenewright.stages.kit.open_words.reading.names import adjectives, class_named, is_noun, singulars, wants
from scenewright.stages.kit.open_words.reading.nouns import anchors, nouns, parsed
from scenewright.stages.kit.open_words.reading.phrase import read_phrase


@pytest.mark.parametrize(
    ("text", "asks", "noun", "rest"),
    [
        ("red mug", "where", ("mug",), {"colors": ("red",)}),
        ("Where is the big white cup?", "where", ("cup",), {"colors": ("white",), "sizes": ("large",)}),
        ("where can I put the cup?", "place", ("cup",), {}),
        ("is there room for a plate", "place", ("plate",), {}),
        ("how many chairs are there", "count", ("chair",), {}),
        ("Is there a kettle here?", "is_there", ("kettle",), {}),
        ("cups or mugs", "where", ("cup", "mug"), {}),
        ("wooden table", "where", ("table",), {"materials": ("wood",)}),
        ("a black and white cup", "where", ("cup",), {"colors": ("black", "white")}),
        ("grandma's old armchair", "where", ("armchair",), {"unread": ("grandma's",)}),
        ("chest of drawers", "where", ("chest of drawers",), {}),
        ("a piece of cake", "where", ("cake",), {}),
        ("jug of water", "where", ("jug",), {"unread": ("of water",)}),
        ("the chair behind the table", "where", ("chair",), {"unread": ("behind the table",)}),
        ("gamepad", "where", ("gamepad",), {}),
        ("office chair", "where", ("office chair",), {}),
    ],
)
def test_phrases_are_read(text: str, asks: str, noun: tuple[str, ...], rest: dict[str, object]) -> None:
    phrase = read_phrase(text)
    assert (phrase.asks, phrase.nouns) == (asks, noun)
    expected = {"colors": (), "sizes": (), "materials": (), "unread": (), "relation": ""} | rest
    assert {name: getattr(phrase, name) for name in expected} == expected


@pytest.mark.parametrize(
    ("text", "thing", "relation", "other"),
    [
        ("cup on the desk", "cup", "on", "desk"),
        ("red mug next to the white bowl", "red mug", "beside", "white bowl"),
        ("box underneath a table", "box", "under", "table"),
        ("Bottle inside the fridge", "bottle", "in", "fridge"),
        ("the cup that is standing on the red table", "cup", "on", "red table"),
        ("what is on the table", "anything", "on", "table"),
        ("something red on the table", "red anything", "on", "table"),
    ],
)
def test_relations_are_read(text: str, thing: str, relation: str, other: str) -> None:
    phrase = read_phrase(text)
    assert phrase.other is not None
    assert (phrase.thing(), phrase.relation, phrase.other.thing()) == (thing, relation, other)


def test_wants_become_what_serves_them() -> None:
    drink = read_phrase("something to drink from on the table")
    assert drink.want == "drink from" and "cup" in drink.nouns and drink.relation == "on"
    assert read_phrase("where can I sit").want == "sit on"
    assert "not understood: until noon" in read_phrase("where can I sit until noon").said()
    for want in wants().values():
        assert all(map(is_noun, want.nouns)), want


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x" * 10_000, "10000 characters"),
        ("", "needs words"),
        ("?!", "needs words"),
        ("где чашка", "not English"),
        ("wo ist die tasse", "hardly a word"),
        ("red", "names no thing"),
        ("the", "names no thing"),
        ("12345", "hardly a word"),
        ("the red blue cup", "red and blue at once"),
        ("small large box", "small and large at once"),
        ("table and chair", "several things"),
    ],
)
def test_what_cannot_be_read_is_said_in_a_line(text: str, said: str) -> None:
    with pytest.raises(UsageError, match=said) as raised:
        read_phrase(text)
    assert "\n" not in str(raised.value) and len(str(raised.value)) < 240 and raised.value.hint


def test_one_line_says_what_was_understood() -> None:
    line = read_phrase("the big wooden cup of my aunt beside the sofa").said()
    assert line == "understood: large cup, beside sofa; not judged: wood; not understood: of my aunt"


def test_plurals() -> None:
    assert "shelf" in singulars("shelves") and "box" in singulars("boxes") and singulars("glass") == ("glass",)
    assert class_named("mugs") == "cup" and class_named("cupboards") == "cabinet" and class_named("quasar") == ""


def test_a_table_of_nouns_in_small() -> None:
    table = parsed("thing\t\nseat\t0\nchair;stool\t1\nchair;president\t0\n")
    assert table.senses("Chair") == (2, 3) and table.senses("sofa") == ()
    assert table.above(2) == {2: 0, 1: 1, 0: 2}
    assert table.anchored("chair < seat") == {2} and table.anchored("chair") == {2, 3}
    assert table.kinds_of((1,)) == {1: [2]}
    with pytest.raises(ValueError, match="not there"):
        parsed("thing\t7\n")


def test_a_circle_of_hypernyms_ends() -> None:
    assert parsed("a\t1\nb\t0\n").above(0) == {0: 0, 1: 1}


def test_every_class_has_a_sense_in_the_table() -> None:
    assert set(anchors()) == {entry.name for entry in load_vocabulary().classes}
    without = [name for name, senses in anchors().items() if not senses]
    assert without == ["object"]


@pytest.mark.parametrize(
    ("noun", "name", "relation"),
    [
        ("couch", "sofa", "same"),
        ("furniture", "chair", "broader"),
        ("armchair", "chair", "kind"),
        ("seat", "sofa", "broader"),
        ("wolf", "chair", "none"),
        ("ottoman", "sofa", "sister"),
    ],
)
def test_relations_of_nouns(noun: str, name: str, relation: str) -> None:
    table = nouns()
    assert table is not None
    assert relation_of(table, noun, name) == relation


def test_layers_speak_one_after_the_other() -> None:
    fit = calibration()
    bare, full = Meanings(with_nouns=False), Meanings()
    assert bare.layers() == ("vocabulary",) and full.layers() == ("vocabulary", "WordNet")
    assert [m.probability for m in bare.of(("cup",), ("cup", "bowl"))] == [fit.named, 0.0]
    assert full.of(("mug",), ("cup",))[0].probability == fit.synonym
    assert full.of(("furniture",), ("chair",))[0] == replace(
        full.of(("furniture",), ("chair",))[0], probability=fit.relations["broader"], layer="wordnet"
    )
    assert bare.of(("furniture",), ("chair",))[0].probability == 0.0
    assert full.of(("cup",), ("object",))[0].probability == 0.0
    assert not full.knows("gizmowatt")


def test_names_are_the_posteriors_of_the_map() -> None:
    entity = Entity(
        instance=3, class_name="cup", mesh="entities/3.ply", vertices=3, triangles=1, box_minimum=(0, 0, 0),
        box_maximum=(1, 1, 1), confidence=1.0, observations=9, segments=(3,),
    )  # fmt: skip
    reason = Because(
        instance=3, shape="masks", looks=40.0, said={"cup": 0.5}, name="rule", posterior=0.9, runners_up={"bowl": 0.06}
    )
    sure = names_of(entity, reason)
    assert dict(sure.shares) == {"bowl": 0.06, "cup": 0.9} and sure.said == 20.0 and not sure.is_doubtful()
    assert names_of(entity, reason.model_copy(update={"looks": 6.0})).is_doubtful()
    assert names_of(entity, reason.model_copy(update={"posterior": 0.6})).is_doubtful()
    nameless = names_of(entity.model_copy(update={"class_name": "object"}), reason)
    assert dict(nameless.shares) == {"bowl": 0.06}
    assert dict(names_of(entity, None).shares) == {"cup": 1.0}
    curtain = reason.model_copy(update={"said": {"curtain": 0.5, "wall": 0.2}, "runners_up": {}, "posterior": 1.0})
    assert dict(names_of(entity.model_copy(update={"class_name": "object"}), curtain).shares) == {"curtain": 0.5}
    assert dict(names_of(entity, curtain).shares) == {"cup": 1.0}


def thing(instance: int, extent: float = 0.1, colors: dict[str, float] | None = None, **shares: float) -> Thing:
    return Thing(instance, Names(shares), colors or {}, extent)


def test_probabilities_are_sums_over_names() -> None:
    fit, meanings = calibration(), Meanings()
    things = [thing(1, cup=0.6, bowl=0.3), thing(2), thing(3, chair=1.0)]
    cup, nothing, chair = matches(read_phrase("cup"), things, meanings)
    by_bowl = meanings.of(("cup",), ("bowl",))[0].probability
    assert cup.probability == pytest.approx(0.6 * fit.named + 0.3 * by_bowl) and cup.name == "cup"
    assert nothing.probability == 0.0 and chair.probability < 0.1
    seats = matches(read_phrase("where can I sit"), things, meanings)
    assert seats[2].probability == pytest.approx(fit.named)
    floor = replace(thing(4, floor=1.0), is_layout=True)
    assert [m.probability for m in matches(read_phrase("red things"), [floor], meanings)] == [0.0]


def test_colours_and_sizes_weigh() -> None:
    assert color_probability({"red": 0.6}, "red") == MOST and color_probability({"blue": 1.0}, "red") == LEAST
    assert color_probability({"red": 0.31}, "red") == pytest.approx(0.5) and color_probability({}, "red") == 0.5
    assert color_probability({"black": 0.3, "white": 0.3}, "white", 2) == MOST
    large, small = thing(1, extent=2.0), thing(2, extent=0.1)
    assert size_probability(large, "", "large") > 0.9 > 0.1 > size_probability(small, "", "large")
    assert size_probability(small, "", "small") == pytest.approx(1 - size_probability(small, "", "large"))
    red, blue = thing(1, colors={"red": 0.9}, cup=1.0), thing(2, colors={"blue": 0.9}, cup=1.0)
    chances = [match.probability for match in matches(read_phrase("red cup"), [red, blue], Meanings())]
    assert chances[0] == pytest.approx(MOST * calibration().named) and chances[1] < 0.1


def test_relations_multiply_both_sides() -> None:
    nodes = tuple(
        GraphNode(id=name, instance=k, class_name=name.split("_")[0], node_type="rigid" if k else "scene")
        for k, name in enumerate(("scene", "table_1", "cup_2", "cup_3", "desk_4"))
    )
    links = [("scene", "table_1"), ("scene", "desk_4"), ("table_1", "cup_2"), ("desk_4", "cup_3")]
    graph = ContactGraphFile(
        nodes=nodes, links=tuple(Relation(source=a, target=b, relation="supports", confidence=1.0) for a, b in links)
    )
    things = [thing(1, table=1.0), thing(2, cup=0.8), thing(3, cup=0.9), thing(4, desk=1.0)]
    found = matches(read_phrase("cup on the table"), things, Meanings(), graph)
    named, as_desk = calibration().named, Meanings().of(("table",), ("desk",))[0].probability
    assert found[1].probability == pytest.approx(0.8 * named * named) and found[1].other == 1
    assert found[2].probability == pytest.approx(0.9 * named * as_desk) and found[0].probability == 0.0
    anything = matches(read_phrase("what is on the table"), things, Meanings(), graph)
    assert anything[1].probability == pytest.approx(ANYTHING * named)


def test_colours_of_a_surface() -> None:
    assert colors_of(np.array([[255, 0, 0]] * 3 + [[0, 0, 255]], np.uint8)) == {"blue": 0.25, "red": 0.75}
    assert colors_of(np.zeros((0, 3), np.uint8)) == {} and set(adjectives()) >= {"red", "big", "wooden"}
