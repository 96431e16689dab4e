"""Signals: filters, spectra, cepstrum, narrow lines, and what a recording holds."""
