"""What is said to a language model: messages of text and images, and the form in which they are digested."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Any, Literal

from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.image_headers import PNG_START, may_be_decoded

Role = Literal["system", "user", "assistant"]
LARGEST_IMAGE_BYTES = 20 * 2**20
"""Largest image, as encoded [bytes]."""
JPEG_START = b"\xff\xd8"


@dataclass(frozen=True)
class Text:
    """A piece of text. Raises BadInput for half a surrogate pair, which no request can hold."""

    text: str

    def __post_init__(self) -> None:
        try:
            self.text.encode()
        except UnicodeEncodeError:
            raise BadInput("a message to a language model is not valid Unicode", hint="check the names in it") from None


@dataclass(frozen=True)
class Image:
    """An encoded PNG or JPEG. Raises BadInput for anything else, and for one whose header lies about its size."""

    data: bytes

    def __post_init__(self) -> None:
        if not self.data.startswith((PNG_START, JPEG_START)) or not may_be_decoded(self.data):
            raise BadInput("an image in a message is not a sound PNG or JPEG", hint="encode it as one of these")
        if len(self.data) > LARGEST_IMAGE_BYTES:
            raise BadInput(
                f"an image in a message has {len(self.data)} bytes, more than {LARGEST_IMAGE_BYTES}", hint="scale it"
            )

    @property
    def media_type(self) -> str:
        """`image/png` or `image/jpeg`."""
        return "image/png" if self.data.startswith(PNG_START) else "image/jpeg"

    @property
    def sha256(self) -> str:
        """Digest of the encoded bytes."""
        return hashlib.sha256(self.data).hexdigest()


@dataclass(frozen=True)
class Message:
    """One message of a chat."""

    role: Role
    parts: tuple[Text | Image, ...]

    @property
    def text(self) -> str:
        """Its text parts, one a line."""
        return "\n".join(part.text for part in self.parts if isinstance(part, Text))


def say(role: Role, *parts: str | Image) -> Message:
    """Return a message of text and images, in the order given."""
    return Message(role, tuple(Text(part) if isinstance(part, str) else part for part in parts))


def described(messages: tuple[Message, ...]) -> list[dict[str, Any]]:
    """Return the messages as JSON in which an image is its media type and sha256: what is digested and recorded."""
    return [{"role": message.role, "parts": [_describe(part) for part in message.parts]} for message in messages]


def _describe(part: Text | Image) -> dict[str, str]:
    if isinstance(part, Text):
        return {"text": part.text}
    return {"media_type": part.media_type, "sha256": part.sha256}
