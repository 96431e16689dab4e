"""Sprung: suspension monitoring from sensors on the body.

Examples
--------
>>> import sprung
>>> run = sprung.read("run.csv")  # doctest: +SKIP
>>> print(sprung.cov_ssi(run))  # doctest: +SKIP
"""

from sprung._lazy import lazily

__version__ = "0.1.0"
__getattr__, __dir__, __all__ = lazily(__name__, __file__)
