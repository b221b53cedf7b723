"""Goals in sentences: what is read of them, and what they are said to lack."""

from __future__ import annotations

import json
import re

import pytest
from scenewright.stages.kit.predicates.goal_sentences import read_goal

from tests.real_data import real_data

TAUGHT = ("stack <1> on <2>", "put <1> on the table", "put <1> in <2>", "pour water into <1>")
THINGS = ("shelf", "fruitcan", "coaster", "tomatocan", "plate", "placemat", "candybar", "bread")
COOKING = ("pot", "cup", "tallcup", "sausage", "fish")


def said(sentence: str, names: tuple[str, ...] = THINGS, known: tuple[str, ...] = TAUGHT) -> list[str]:
    """Return a goal in the phrases that were taught."""
    reading = read_goal(sentence, names, known)
    assert not reading.lacking, reading.lacking
    texts = []
    for text, objects in reading.parts:
        for number, name in enumerate(objects, start=1):
            text = text.replace(f"<{number}>", name)
        texts.append(text)
    return texts


TOWER = ["stack coaster on shelf", "stack fruitcan on coaster", "stack tomatocan on fruitcan"]


@pytest.mark.parametrize(
    "sentence",
    [
        "Stack coaster, fruitcan and tomatocan on shelf in order.",
        "Stack coaster, fruitcan, and tomatocan on the shelf.",
        "From top to bottom, stack tomatocan, fruitcan and coaster on shelf",
        "Store coaster, fruitcan, tomatocan on shelf from bottom to top",
        "Put objects on the shelf in the following order: coaster, fruitcan, tomatocan (bottom to top)",
        "Build a tower of coaster, fruitcan and tomatocan on shelf",
        "Store all objects on shelf with the order from bottom to top: coaster, fruitcan, tomatocan",
        "Put coaster, fruitcan and tomatocan on shelf, one on top of another",
        "coaster on shelf, fruitcan on coaster; the tomato can on top of the fruit can!",
        "On the shelf put the coaster, then put fruitcan onto coaster and tomatocan onto fruitcan",
    ],
)
def test_orders_are_towers(sentence: str) -> None:
    assert said(sentence) == TOWER


@pytest.mark.parametrize(
    ("sentence", "goals"),
    [
        ("Put bread and candybar on plate", ["stack bread on plate", "stack candybar on plate"]),
        ("Stack tomatocan on fruitcan on shelf", ["stack tomatocan on fruitcan", "stack fruitcan on shelf"]),
        ("Put fruitcan and coaster on the table", ["put fruitcan on the table", "put coaster on the table"]),
        ("Put bread on the table in order", ["put bread on the table"]),
        ("Move the fruit can from the shelf to the table", ["put fruitcan on the table"]),
        (
            "Set the table for breakfast: plate on placemat, candy bar on plate.",
            ["stack plate on placemat", "stack candybar on plate"],
        ),
        (
            "Set up a breakfast table with plate on placemat, bread on plate and candybar on bread",
            ["stack plate on placemat", "stack bread on plate", "stack candybar on bread"],
        ),
        (
            "Stack bread and candybar on plate on placemat",
            ["stack bread on plate", "stack candybar on bread", "stack plate on placemat"],
        ),
        ("For breakfast, serve bread on plate", ["stack bread on plate"]),
        ("Please make sure that bread is on the plate for dinner", ["stack bread on plate"]),
    ],
)
def test_things_are_wanted_where_the_words_say(sentence: str, goals: list[str]) -> None:
    assert said(sentence) == goals


@pytest.mark.parametrize(
    ("sentence", "goals"),
    [
        ("Pour water into cup on the table.", ["pour water into cup", "put cup on the table"]),
        ("Fill the pot with water and put sausage in it", ["pour water into pot", "put sausage in pot"]),
        ("Cook sausage and fish in pot with water", ["pour water into pot", "put sausage in pot", "put fish in pot"]),
        ("Pour water into pot and sausage in pot", ["pour water into pot", "put sausage in pot"]),
        ("Cook sausage with water in pot", ["put sausage in pot", "pour water into pot"]),
        ("The pot should have water and be on the table", ["pour water into pot", "put pot on the table"]),
        ("Get water from the faucet with tall cup", ["pour water into tallcup"]),
        (
            "Pour water into pot and tallcup on the table",
            ["pour water into pot", "pour water into tallcup", "put pot on the table", "put tallcup on the table"],
        ),
    ],
)
def test_water_is_wanted_in_things(sentence: str, goals: list[str]) -> None:
    assert said(sentence, COOKING) == goals


@pytest.mark.parametrize(
    ("sentence", "lacks"),
    [
        ("hide bread behind shelf", "'hide' is neither an object here"),
        ("do not put bread on shelf", "'do' is neither"),
        ("put basket on shelf", "'basket' is neither an object here .*bread"),
        ("put bread on shelf or plate", "'or' is neither"),
        ("put everything on the table", "'everything' names no object"),
        ("Put coaster on shelf and fruitcan on it", "'it' may be coaster or shelf"),
        ("Put bread on plate and candybar", "candybar: on or in what"),
        ("Stack bread and candybar", "bread, candybar: on or in what"),
        ("add bread to plate", "'to' says neither on nor in"),
        ("plate holds bread on the table", "'holds' is read of water alone"),
        ("put bread on", "bread: on what"),
        ("Set the table for breakfast", "does not say what is wanted where"),
        ("", "does not say what is wanted where"),
        ("stack bread on bread", "on or in itself"),
        ("on(bread, plate)", r"'\(' is neither"),
        ("pour water on the table", "water is wanted in things"),
    ],
)
def test_what_is_not_read_says_what_it_lacks(sentence: str, lacks: str) -> None:
    reading = read_goal(sentence, THINGS, TAUGHT)
    assert not reading.parts
    assert re.search(lacks, reading.lacking), reading.lacking


def test_what_nobody_explained_is_named() -> None:
    assert read_goal("pour water into coaster", THINGS, TAUGHT[:1]).lacking == (
        "nobody has said what 'pour water into <1>' means"
    )
    lacking = read_goal("Stack bread on plate, plate on the table", THINGS, TAUGHT[:1]).lacking
    assert lacking == "nobody has said what '<1> on the table' means"


def test_phrases_of_rooms_are_taken_at_their_word() -> None:
    rooms, names = ("put <1> on <2>", "open <1>"), ("bottle_7", "table_3", "drawer_1")
    assert said("open drawer_1 and put the bottle_7 onto table_3", names, rooms) == [
        "open drawer_1",
        "put bottle_7 on table_3",
    ]


def test_every_sentence_of_the_authors_training_tasks_is_read_as_they_mean_it() -> None:
    wording = dict(zip(("on", "on_table", "inside_container", "has_water"), TAUGHT, strict=True))
    files = sorted(real_data("interpret").rglob("train.json"))
    assert len(files) == 3
    for file in files:
        for task in json.loads(file.read_text()).values():
            reading = read_goal(task["goal_text"], task["objects"], TAUGHT)
            wanted = {(wording[name], tuple(objects)) for name, *objects in task["goal_lits_gt"]}
            assert set(reading.parts) == wanted, task["goal_text"]
