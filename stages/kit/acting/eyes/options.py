"""Options of the steps whose robots see: who names what their cameras show."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, field_validator
from pydantic_core import PydanticCustomError
from scenewright.stages.kit.services.address import SEGMENTATION, check_address
from scenewright.stages.kit.stage import NOT_SHOWN, Parameters

SegmenterName = Literal["thesis", "detector", "network"]


class SegmenterParameters(Parameters):
    """Who names what cameras show."""

    segmenter: str = Field(
        "",
        description="Address of a segmentation service, any backend of `segment` (`scenewright models serve`), whose "
        "masks are all that the robot sees by; empty: a simulated segmenter that errs",
    )
    segmenter_errors: SegmenterName = Field(
        "thesis",
        description="Whose errors the simulated segmenter makes: `thesis` as printed, `detector` or `network` as "
        "measured on real frames (data/errors/segmenters.toml)",
    )

    @field_validator("segmenter")
    @classmethod
    def _names_a_service(cls, address: str) -> str:
        try:
            return check_address(address, form=SEGMENTATION) if address else ""
        except ValueError as error:
            raise PydanticCustomError(NOT_SHOWN, "{reason}", {"reason": str(error)}) from None
