"""CameraInfo of images that are a part of the sensor, or binned: its K and P are those of the whole sensor."""

from __future__ import annotations

from dataclasses import replace

from scenewright.stages.ingest.messages.record_fields import Fields, nested, size_of
from scenewright.stages.ingest.messages.records import CalibrationRecord


def of_published_images(record: CalibrationRecord, fields: Fields) -> CalibrationRecord:
    """Return the calibration of the images as they are published: cut out (roi), then binned.

    `fields` are those of the CameraInfo. Pixel centres are at integer coordinates. Raises Undecodable.
    """
    if "roi" not in fields or "binning_x" not in fields:
        return record
    region = nested(fields, "roi")
    left, top = size_of(region, "x_offset"), size_of(region, "y_offset")
    width, height = size_of(region, "width") or record.width, size_of(region, "height") or record.height
    across, down = size_of(fields, "binning_x") or 1, size_of(fields, "binning_y") or 1
    if (left, top, width, height, across, down) == (0, 0, record.width, record.height, 1, 1):
        return record

    def moved(numbers: tuple[float, ...], columns: int) -> tuple[float, ...]:
        if len(numbers) < 3 * columns:
            return numbers
        shifted = list(numbers)
        shifted[2] = (numbers[2] - left + 0.5) / across - 0.5
        shifted[columns + 2] = (numbers[columns + 2] - top + 0.5) / down - 0.5
        for row, binning in ((0, across), (1, down)):
            for column in (0, 1, 3)[: columns - 1]:
                shifted[row * columns + column] = numbers[row * columns + column] / binning
        return tuple(shifted)

    return replace(record, width=width // across, height=height // down, K=moved(record.K, 3), P=moved(record.P, 4))
