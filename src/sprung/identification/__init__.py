"""Modal identification: Cov-SSI, ACS-Cov-SSI and CoSS-SSI; pLSCF and FDD as second opinions; picking by hand."""

from sprung._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
