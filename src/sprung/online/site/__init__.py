"""Pages and interface of the monitor, by HTTP."""

from sprung._checks import required
from sprung._lazy import lazily

required("fastapi", purpose="the pages of the monitor", extra="online")
__getattr__, __dir__, __all__ = lazily(__name__, __file__)
