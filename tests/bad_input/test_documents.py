"""JSON and TOML that cannot be: one line with the file and the field, exit code 3 for artifacts, 2 for settings."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scenewright.schemas.base import Model
from scenewright.schemas.cad_library import LibraryFile
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.kinds import KINDS
from scenewright.schemas.manifest import Manifest
from scenewright.schemas.panoptic_map import EntitiesFile
from scenewright.stages.engine.pipelines import read_pipeline
from scenewright.stages.kit.configuration import read_config
from scenewright.stages.kit.formats.cad_models import read_model

GOLDEN = Path(__file__).resolve().parents[1] / "golden"
MODELS: dict[str, type[Model]] = {
    f"{kind.kind}/{name}": model
    for kind in KINDS.values()
    for name, model in (kind.json_files | kind.optional_json_files).items()
} | {"manifest.json": Manifest}
FILES = settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])

GARBAGE = {
    "nothing": b"",
    "a list": b"[]",
    "a word": b"null",
    "not JSON": b"{'a': 1}",
    "torn": b'{"kind": "x", "files": [',
    "binary": b"\xff\xfe\x00\x01",
    "UTF-16": '{"a": 1}'.encode("utf-16"),
    "a byte order mark": b"\xef\xbb\xbf{}",
    "deep": b'{"nodes":' * 50_000,
    "deep list": b"[" * 200_000,
    "NaN": b'{"seed": NaN}',
    "a long number": b'{"seed": ' + b"9" * 10_000 + b"}",
    "a zero byte": b'{"a": "\x00"}',
    "half a surrogate": b'{"\\ud800": 1}',
    "many keys": b"{" + b",".join(b'"k%d": 1' % k for k in range(20_000)) + b"}",
}


@pytest.mark.parametrize("case", GARBAGE)
@pytest.mark.parametrize("name", sorted(MODELS))
def test_garbage_for_every_json_file(tmp_path: Path, name: str, case: str) -> None:
    path = tmp_path / "payload.json"
    path.write_bytes(GARBAGE[case])
    started = time.process_time()
    with pytest.raises(BadInput, match=r"payload\.json") as caught:
        MODELS[name].read(path)
    assert len(str(caught.value)) < 1000 and time.process_time() - started < 2


def golden_documents() -> list[tuple[str, type[Model], dict]]:
    found = []
    for path in sorted(GOLDEN.glob("v*/*/*.json")):
        model = Manifest if path.name == "manifest.json" else MODELS.get(f"{path.parent.name}/{path.name}")
        text = path.read_text()
        if model is None or len(text) > 200_000:
            continue
        try:
            model.model_validate_json(text)
        except ValueError:
            continue  # of an older version
        found.append((f"{path.parent.name}/{path.name}", model, json.loads(text)))
    return found


DOCUMENTS = golden_documents()
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
    name, model, document = data.draw(st.sampled_from(DOCUMENTS), label="document")
    place = data.draw(st.sampled_from(places(document)), label="place")
    copy = json.loads(json.dumps(document))
    holder = copy
    for step in place[:-1]:
        holder = holder[step]
    if data.draw(st.booleans(), label="remove"):
        del holder[place[-1]]
    else:
        holder[place[-1]] = data.draw(st.sampled_from(REPLACEMENTS), label="value")
    path = tmp_path / "payload.json"
    path.write_text(json.dumps(copy))
    try:
        model.read(path)
    except BadInput as error:
        assert "payload.json" in str(error)


def test_the_golden_documents_are_many() -> None:
    assert len(DOCUMENTS) >= 10


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


@FILES
@given(st.one_of(st.binary(max_size=200), st.text("abc=[]{}\"'\n.,0123456789 -:TZ", max_size=300).map(str.encode)))
def test_any_bytes_as_settings(tmp_path: Path, garbage: bytes) -> None:
    path = tmp_path / "a.toml"
    path.write_bytes(garbage)
    for read in (read_config, read_pipeline):
        try:
            read(path)
        except UsageError as error:
            assert "a.toml" in str(error)
