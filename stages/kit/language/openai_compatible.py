"""Backend `openai`: any server with the chat completions of OpenAI (vLLM, llama.cpp, a service), over plain HTTP.

Servers differ in what they understand, and say so with status 400 or 422: a JSON schema for the reply, JSON of any
kind, or text only; `max_tokens` or `max_completion_tokens`; no temperature. The backend asks for the most and gives way
once.
"""

from __future__ import annotations

import base64
import json
from typing import Any, Literal, TypeGuard

from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.language.backend import RawReply, Request, Usage, estimated_usage
from scenewright.stages.kit.language.failures import LanguageFailed
from scenewright.stages.kit.language.messages import Image, Message, Text, say
from scenewright.stages.kit.services.connection import Answer, Connection, GivenUp, Refused, TryAgain

PATH = "/chat/completions"
LARGEST_BODY = 8 * 2**20
"""Largest answer [bytes]."""
LONGEST_WAIT = 120.0
"""Longest time that a server may ask to be left alone [s]."""
MOST_TOKENS = 10**9
"""Most tokens of one exchange: a larger count is no count."""
NOT_UNDERSTOOD = frozenset({400, 422})
"""HTTP statuses of a request that a service does not understand."""
STUMBLED = 500
"""HTTP status of llama.cpp when a reply that it holds to a schema is cut at the largest number of tokens. The same
question is then asked in a lower form, that once, so that the cut reply comes back and the model is told."""
REFUSED_HINT = "see docs/INTERPRET.md: does --base-url end with /v1, is --model one that it serves, is the key set?"

Form = Literal["json_schema", "json_object", "text"]
FORMS: tuple[Form, ...] = ("json_schema", "json_object", "text")


class OpenAICompatibleBackend:
    """Asks a server at `connection` (its address is the base URL, mostly ending with /v1)."""

    def __init__(self, connection: Connection, model: str) -> None:
        self._connection, self._model = connection, model
        self.form: Form = FORMS[0]
        """How replies are asked for; falls back for good when the server does not understand."""
        self._limit_name = "max_tokens"
        self._says_temperature = True

    @property
    def label(self) -> str:
        """`openai:<model>`."""
        return f"openai:{self._model}"

    def ask(self, request: Request) -> RawReply:
        """Return the reply. Raises LanguageFailed: `refused`, `unreachable`."""
        before, form, lowered = self._connection.repeats, self.form, False
        while True:
            body = json.dumps(
                encode_request(request, self.form, self._limit_name, temperature=self._says_temperature)
            ).encode()
            try:
                answer = self._connection.post(PATH, body, "application/json", judge=_judge)
            except Refused as error:
                if error.status in NOT_UNDERSTOOD and self._give_way(error.excerpt):
                    continue
                numbers = {"status": float(error.status)}
                self.form = form  # it was something else that the server did not like
                raise LanguageFailed("refused", error.message, numbers=numbers, hint=error.hint) from None
            except BadInput as error:  # a certificate, an answer of another kind or size
                self.form = form
                raise LanguageFailed("refused", error.message, hint=error.hint) from None
            except GivenUp as error:
                if error.status == STUMBLED and self._lower_form():
                    lowered = True
                    continue
                self.form = form
                numbers = {"repeats": float(self._connection.repeats - before)}
                raise LanguageFailed("unreachable", error.message, numbers=numbers, hint=error.hint) from None
            if lowered:
                self.form = form
            return self._raw(answer, request, self._connection.repeats - before)

    def _give_way(self, excerpt: str) -> bool:
        """Ask for less after a refusal; False when nothing is left to give."""
        if self._limit_name == "max_tokens" and "max_completion_tokens" in excerpt:
            self._limit_name = "max_completion_tokens"
            return True
        if "temperature" in excerpt:  # reasoning models take none, or only their own
            gave, self._says_temperature = self._says_temperature, False
            return gave
        return self._lower_form()

    def _lower_form(self) -> bool:
        at = FORMS.index(self.form)
        self.form = FORMS[min(at + 1, len(FORMS) - 1)]
        return at + 1 < len(FORMS)

    def _raw(self, answer: Answer, request: Request, repeats: int) -> RawReply:
        envelope = json.loads(answer.body)
        choice = envelope["choices"][0]
        message = choice["message"]
        text = self._clean(_text(message.get("content")))
        finish = "length" if choice.get("finish_reason") == "length" else "stop"
        refusal = message.get("refusal")
        if choice.get("finish_reason") == "content_filter" or (isinstance(refusal, str) and refusal):
            finish, text = "declined", self._clean(refusal if isinstance(refusal, str) else text)
        return RawReply(text, finish, _usage(envelope.get("usage"), request, text), repeats)

    def _clean(self, text: str) -> str:
        """Return text without the key, which escapes may have hidden among the bytes, and without half a surrogate
        pair, which neither a file nor the next request could hold."""
        return self._connection.hide(text).encode("utf-8", "replace").decode()


