"""Every number of payloads and options has bounds; whose fault an error of the system is."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import Field
from scenewright.cli.main import run
from scenewright.schemas.base import LARGEST_INT32, LARGEST_SEED, Model, Seed
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.engine.discovery import all_stages
from scenewright.stages.engine.json_schemas import json_schemas
from scenewright.stages.engine.machine_faults import is_machines
from scenewright.stages.ingest.messages.records import CalibrationRecord
from scenewright.stages.ingest.stereo import _pinhole
from scenewright.stages.kit.configuration import parameters_for
from scenewright.stages.kit.geometry.point_clouds import sample_large_triangles


class Inner(Model):
    """A payload within a payload."""

    size: float = 0.0


class Payload(Model):
    """Numbers of every kind."""

    count: int = 0
    near: int = Field(0, ge=-1, le=1)
    many: tuple[int, ...] = ()
    by_name: dict[str, float] = {}
    inner: Inner | None = None
    seed: Seed = 0


@pytest.mark.parametrize(
    "document",
    [
        {"count": 2**31},
        {"count": -(2**31) - 1},
        {"near": 2},
        {"many": [0, 2**31]},
        {"by_name": {"x": 1e13}},
        {"by_name": {"x": -1e300}},
        {"inner": {"size": 1e20}},
        {"seed": -1},
        {"seed": 2**60},
    ],
)
def test_numbers_that_no_array_takes(tmp_path: Path, document: dict[str, Any]) -> None:
    (tmp_path / "a.json").write_text(json.dumps(document))
    with pytest.raises(BadInput, match="a.json: .*(less|greater) than"):
        Payload.read(tmp_path / "a.json")


def test_numbers_at_the_bounds(tmp_path: Path) -> None:
    for whole in (
        Payload(count=LARGEST_INT32, many=(-(2**31),), by_name={"x": 1e12}),
        Payload(seed=LARGEST_SEED + 2000),
    ):
        whole.write(tmp_path / "a.json")
        assert Payload.read(tmp_path / "a.json") == whole


def test_values_of_a_file_of_others() -> None:
    with pytest.raises(BadInput, match=r"^a.mcap: cx = 1e.20: .*less than .* .give --cx.$"):
        Camera.of_outside("a.mcap", hint="give --cx", width=1, height=1, fx=1.0, fy=1.0, cx=1e20, cy=0.0)
    assert Camera.of_outside("a", hint="", width=1, height=2, fx=1.0, fy=1.0, cx=0.0, cy=0.0).height == 2


def test_focal_lengths_of_a_pair() -> None:
    record = CalibrationRecord(0, "", 640, 480, "", (), (), (), ())
    with pytest.raises(BadInput, match=r"^a.mcap: fx = 1e.20: "):
        _pinhole(np.diag([1e20, 1e20, 1.0]), (640, 480), record, "a.mcap")


@pytest.mark.parametrize("size", [1e9, 1e18])
def test_surfaces_of_more_points_than_there_is_memory(size: float) -> None:
    vertices = np.array([[0, 0, 0], [size, 0, 0], [0, size, 0]], np.float32)
    with pytest.raises(BadInput, match="is too large for points 0.01 m apart"):
        sample_large_triangles(vertices, np.array([[0, 1, 2]]), 0.01, np.random.default_rng(0))


def unbounded(schema: Any) -> list[Any]:
    """Return the numbers of a JSON Schema without bounds."""
    if isinstance(schema, list):
        return [found for part in schema for found in unbounded(part)]
    if not isinstance(schema, dict):
        return []
    bare = schema.get("type") in ("integer", "number") and not {"maximum", "exclusiveMaximum"} & set(schema)
    return [schema] * bare + [found for part in schema.values() for found in unbounded(part)]


def test_no_number_of_a_payload_is_unbounded() -> None:
    schemas = {name: json.loads(text) for name, text in json_schemas().items()}
    found = {name: unbounded(schema) for name, schema in schemas.items() if name != "manifest.schema.json"}
    assert {name: bare for name, bare in found.items() if bare} == {}


@pytest.mark.parametrize("step", all_stages().values(), ids=lambda step: step.name)
def test_no_number_of_an_option_is_unbounded(step: Any) -> None:
    assert unbounded(step.parameters.model_json_schema()) == []


def test_options_that_are_almost_zero() -> None:
    with pytest.raises(UsageError, match="--stray-distance: Input should be greater than or equal to 0.000000001"):
        parameters_for(all_stages()["graph"], {"stray_distance": 5e-324})


def test_a_choice_of_number_or_word_names_both() -> None:
    with pytest.raises(UsageError, match="--every: Input should be a valid integer.*, or: Input should be 'auto'"):
        parameters_for(all_stages()["ingest"], {"every": "often"})


def test_seeds_over_32_bits_are_usage_errors(tmp_path: Path) -> None:
    assert run(["pack", "--out", str(tmp_path / "a"), "--seed", str(2**31)]) == 2
    assert run(["pack", "--out", str(tmp_path / "a"), "--seed", str(2**64)]) == 2


@pytest.mark.parametrize(
    ("error", "words", "machine"),
    [
        (OSError(errno.ENOSPC, "full", "/x"), (), True),
        (PermissionError(errno.EACCES, "no", "/x"), (), True),
        (MemoryError(), (), True),
        (FileNotFoundError(errno.ENOENT, "missing", "/tmp/given/x.html"), ("--html", "/tmp/given/x.html"), True),
        (FileNotFoundError(errno.ENOENT, "missing", "/tmp/given/x.html"), ("--html=/tmp/given/x.html",), True),
        (FileNotFoundError(errno.ENOENT, "missing", "/tmp/given"), ("/tmp/given/x",), True),
        (FileNotFoundError(errno.ENOENT, "missing", "/tmp/ours"), ("/tmp/given", "--json", "", "x\0"), False),
        (FileNotFoundError(errno.ENOENT, "missing"), ("/tmp/given",), False),
        (FileExistsError(errno.EEXIST, "exists", 3), ("3",), False),
        (OSError(errno.EBADF, "closed"), ("/tmp/given",), False),
        (ConnectionRefusedError(errno.ECONNREFUSED, "refused"), (), False),
        (OSError("no number at all"), ("/tmp/given",), False),
    ],
)
def test_whose_fault_it_is(error: Exception, words: tuple[str, ...], machine: bool) -> None:
    assert is_machines(error, words) is machine  # type: ignore[arg-type]


def test_a_bug_that_looks_like_the_machine(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    def diagnose() -> None:
        os.stat("/nowhere/that/anybody/named")

    monkeypatch.setattr("scenewright.stages.engine.diagnosis.diagnose", diagnose)
    assert run(["doctor"]) == 1
    assert "internal error: FileNotFoundError" in capfd.readouterr().err
