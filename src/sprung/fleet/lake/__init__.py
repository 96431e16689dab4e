"""Lakes: windows of samples of many vehicles as one table in the Delta format, for engines that analyse fleets."""

from sprung._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
