"""Which band a description in a file names, in some languages of mapping agencies."""

from __future__ import annotations

import re

__all__ = ["INFRARED_WORDS", "described_band"]

#: Words of descriptions, in some languages of mapping agencies.
_WORDS = {
    "red": {"red", "rot", "rouge", "rojo", "rosso", "rood"},
    "green": {"green", "grün", "gruen", "vert", "verde", "groen"},
    "blue": {"blue", "blau", "bleu", "azul", "blu", "blauw"},
    "nir": {"nir", "ir", "infrared", "nearinfrared", "infrarot", "infrarouge", "infrarrojo", "infrarood", "pir"},
    "grey": {"grey", "gray", "pan", "panchromatic", "grau", "gris"},
}
#: Letters that are the whole of a description.
_LETTERS = {"r": "red", "g": "green", "b": "blue", "n": "nir", "i": "nir"}
#: Words of bands between and beyond the colours.
_SHADES = {"edge", "rededge", "swir", "shortwave", "thermal", "tir", "lwir", "coastal", "yellow"}
#: Words of near infrared.
INFRARED_WORDS = frozenset(_WORDS["nir"])


def described_band(text: str) -> str:
    """Return the band that a description names, such as ``B8 - NIR`` or ``near infrared``; empty where it names none.

    >>> described_band("b4 (red)"), described_band("red edge"), described_band("band 4")
    ('red', '', '')
    """
    words = set(re.findall(r"[^\W\d_]+", text.lower()))
    if {"infra", "near"} & words and "red" in words:
        return "nir"
    if words & _SHADES or "short" in words:
        return ""
    if len(words) == 1 and text.strip().lower() in _LETTERS:
        return _LETTERS[text.strip().lower()]
    found = {name for name, known in _WORDS.items() if words & known}
    return found.pop() if len(found) == 1 else ""
