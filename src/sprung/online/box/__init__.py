"""The box on the vehicle: sources of samples, spool, frames.

`sprung.online.box.onboard` (identification on the vehicle) is imported only where it is needed: a box is much
smaller without it.
"""

from sprung._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
