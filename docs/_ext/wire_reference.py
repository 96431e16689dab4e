"""Frames, topics and figures, from the code: the directives `frame-keys`, `topics` and `figures`."""

from typing import Any

from docutils import nodes
from file_reference import table
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from sprung.link import DOWNWARDS, UPWARDS, Key, topic
from sprung.online.monitor.station import FIGURES


class FrameKeys(SphinxDirective):
    """Numbered keys of a frame."""

    def run(self) -> list[nodes.Node]:
        """Return the table."""
        rows = [(str(key.value), f"`{key.name}`") for key in Key]
        return self.parse_text_to_nodes(table(("key", "name in the code"), rows))


class Topics(SphinxDirective):
    """Topics from and to a vehicle."""

    def run(self) -> list[nodes.Node]:
        """Return the table."""
        rows = [(f"`{topic('VEHICLE', what)}`", "from the vehicle") for what in UPWARDS]
        rows += [(f"`{topic('VEHICLE', what)}`", "to the vehicle") for what in DOWNWARDS]
        return self.parse_text_to_nodes(table(("topic", "direction"), rows))


class Figures(SphinxDirective):
    """Figures of a running monitor."""

    def run(self) -> list[nodes.Node]:
        """Return the table."""
        rows = [(f"`{name}`", kind, meaning) for name, (kind, meaning) in FIGURES.items()]
        return self.parse_text_to_nodes(table(("figure", "kind", "meaning"), rows))


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directives."""
    app.add_directive("frame-keys", FrameKeys)
    app.add_directive("topics", Topics)
    app.add_directive("figures", Figures)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
