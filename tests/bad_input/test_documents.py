"""JSON and TOML that cannot be: one line with the file and the field, exit code 3 for artifacts, 2 for settings."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scenewright.schemas.cad_library import LibraryFile
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.panoptic_map import EntitiesFile
from scenewright.stages.engine.pipelines import read_pipeline
from scenewright.stages.kit.configuration import read_config
from scenewright.stages.kit.formats.cad_models import read_model

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

BAD_TOML = [
    b"",
    b"= 1",
    b"a = ",
    b"[step",
    b"\xff\xfe",
    b"a = 1\na = 2",
    b"a = " + b"[" * 5000,
    b"x" * 10**6,
    b"\x00",
    b'name = "x"',
    b"step = 3",
    b"[[step]]\nname = 1",
    b"a = 99999-99-99",
    b"[variables]\na = 1",
    b'name = "p"\nsummary = "s"\n[[step]]\nname = "a"\nstage = "ingest"\ninputs = { log = "../../etc" }',
]


@pytest.mark.parametrize("number", range(len(BAD_TOML)))
def test_settings_that_cannot_be_read(tmp_path: Path, number: int) -> None:
    path = tmp_path / "a.toml"
    path.write_bytes(BAD_TOML[number])
    with pytest.raises(UsageError, match=r"a\.toml"):
        read_pipeline(path)
    try:
        assert isinstance(read_config(path), dict)
    except UsageError as error:
        assert "a.toml" in str(error)
