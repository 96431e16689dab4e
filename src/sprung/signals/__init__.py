"""Signals: filters, spectra, cepstrum, narrow lines, and facts about recordings."""
