"""Pictures as data URIs: sized for the page, encoded small."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import file_content

MAXIMUM_PIXELS = 40_000_000
"""Most pixels of a picture that is embedded; a bound, by eye."""
LARGEST_ANIMATION = 6_000_000
"""Largest GIF that is embedded as it is [bytes]."""


@dataclass(frozen=True)
class Picture:
    """An embedded picture."""

    uri: str
    """`data:image/...;base64,...`."""
    width: int
    height: int
    alt: str


def _fit(image: Image.Image, width: int) -> Image.Image:
    if image.width <= width:
        return image
    return image.resize((width, max(1, round(image.height * width / image.width))), Image.Resampling.LANCZOS)


def jpeg(pixels: np.ndarray, alt: str, width: int, quality: int = 84) -> Picture:
    """Encode (H, W, 3) uint8 RGB as JPEG, at most `width` wide."""
    image = _fit(Image.fromarray(np.ascontiguousarray(pixels)), width)
    buffer = io.BytesIO()
    image.save(buffer, "JPEG", quality=quality, optimize=True, progressive=True)
    return _picture("jpeg", buffer, image, alt)


def from_file(path: Path, alt: str, width: int) -> Picture:
    """Embed a picture file: plots (few colours) stay PNG, photographs become JPEG. Raises BadInput when unreadable."""
    try:
        with Image.open(path) as opened:
            if opened.width * opened.height > MAXIMUM_PIXELS:
                raise BadInput(
                    f"{path}: {opened.width} x {opened.height} is too large an image", hint="make a smaller one"
                )
            image = opened.convert("RGB")
    except (OSError, SyntaxError, Image.DecompressionBombError) as error:
        raise BadInput(f"{path}: {error}", hint="make the artifact again") from None
    image = _fit(image, width)
    if image.getcolors(4096) is None:
        return jpeg(np.asarray(image), alt, width)
    return _png(image.quantize(128), alt)


def animation(path: Path, alt: str) -> Picture:
    """Embed a GIF as it is. Raises BadInput when it cannot be read or is too large for a page."""
    try:
        with Image.open(path) as opened:
            width, height = opened.size
        data = file_content(path, LARGEST_ANIMATION)
    except (OSError, SyntaxError, Image.DecompressionBombError) as error:
        raise BadInput(f"{path}: {error}", hint="make the artifact again") from None
    return Picture(f"data:image/gif;base64,{base64.b64encode(data).decode('ascii')}", width, height, alt)


def plot(path: Path, alt: str, width: int = 1100) -> Picture:
    """Embed a plot as PNG with a reduced palette."""
    try:
        with Image.open(path) as opened:
            image = _fit(opened.convert("RGB"), width)
    except (OSError, SyntaxError, Image.DecompressionBombError) as error:
        raise BadInput(f"{path}: {error}", hint="make the artifact again") from None
    return _png(image.quantize(240, method=Image.Quantize.MAXCOVERAGE), alt)


def from_figure(figure: Figure, alt: str, width: int = 1100) -> Picture:
    """Embed a matplotlib figure as PNG with a reduced palette."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    image = _fit(Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB"), width)
    return _png(image.quantize(128), alt)


def _png(image: Image.Image, alt: str) -> Picture:
    buffer = io.BytesIO()
    image.save(buffer, "PNG", optimize=True)
    return _picture("png", buffer, image, alt)


def _picture(kind: str, buffer: io.BytesIO, image: Image.Image, alt: str) -> Picture:
    text = base64.b64encode(buffer.getvalue()).decode("ascii")
    return Picture(f"data:image/{kind};base64,{text}", image.width, image.height, alt)
