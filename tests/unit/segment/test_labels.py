"""Label tables, words, and what becomes of a network's segments."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.schemas.vocabulary import VOCABULARY_FILE, load_vocabulary
from scenewright.stages.kit.labels import (
    LABEL_FILES,
    LABELS_FOLDER,
    Label,
    class_of_word,
    load_label_set,
    match_labels,
    parse_words,
    read_label_file,
)
from scenewright.stages.segment.coco import COCO_NAMES
from scenewright.stages.segment.naming import InstanceMask, NamedSegment, name_instances, name_segments

VOCABULARY = load_vocabulary()


def test_every_table_is_listed_and_every_mapping_names_a_class() -> None:
    files = {path.relative_to(LABELS_FOLDER.parent).as_posix() for path in LABELS_FOLDER.glob("*.toml")}
    assert files == set(LABEL_FILES.values())
    for name in LABEL_FILES:
        for label in load_label_set(name).labels:
            assert not label.class_name or VOCABULARY.by_name(label.class_name)


def test_sizes_of_the_published_sets() -> None:
    coco, ade = load_label_set("coco-panoptic").labels, load_label_set("ade20k").labels
    assert [sum(label.kind == kind for label in coco) for kind in ("thing", "stuff")] == [80, 53]
    assert [sum(label.kind == kind for label in ade) for kind in ("thing", "stuff")] == [100, 50]
    assert [label.id for label in ade] == list(range(1, 151))
    assert tuple(label.name for label in load_label_set("coco-80").labels) == COCO_NAMES
    gaps = set(range(1, 91)) - {label.id for label in load_label_set("coco-80").labels}
    assert gaps == {12, 26, 29, 30, 45, 66, 68, 69, 71, 83}


@pytest.mark.parametrize(("name", "source"), [("coco-panoptic", "coco"), ("ade20k", "ade20k")])
def test_tables_agree_with_the_aliases_of_the_vocabulary(name: str, source: str) -> None:
    for label in load_label_set(name).labels:
        alias = VOCABULARY.by_alias(label.name, source)
        assert alias is None or alias.name == label.class_name, label


def test_the_thesis_mapping_of_coco_is_kept() -> None:
    # Its numbers have the background after the 80 things: those of stuff are one too high for a list of 133 labels.
    by_position = [label.class_name for label in load_label_set("coco-panoptic").labels]
    floor, wall = (123, 88, 97, 98, 101, 124), (132, 110, 111, 112, 113)
    published = {"table": (122,), "cabinet": (121,), "floor": floor, "wall": wall, "ceiling": (119,)}
    for name, numbers in published.items():
        assert by_position[60] == "table" and [by_position[k - 1] for k in numbers] == [name] * len(numbers), name


def test_labels_are_matched_by_name_not_by_position() -> None:
    names = {7: "table-merged", 3: "Chair", 250: "wall-other-merged", 0: "N/A", 11: "quark", 5: "river", 6: "wall"}
    matched = match_labels(names, where="net")
    assert matched.set_name == "coco-panoptic" and matched.unknown == ("quark",)
    assert {number: label.class_name for number, label in matched.labels.items()} == {
        7: "table",
        3: "chair",
        250: "wall",
        5: "",
        6: "wall",
    }
    assert matched.stuff() == {5, 6, 7, 250}
    few = match_labels({0: "chair", 1: "table"}, where="net")
    assert few.set_name == "scenewright" and not few.stuff()  # somebody's own network: every table is one
    long = match_labels({0: "windowpane, window", 1: "rock, stone", 2: "window "}, where="net")
    assert long.set_name == "ade20k" and long.labels[0] == long.labels[2] and not long.unknown
    with pytest.raises(BadInput, match="LABEL_0.*no table"):
        match_labels({0: "LABEL_0", 1: "LABEL_1"}, where="net")


def test_a_name_comes_before_what_others_are_also_called() -> None:
    """ADE20K calls plates what the vocabulary had bowls for, before it had plates."""
    label = load_label_set("scenewright").find("plate")
    assert label is not None and label.class_name == "plate"


def test_words() -> None:
    labels = parse_words(["mug", " night stand ", "abacus", "blue thing = box  # a comment", "", "# nothing"], "words")
    assert [(label.name, label.class_name) for label in labels] == [
        ("mug", "cup"),
        ("night stand", "cabinet"),
        ("abacus", "object"),
        ("blue thing", "box"),
    ]
    assert class_of_word("Dining_Table") == "table"
    for words, text in (
        (["cup = crockery"], "crockery"),
        ([], "no words"),
        (["cup", "Cup"], "twice"),
        (["x" * 101], "101"),
    ):
        with pytest.raises(BadInput, match=text):
            parse_words(words, "words")


def test_own_label_files(tmp_path: Path) -> None:
    table = tmp_path / "mine.toml"
    table.write_text('name = "mine"\nlabels = [{ name = "Becher", class = "cup", id = 3 }, { name = "Rest" }]\n')
    mine = read_label_file(table)
    found = mine.by_id(3)
    assert (
        mine.name == "mine"
        and found is not None
        and found.class_name == "cup"
        and mine.find("rest") == Label(name="Rest")
    )
    words = tmp_path / "words.txt"
    words.write_text("cup\nchair\n")
    assert [label.class_name for label in read_label_file(words).labels] == ["cup", "chair"]
    for text, reason in (
        ('labels = [{ name = "a", class = "unicorn" }]', "unicorn"),
        ('labels = [{ name = "a" }, { name = "A" }]', "twice"),
        ('labels = [{ name = "a", id = 1 }, { name = "b", id = 1 }]', "id 1"),
        ('labels = [{ title = "a" }]', "title|name"),
        ('labels = [{ name = "a", kind = "gas" }]', "kind"),
        ("labels = 3", "no table of labels"),
        ("labels = [3]", "no table of labels"),
        ("rows = []", "no table of labels"),
        ("labels = [", "line|Invalid|end of document"),
    ):
        table.write_text(text)
        with pytest.raises(BadInput, match=reason):
            read_label_file(table)
    words.write_bytes(b"\xff\xfe")
    with pytest.raises(BadInput, match="UTF-8"):
        read_label_file(words)
    with pytest.raises(BadInput):
        read_label_file(tmp_path / "none.txt")


def test_segments_take_classes() -> None:
    ids = np.zeros((6, 10), dtype=int)
    ids[:, :2], ids[:2, 4:6], ids[4:, 4:6], ids[0, 9], ids[:3, 7], ids[5, 9] = 1, 2, 2, 2, 3, 4
    cabinet = load_label_set("coco-panoptic").find("cabinet-merged")
    wall, river = (load_label_set("coco-panoptic").find(name) for name in ("wall-brick", "river"))
    wood = load_label_set("coco-panoptic").find("wall-wood")
    assert cabinet and wall and river and wood
    found = name_segments(
        ids,
        {
            1: NamedSegment(wall, 0.5),
            2: NamedSegment(cabinet, 0.7),
            3: NamedSegment(wood, 0.9),
            4: NamedSegment(river, 1),
        },
        VOCABULARY,
        minimum_pixels=2,
    )
    wall_id, cabinet_id = VOCABULARY.by_name("wall").id, VOCABULARY.by_name("cabinet").id
    assert [(m.class_id, m.is_thing, m.score) for m in found.masks.values()] == [
        (wall_id, False, 0.9),
        (cabinet_id, True, 0.7),
        (cabinet_id, True, 0.7),
    ]
    assert found.ids[0, 0] == found.ids[0, 7] == 1  # one wall, of two kinds of wall
    assert found.ids[0, 4] == 2 and found.ids[5, 4] == 3  # two cabinets
    assert found.ids[0, 9] == 0 and found.ids[5, 9] == 0  # too small, no class


def test_overlapping_instances() -> None:
    cup, table = (load_label_set("coco-80").find(name) for name in ("cup", "dining table"))
    assert cup and table
    top, on_it, again, hidden = np.zeros((4, 6, 10), dtype=bool)
    top[:, :8], on_it[2:4, 2:4], again[2:4, 2:5], hidden[0, 0] = True, True, True, True
    found = name_instances(
        [
            InstanceMask(top, table, 0.9),
            InstanceMask(on_it, cup, 0.5),
            InstanceMask(again, cup, 0.4),  # the same cup, less sure
            InstanceMask(hidden, cup, 0.8),  # too small
            InstanceMask(np.zeros_like(top), cup, 0.99),
        ],
        (6, 10),
        VOCABULARY,
        minimum_pixels=2,
    )
    assert [(VOCABULARY.by_id(m.class_id).name, m.score) for m in found.masks.values()] == [
        ("table", 0.9),
        ("cup", 0.5),
    ]
    assert (found.ids == 2).sum() == 4 and found.ids[2, 2] == 2 and found.ids[0, 0] == 0 and found.ids[5, 7] == 1


def test_words_do_not_contradict_the_vocabulary() -> None:
    with (VOCABULARY_FILE.parent / LABEL_FILES["words"]).open("rb") as file:
        rows = tomllib.load(file)["labels"]
    own = load_label_set("scenewright")
    for row in rows:
        for word in (row["name"], *row.get("also", ())):
            known = own.find(word)
            assert known is None or known.class_name == row["class"], word


def table_of_labels() -> str:
    """The table of docs/FORMATS.md: class by class, the labels that stand for it."""
    rows = ["| class | COCO panoptic | ADE20K | everyday words | PASCAL VOC |", "|---|---|---|---|---|"]
    for name in (*(entry.name for entry in VOCABULARY.classes), ""):
        cells = []
        for source in LABEL_FILES:
            own = [label for label in load_label_set(source).labels if label.class_name == name]
            words = [w for x in own for w in ((x.name, *x.also) if source == "words" else (x.name,))]
            cells.append(", ".join(words))
        if any(cells):
            rows.append(f"| {f'`{name}`' if name else 'void'} | {' | '.join(cells)} |")
    return "\n".join(rows)


def test_the_table_of_the_documentation_is_current() -> None:
    text = (LABELS_FOLDER.parents[1] / "docs" / "FORMATS.md").read_text()
    assert table_of_labels() in text, "put the output of table_of_labels() into docs/FORMATS.md"
