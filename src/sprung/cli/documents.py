"""Results as JSON, in a file or on standard output."""

import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sprung.documents import Document


def write_json(document: "Document | Mapping[str, Any]", path: str) -> None:
    """Write a document to a file, or to standard output where `path` is "-"."""
    from sprung.documents import document_text, write_document

    if path == "-":
        sys.stdout.write(document_text(document))
        sys.stdout.flush()
    else:
        write_document(document, path)