def encode_request(request: Request, form: Form, limit_name: str, *, temperature: bool = True) -> dict[str, Any]:
    """Return the body of a request; `form` says how the reply is asked for, `temperature` whether one is."""
    schema = request.schema
    messages = [_encode(message) for message in request.messages]
    body: dict[str, Any] = {"model": request.model, limit_name: request.maximum_tokens, "stream": False}
    if temperature:
        body["temperature"] = request.temperature
    if form == "json_schema":
        body["response_format"] = {
            "type": "json_schema",
            "json_schema": {"name": schema.name, "schema": schema.document, "strict": schema.strict},
        }
    else:
        # Without constrained decoding the model has to be told.
        document = json.dumps(schema.document, sort_keys=True)
        instruction = f"Reply with one JSON object that follows this JSON schema, and nothing else:\n{document}"
        messages.append(_encode(say("user", instruction)))
        if form == "json_object":
            body["response_format"] = {"type": "json_object"}
    return {**body, "messages": messages}


def _encode(message: Message) -> dict[str, Any]:
    if len(message.parts) == 1 and isinstance(message.parts[0], Text):
        return {"role": message.role, "content": message.parts[0].text}  # what every server understands
    return {"role": message.role, "content": [_encode_part(part) for part in message.parts]}


def _encode_part(part: Text | Image) -> dict[str, Any]:
    if isinstance(part, Text):
        return {"type": "text", "text": part.text}
    data = base64.b64encode(part.data).decode()
    return {"type": "image_url", "image_url": {"url": f"data:{part.media_type};base64,{data}"}}


def _judge(answer: Answer) -> None:
    """Check the envelope. Raises BadInput for another kind of server, TryAgain for one that stumbled."""
    kind = answer.content_type.split(";")[0].strip().lower()
    if kind != "application/json":
        raise BadInput(f"the answer's content type is {answer.content_type[:60]!r}, not JSON", hint=REFUSED_HINT)
    try:
        envelope = json.loads(answer.body)
        content = envelope["choices"][0]["message"].get("content")
        sound = content is None or isinstance(content, str | list)
    except (ValueError, RecursionError):
        raise TryAgain("an answer that is not JSON") from None
    except (LookupError, TypeError, AttributeError):
        sound = False
    if not sound:
        raise TryAgain("an answer without a message")


def _text(content: Any) -> str:
    """Return the text of a message: a string, or a list of parts of which the text ones count."""
    if isinstance(content, str):
        return content
    pieces = content if isinstance(content, list) else []
    texts = [part.get("text") for part in pieces if isinstance(part, dict)]
    return "".join(text for text in texts if isinstance(text, str))


def _usage(counted: Any, request: Request, text: str) -> Usage:
    """Return the tokens that the server counted, or an estimate when it says none or nonsense."""
    counts: dict[str, Any] = counted if isinstance(counted, dict) else {}
    prompt, completion = counts.get("prompt_tokens"), counts.get("completion_tokens")
    if _is_count(prompt) and _is_count(completion):
        return Usage(prompt, completion, estimated=False)
    return estimated_usage(request, text)


def _is_count(value: Any) -> TypeGuard[int]:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= MOST_TOKENS
