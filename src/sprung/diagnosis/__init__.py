"""From windows of driving to findings: sensor checks, baseline, change tests, localisation, advice."""

from sprung._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
