"""JSON and TOML that cannot be: one line with the file and the field, exit code 3 for artifacts, 2 for settings."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scenewright.schemas.cad_library import LibraryFile
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.outside import file_toml
from scenewright.schemas.panoptic_map import EntitiesFile
from scenewright.stages.engine.pipelines import read_pipeline
from scenewright.stages.kit.configuration import read_config
from scenewright.stages.kit.formats.cad_models import read_model
from scenewright.stages.library.importing.mapping import read_mapping

from tests.fuzz.payloads import DOCUMENTS, GOLDEN, golden_documents

FILES = settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])

GARBAGE = {
    "a list": b"[]",
    "a word": b"null",
    "not JSON": b"{'a': 1}",
    "UTF-16": '{"a": 1}'.encode("utf-16"),
    "a byte order mark": b"\xef\xbb\xbf{}",
    "NaN": b'{"seed": NaN}',
    "a long number": b'{"seed": ' + b"9" * 10_000 + b"}",
    "half a surrogate": b'{"\\ud800": 1}',
    "many keys": b"{" + b",".join(b'"k%d": 1' % k for k in range(5_000)) + b"}",
}
"""What is no document of ours, beside the damages of every door (test_any_damage.py)."""


@pytest.mark.parametrize("case", GARBAGE)
def test_garbage_for_every_json_file(tmp_path: Path, case: str) -> None:
    path = tmp_path / "payload.json"
    path.write_bytes(GARBAGE[case])
    for model in DOCUMENTS.values():
        started = time.process_time()
        with pytest.raises(BadInput, match=r"payload\.json") as caught:
            model.read(path)
        assert len(str(caught.value)) < 1000 and time.process_time() - started < 2, model


REPLACEMENTS = (None, [], {}, "", "../../x", -1, 1e400, float("nan"), True, [[]], "x" * 3000, 2**70, [None] * 3)


def places(value: object, path: tuple = ()) -> list[tuple]:
    """Return the paths of every value of a document, lists by their first entries."""
    found = [path] if path else []
    if isinstance(value, dict):
        for key in value:
            found += places(value[key], (*path, key))
    if isinstance(value, list):
        for index in range(min(2, len(value))):
            found += places(value[index], (*path, index))
    return found


@FILES
@given(st.data())
def test_any_field_replaced_by_anything(tmp_path: Path, data: st.DataObject) -> None:
    """Every JSON file of every kind with one value replaced: read as what it now says, or BadInput; nothing else."""
    name = data.draw(st.sampled_from(sorted(golden_documents())), label="document")
    document = json.loads(golden_documents()[name])
    place = data.draw(st.sampled_from(places(document)), label="place")
    holder = document
    for step in place[:-1]:
        holder = holder[step]
    if data.draw(st.booleans(), label="remove"):
        del holder[place[-1]]
    else:
        holder[place[-1]] = data.draw(st.sampled_from(REPLACEMENTS), label="value")
    path = tmp_path / "payload.json"
    path.write_text(json.dumps(document))
    try:
        DOCUMENTS[name].read(path)
    except BadInput as error:
        assert "payload.json" in str(error)


def test_the_golden_documents_are_many() -> None:
    assert len(golden_documents()) >= 30


@pytest.mark.parametrize("name", ["../../evil", "/etc/passwd", "..", "a/b", "a b", "", "x" * 300, "a\nb", "caf\u00e9"])
def test_names_that_become_paths_are_plain(tmp_path: Path, name: str) -> None:
    """Ids of models, nodes and bodies become file names; only plain ones come in."""
    path = tmp_path / "a.json"
    node = {"id": name, "instance": 1, "class_name": "cup", "node_type": "rigid"}
    path.write_text(json.dumps({"nodes": [node], "links": []}))
    with pytest.raises(BadInput, match=r"nodes\.0\.id"):
        ContactGraphFile.read(path)
    node = {"id": "cup_1", "instance": 1, "class_name": "cup", "node_type": "rigid", "mesh": f"entities/../{name}"}
    path.write_text(json.dumps({"nodes": [node], "links": []}))
    with pytest.raises(BadInput, match=r"nodes\.0\.mesh"):
        ContactGraphFile.read(path)
    entities = json.loads((GOLDEN / "v1/panoptic_map/entities.json").read_text())
    entities["entities"][0]["mesh"] = f"../{name}"
    path.write_text(json.dumps(entities))
    with pytest.raises(BadInput, match=r"entities\.0\.mesh"):
        EntitiesFile.read(path)
    library = json.loads((GOLDEN / "v1/cad_library/library.json").read_text())
    library["models"][0]["id"] = name
    path.write_text(json.dumps(library))
    with pytest.raises(BadInput, match=r"models\.0\.id"):
        LibraryFile.read(path)


def test_models_that_do_not_hold_together(tmp_path: Path) -> None:
    library = json.loads((GOLDEN / "v1/cad_library/library.json").read_text())
    joint = {"name": "j", "type": "revolute", "part": "lid", "origin": [0, 0, 0], "axis": [0, 0, 1]}
    model = {**library["models"][0], "joints": [{**joint, "lower": 0, "upper": 1}]}
    for change, complaint in (
        ({"parts": []}, "are none"),
        ({"parts": ["a", "a"]}, "not different"),
        ({"parts": ["nothing_of_it"]}, "which is no part"),
    ):
        (tmp_path / "model.json").write_text(json.dumps({**model, **change}))
        with pytest.raises(BadInput, match=complaint):
            read_model(tmp_path)


# --- TOML ---------------------------------------------------------------------------------------------------------

READERS: dict[str, Callable[[Path], object]] = {
    "toml": file_toml,
    "config": read_config,
    "pipeline": read_pipeline,
    "mapping": read_mapping,
}
ANY = {"toml", "config"}
"""Readers that take whatever is TOML."""
NESTED, DIGITS, UTF8 = "nested", "integer|digits", "UTF-8|utf-8"
PIPELINE = 'name = "p"\nsummary = "s"\n[[step]]\nname = "a"\nstage = "ingest"\ninputs = { log = "../../etc" }'
PATTERNS = "[models]\n" + "".join(f'"*x{k}*" = "chair"\n' for k in range(1001))
TOML: dict[str, tuple[str | bytes, str, set[str]]] = {
    "deep": ("x = " + "[" * 10_000, NESTED, set()),
    "deep and closed": ("x = " + "[" * 1000 + "]" * 1000, NESTED, set()),
    "an integer of 6000 digits": ("x = " + "9" * 6000, DIGITS, set()),
    "an integer of 30 digits": ("x = " + "9" * 30, DIGITS, set()),
    "a key of a million parts": ("a." * 1_000_000 + "b = 1", "", set()),
    "a table of a thousand parts": ("[" + "a." * 1000 + "b]", "", set()),
    "a key within a table": ("x = {" + "a . " * 1000 + "b = 1}", "", set()),
    "a million letters": ("x" * 10**6, "", set()),
    "no UTF-8": (b'x = "caf\xe9"', UTF8, set()),
    "a byte order": (b"\xff\xfe", UTF8, set()),
    "a zero byte": (b"\x00", "", set()),
    "no key": ("= 3", "", set()),
    "no value": ("a = ", "", set()),
    "no end": ("[step", "", set()),
    "a key twice": ("a = 1\na = 2", "", set()),
    "no date": ("a = 99999-99-99", "", set()),
    "nothing": ("", "", ANY | {"mapping"}),
    "a name": ('name = "x"', "", ANY),
    "a number of steps": ("step = 3", "", ANY),
    "a step that is none": ("[[step]]\nname = 1", "", ANY),
    "a variable that is none": ("[variables]\na = 1", "", ANY),
    "an input that is none": (PIPELINE, "", ANY),
    "too many patterns": (PATTERNS, "Field required|more than 1000 patterns", ANY),
}
"""Content -> (bytes, words of each refusal beside the file's name, the readers that take it)."""


@pytest.mark.parametrize("case", TOML)
def test_toml_is_refused_by_every_reader_but_those_listed(tmp_path: Path, case: str) -> None:
    content, words, takers = TOML[case]
    path = tmp_path / "a.toml"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    taken = set()
    for name, read in READERS.items():
        started = time.process_time()
        try:
            read(path)
            taken.add(name)
        except (BadInput, UsageError) as error:
            assert "a.toml" in str(error) and re.search(words, str(error)) and "\n" not in str(error)
            assert isinstance(error, BadInput) == (name in ("toml", "mapping"))
        assert time.process_time() - started < 1
    assert taken == takers
