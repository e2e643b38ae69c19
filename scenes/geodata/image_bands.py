"""Bands of orthoimages: which colour each shows, by its description, by the colours of the file, or by its number."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from ...core.errors import InputError
from .band_descriptions import INFRARED_WORDS, described_band
from .infrared_values import unlike_infrared
from .opened_rasters import alpha_inside, opened
from .raster_headers import RasterHeader

__all__ = [
    "BANDS",
    "COLOUR_INFRARED",
    "IMAGE_TYPES",
    "alpha_of",
    "assumed_bands",
    "band_names",
    "described_bands",
    "infrared_bands",
    "looks_like_values",
    "named_infrared",
    "require_image_type",
    "require_infrared",
    "sampled_largest",
    "says_infrared",
]

#: Names that a band can have; any other in ``bands=`` is refused, ``-`` skips one.
BANDS = ("red", "green", "blue", "nir", "grey")
#: Most values of a mask.
_MOST_OF_MASK = 2
#: Types of the values of orthoimages.
IMAGE_TYPES = ("uint8", "uint16")
_DEFAULT_BANDS = {1: ("grey",), 3: ("red", "green", "blue"), 4: ("red", "green", "blue", "nir")}
#: Bands of colour infrared, and words of its file names.
COLOUR_INFRARED = ("nir", "red", "green")
_CIR_WORDS = {"cir", "irc", "irg", "nrg", "irrg", "fcir"}
#: Descriptions that say nothing, and those that only count.
_UNNAMED = {"undefined", "unknown", "other", "extra"}
_NUMBER = re.compile(r"(band|layer|channel|b)?[ _-]*\d+")


def band_names(header: RasterHeader, bands: Sequence[str] | None) -> tuple[str, ...]:
    """Return one name per band of a file, ``"-"`` for those to skip."""
    if bands is not None:
        unknown = [name for name in bands if name not in (*BANDS, "-")]
        if unknown:
            raise InputError(
                f"bands= has {unknown[0]!r}, which is not a band name; use {', '.join(BANDS)}, and - to skip one"
            )
        further = header.alpha or header.mask_band
        if len(bands) != header.band_count and not (further and len(bands) == header.band_count + 1):
            raise InputError(
                f"{header.path} has {header.band_count} bands, but bands= names {len(bands)} "
                f"({','.join(bands)}): name one for each, - to skip one"
            )
        named = [name for name in bands if name != "-"]
        if len(set(named)) != len(named) or not named:
            raise InputError(f"bands={','.join(bands)} must name at least one band and none twice")
        return tuple(bands)
    described = tuple(map(described_band, header.band_names))
    if all(described) and len(set(described)) == header.band_count:
        return described
    by_colour = _names_by_colour(header.colours)
    if by_colour is not None:
        return by_colour
    if header.band_count not in _DEFAULT_BANDS:
        raise InputError(
            f"{header.path} has {header.band_count} bands, expected 1 (grey), 3 (red, green, blue) or 4 (and nir): "
            "name them by bands=, - to skip one"
        )
    names = _DEFAULT_BANDS[header.band_count]
    shown = [colour if colour in ("red", "green", "blue") else "" for colour in header.colours]
    for found in (described, shown):
        wrong = [band for band, name in enumerate(found) if name and header.band_count > 1 and name != names[band]]
        if wrong:
            raise InputError(
                f"{header.path} says that its band {wrong[0] + 1} is {found[wrong[0]]}, and does not name all others: "
                f"name them by bands=, such as {','.join(names)}, - to skip one"
            )
    if "nir" in names and _says_other(header.band_names):
        raise InputError(
            f"{header.path} says that its band 4 is {header.band_names[3]!r}, which is not near infrared: name the "
            "bands by bands=, such as red,green,blue,-"
        )
    return names


def _says_other(texts: Sequence[str]) -> bool:
    """Return whether the last description names something; those that differ by a number alone only count."""
    text = texts[-1].strip()
    if not text or text in _UNNAMED or _NUMBER.fullmatch(text) or described_band(text):
        return False
    stems = {re.sub(r"\d+$", "", other.strip()) for other in texts}
    return len(stems) > 1 or not text[-1].isdecimal()


def _names_by_colour(colours: Sequence[str]) -> tuple[str, ...] | None:
    """Return names by colour interpretation, one band of no colour as near infrared; None when they do not do."""
    names = tuple({"gray": "grey", "undefined": "nir"}.get(colour, colour) for colour in colours)
    known = (["blue", "green", "red"], ["blue", "green", "nir", "red"], ["green", "nir", "red"])
    return names if sorted(names) in known else None


def assumed_bands(header: RasterHeader, bands: Sequence[str] | None) -> str | None:
    """Return a note on names of bands that the file does not give; None when it gives all of them."""
    names = band_names(header, bands)
    if bands is not None or len(names) == 1:
        return None
    if names == tuple(map(described_band, header.band_names)):
        by_colour = _names_by_colour(header.colours)
        if by_colour in (None, names):
            return None
        return (
            f"{header.path.name} describes its bands as {', '.join(names)} and marks them as {', '.join(by_colour)}: "
            "the descriptions were used"
        )
    texts = [text for text in header.band_names if text and not _NUMBER.fullmatch(text)]
    if texts:
        return (
            f"{header.path.name} describes its bands as {', '.join(map(repr, texts))}, which names not all colours: "
            f"they were taken for {', '.join(names)}"
        )
    if _names_by_colour(header.colours) is None:
        return f"{header.path.name} does not name its bands: they were taken for {', '.join(names)}"
    unnamed = [name for name, colour in zip(names, header.colours, strict=True) if name != colour]
    if unnamed:
        return f"{header.path.name} does not name band {names.index('nir') + 1}: it was taken for near infrared"
    return None


def described_bands(header: RasterHeader) -> tuple[str, ...]:
    """Return the names of the bands by their descriptions, empty texts for those that these do not name."""
    return tuple(map(described_band, header.band_names))


def named_infrared(header: RasterHeader) -> bool:
    """Return whether the name of a file says that it holds near infrared, alone or as colour infrared.

    >>> from types import SimpleNamespace
    >>> from pathlib import Path
    >>> [named_infrared(SimpleNamespace(path=Path(name))) for name in ("dop20_cir.tif", "ortho-IR-2024.tif", "air.tif")]
    [True, True, False]
    """
    words = set(re.findall(r"[^\W\d_]+", header.path.stem.lower()))
    return bool(words & (INFRARED_WORDS | _CIR_WORDS))


def says_infrared(header: RasterHeader) -> bool:
    """Return whether a file says that it holds near infrared and no blue: by its bands, else by its name."""
    described = described_bands(header)
    if header.band_count in (1, 3) and not any(described) and named_infrared(header):
        return True
    if header.band_count == 1:
        return described == ("nir",)
    if not all(described) and header.band_count not in _DEFAULT_BANDS:
        return False
    names = band_names(header, None)
    return "nir" in names and "blue" not in names


def infrared_bands(header: RasterHeader) -> tuple[str, ...] | None:
    """Return the names of the bands of a file of near infrared; None where it is not known which band that is."""
    if header.band_count == 1:
        return ("nir",)
    names = band_names(header, None)
    if "nir" in names:
        return names
    unnamed = header.band_count == 3 and not any(described_bands(header))
    return COLOUR_INFRARED if unnamed and named_infrared(header) else None


def alpha_of(header: RasterHeader, names: Sequence[str]) -> bool | None:
    """Return whether the last band is read as a mask (True), as values (False), or as the file marks it (None)."""
    if len(names) > header.band_count and (names[-1] != "-" or alpha_inside(header.path)):
        return False
    return True if header.mask_band else None


def looks_like_values(header: RasterHeader) -> bool:
    """Return whether the band that is marked as alpha holds more than opaque and transparent."""
    if not header.alpha:
        return False
    with opened(header.path) as source:
        rows, columns = (min(side, 512) for side in source.shape)
        values = source.read(source.count, out_shape=(rows, columns))
    limits = (0, 1, np.iinfo(values.dtype).max) if values.dtype.kind == "u" else (0, 1, 255)
    # Soft edges of a mosaic have some values between, and few pixels.
    return len(np.unique(values)) > 8 or float(np.isin(values, limits, invert=True).mean()) > 0.1


def require_infrared(header: RasterHeader, bands: Sequence[str] | None) -> None:
    """Raise `InputError` where a band that is taken for near infrared has values that are not, of a sample.

    A band that the file or the user names is near infrared, unless it has one value or two, as a mask has.
    """
    names = band_names(header, bands)
    if "nir" not in names:
        return
    assumed = assumed_bands(header, bands) is not None
    indexes = [index for index, name in enumerate(names, start=1) if name != "-"]
    with opened(header.path, alpha=alpha_of(header, names)) as source:
        shape = tuple(min(side, 512) for side in source.shape)
        values = source.read(indexes, out_shape=(len(indexes), *shape), masked=True)
    known = ~np.ma.getmaskarray(values).any(axis=0)
    by_name = {name: values.data[row][known] for row, name in enumerate(name for name in names if name != "-")}
    infrared = by_name.pop("nir")
    reason = unlike_infrared(infrared, by_name) if known.any() else None
    if reason and not assumed and len(np.unique(infrared)) <= _MOST_OF_MASK:
        raise InputError(
            f"{header.path}: the band that is named near infrared {reason}: name another one by bands=, or - to skip it"
        )
    if reason and assumed:
        skipped = ",".join("-" if name == "nir" else name for name in names)
        raise InputError(
            f"{header.path} does not name band {names.index('nir') + 1}, which {reason}, so it is not taken for near "
            f"infrared: name the bands by bands=, such as {skipped}"
        )


def sampled_largest(header: RasterHeader, names: Sequence[str]) -> int:
    """Return the largest value of an image among a million pixels or fewer, where it has data."""
    indexes = [index for index, name in enumerate(names, start=1) if name != "-"]
    with opened(header.path, alpha=alpha_of(header, names)) as source:
        shape = tuple(min(side, 1024) for side in source.shape)
        return int(source.read(indexes, out_shape=(len(indexes), *shape), masked=True).filled(0).max(initial=0))


def require_image_type(header: RasterHeader) -> None:
    """Raise `InputError` unless the values can be those of an orthoimage."""
    if header.dtype not in IMAGE_TYPES:
        raise InputError(
            f"{header.path} has {header.dtype} values, an orthoimage needs uint8 or uint16: convert it, for instance "
            "with gdal_translate -ot Byte -scale"
        )
