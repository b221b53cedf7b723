"""Files of `data/` that a step reads are in its key: what its code names is what its declaration names."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import pytest
from scenewright.stages.engine.code.digests import step_code
from scenewright.stages.engine.discovery import all_stages
from scenewright.stages.kit.stage import Stage

REPOSITORY = Path(__file__).resolve().parents[2]
FILES = {path.name for path in (REPOSITORY / "data").rglob("*") if path.is_file()}
ALWAYS = {"vocabulary.toml"}


def declared(stage: Stage) -> set[str]:
    """Names of the files in the keys of a step, under its defaults and each single choice beside them."""
    if stage.data_files is None:
        return ALWAYS
    defaults = stage.parameters()
    chosen = [defaults]
    for name, field in stage.parameters.model_fields.items():
        chosen += [defaults.model_copy(update={name: value}) for value in get_args(field.annotation)]
    if "backend" in stage.parameters.model_fields:
        chosen += [defaults.model_copy(update={"backend": name}) for name in ("objects", "onnx", "network")]
        chosen += [defaults.model_copy(update={"backend": "ground-truth", "lasting": "detector"})]
    return ALWAYS | {Path(file).name for one in chosen for file in stage.data_files(one)}


@pytest.mark.parametrize("name", all_stages())
def test_files_that_the_code_names_are_in_the_key(name: str) -> None:
    stage = all_stages()[name]
    named = {Path(text).name for text in step_code(stage).texts} & FILES
    assert named <= declared(stage), "data_files of the declaration has to name them"
