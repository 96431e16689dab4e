"""Results and state of the monitor in SQL, and the archive of samples; independent of the model of a vehicle."""

from sprung._checks import required
from sprung._lazy import lazily

required("sqlalchemy", purpose="the store", extra="online")
__getattr__, __dir__, __all__ = lazily(__name__, __file__)
