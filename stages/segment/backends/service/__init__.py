"""Segmentation as a service: any model behind a small HTTP protocol (docs/SEGMENTATION.md)."""

from __future__ import annotations

from pydantic import Field
from scenewright.stages.kit.labels import LABEL_TABLES
from scenewright.stages.kit.services.address import SEGMENTATION
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.segment.registry import BackendDeclaration


class ServiceParameters(Parameters):
    """Options of a segmentation service, which is asked for by its address."""

    request_timeout: float = Field(60.0, gt=0, le=3600, description="Timeout of a request [s]")
    retries: int = Field(3, ge=0, le=100, description="Retries after a transient fault")
    retry_wait: float = Field(0.5, ge=0, le=60, description="Wait before the first retry, doubled each time [s]")
    service_model: str = Field(
        "",
        description="Model that the service must name (an artifact's label has it after `masks of`); empty: "
        "whatever it names",
    )


BACKEND = BackendDeclaration(
    name="service",
    summary="the masks of another program",
    order=80,
    parameters=ServiceParameters,
    data_files=lambda parameters: LABEL_TABLES,
    versions="identity",
    address=SEGMENTATION,
)
