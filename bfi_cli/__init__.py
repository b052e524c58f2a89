"""Blind fault identification of air-data sensors."""

__version__ = "0.1.0"
