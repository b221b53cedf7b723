"""Segmentation as a service: any model behind a small HTTP protocol (docs/SEGMENTATION.md)."""

from __future__ import annotations

from pydantic import Field
from scenewright.stages.kit.labels import LABEL_TABLES
from scenewright.stages.kit.services.address import SEGMENTATION
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.segment.registry import BackendDeclaration


class ServiceParameters(Parameters):
    """Options of a segmentation service, which is asked for by its address."""

    request_timeout: float = Field(60.0, gt=0, le=3600, description="A service has to answer within this [s]")
    retries: int = Field(3, ge=0, le=100, description="How often a service is asked again after a fault that may pass")
    retry_wait: float = Field(0.5, ge=0, le=60, description="Wait before the first of these, doubled every time [s]")
    service_model: str = Field(
        "",
        description="What a service has to say it is (the end of an artifact's label, after `masks of`); empty: it is "
        "asked, and another model behind the same address is another result",
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
