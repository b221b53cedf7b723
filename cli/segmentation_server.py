"""From the options of `scenewright models serve` to a server that listens."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.errors import UsageError
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.engine.code.digests import step_code
from scenewright.stages.engine.keys import data_file_digests, library_versions, parameters_as_json
from scenewright.stages.engine.model_cache import resolve_weights
from scenewright.stages.engine.runner import choose_device
from scenewright.stages.kit.configuration import parameters_for, read_config
from scenewright.stages.kit.digests import external_digest
from scenewright.stages.kit.formats.frames import Frame
from scenewright.stages.kit.library_versions import library_version
from scenewright.stages.kit.services.segmentation_protocol import SegmentRequest
from scenewright.stages.kit.stage import External, Optionally
from scenewright.stages.segment.backends.service.server import SegmentationServer, revision_of, segment_request
from scenewright.stages.segment.choice import BackendRequest, choose_backend
from scenewright.stages.segment.parameters import STAGE, SegmentParameters
from scenewright.stages.segment.registry import AUTO, backend_for, backends_for
from scenewright.stages.segment.settings import geometric_settings

_BLANK = SegmentRequest(
    Frame(0, 0.0, np.zeros((480, 640, 3), np.uint8), np.full((480, 640), 2, np.float32), None, np.eye(4)),
    Camera(width=640, height=480, fx=525, fy=525, cx=319.5, cy=239.5),
    seed=0,
)
"""Empty request with which a backend is tried before it serves."""


def open_server(
    given: Mapping[str, Any],
    files: Mapping[str, Path],
    *,
    config: Path | None = None,
    host: str = "127.0.0.1",
    port: int = 0,
    device: str = "cpu",
) -> SegmentationServer:
    """Return a server of the backend that `given` parameters (and the config file) name; it does not answer yet.

    `files` maps input roles of `segment` to paths. Its revision is a digest of the parameters, the content of all
    files, the versions of the libraries and of this project, so that clients notice when any of them changes. Raises
    UsageError, BadInput, MissingDependency or MachineFailure. One empty frame is segmented before it returns.
    """
    parameters = parameters_for(STAGE, given, read_config(config) if config else {}, str(config))
    assert isinstance(parameters, SegmentParameters)
    declared = (backend_for(AUTO),) if parameters.backend == AUTO else backends_for(parameters.backend)
    if any(one.address for one in declared):
        raise UsageError("a service cannot be served", hint="serve the backend behind it")
    resolved = {role: _resolve(role, path) for role, path in files.items()}
    device = choose_device(device)
    backend = choose_backend(
        BackendRequest(
            parameters,
            resolved.get("weights"),
            mask_weights=resolved.get("mask_weights"),
            semantic_weights=resolved.get("semantic_weights"),
            labels=resolved.get("labels"),
            sidecar=resolved.get("sidecar"),
            device=device,
        )
    )
    revision = revision_of(
        {
            "parameters": parameters_as_json(parameters),
            "files": {role: external_digest(path) for role, path in resolved.items()},
            "libraries": library_versions(STAGE, parameters),
            "data_files": data_file_digests(STAGE, parameters),
            "code": step_code(STAGE).digest,
            "scenewright": library_version("scenewright"),
            "device": device,
        }
    )
    # Libraries load and kernels are compiled on first use: now, and not while a client waits.
    segment_request(_BLANK, backend, geometric_settings(parameters))
    required = ("color",) if all("color" in one.needs for one in declared) else ("depth",)
    return SegmentationServer(host, port, backend, geometric_settings(parameters), revision=revision, required=required)


def _resolve(role: str, path: Path) -> Path:
    declared = STAGE.reads[role]
    assert isinstance(declared, Optionally) and isinstance(declared.what, External)
    return resolve_weights(path) if declared.what.weights else path
