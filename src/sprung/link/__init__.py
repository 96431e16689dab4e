"""From a vehicle to the monitor: frames, topics, a spool on disk, MQTT.

`sprung.link.summaries` (correlations on the wire) is imported only where needed, as it depends on identification.
"""

from sprung._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
