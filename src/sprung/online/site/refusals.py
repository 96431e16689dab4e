"""Refusals of requests: the part of the interface's OpenAPI document that all operations share."""

from collections.abc import Iterator, Mapping
from typing import Any

#: Name and schema of the answer.
_NAME = "Refusal"
_SCHEMA = {
    "type": "object",
    "title": _NAME,
    "description": "Why a request was refused.",
    "properties": {"detail": {"type": "string", "title": "Detail", "description": "what is wrong, and what to do"}},
    "required": ["detail"],
}
_CONTENT = {"application/json": {"schema": {"$ref": f"#/components/schemas/{_NAME}"}}}
#: Schemas of the framework, which no answer has.
_FOREIGN = ("HTTPValidationError", "ValidationError")
#: Refusals that any operation can meet.
_ANY = {
    408: "The request took too long.",
    413: "The request is too large.",
    421: "The server does not answer to the name in Host.",
    422: "A value is out of range, or is missing.",
    429: "There were too many requests: Retry-After states how long to wait.",
    503: "The store does not answer.",
}


def with_refusals(document: dict[str, Any]) -> dict[str, Any]:
    """Return an OpenAPI document with the refusals of each operation.

    Parameters
    ----------
    document
        OpenAPI document of the framework, which is changed.
    """
    schemas = document["components"]["schemas"]
    for name in _FOREIGN:
        schemas.pop(name, None)
    schemas[_NAME] = _SCHEMA
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            responses = operation["responses"]
            responses.pop("422", None)
            for status, description in _refusals(path, method, operation):
                responses.setdefault(str(status), {"description": description, "content": _CONTENT})
    return document


def _refusals(path: str, method: str, operation: Mapping[str, Any]) -> Iterator[tuple[int, str]]:
    """Yield status and description of each refusal of an operation."""
    has_role, has_body = "security" in operation, "requestBody" in operation
    if has_body:
        yield 400, "The body cannot be read, or what it asks for is not allowed."
    if has_role or has_body:
        yield 401, "There is no valid token or session, or name or password is wrong."
    if has_role:
        yield 403, "The role does not include this, or the CSRF token of the session is missing."
    if "{" in path:
        yield 404, "Nothing has that name or number."
    if method != "get" or "{" in path:
        yield 409, "The action is impossible at present."
    yield from _ANY.items()
