"""Near infrared of another file on the scale of the colours beside it.

Vegetation indices compare near infrared with red, so that both need one scale. Files of one survey often differ in it:
RGB in 8 bit, stretched for the eye, and infrared in 16 bit, as the sensor counted, or as reflectance.

Nouns
-----
share
    Value as a share of white: 255 in 8 bit, the largest value of its depth in 16 bit, and of other types the least of
    `_WHITES` that holds nearly all values (reflectance, percent, 8 bit, reflectance times 10 000, 16 bit).
gain
    Factor from shares of near infrared to those of the colours: 1 where they agree. A file that has red as well as
    near infrared (colour infrared, CIR) gets the gain by which its red becomes that of the orthoimage. Of near infrared
    alone, grey surfaces say whether the scales agree: concrete, asphalt, slate and gravel are about as bright in it as
    in red, whatever the sensor. Only where the ratio is outside of `_TOLERATED`, the gain makes it `_RATIO`, since the
    true one is not known better than that.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

__all__ = ["band_of_shares", "gain_of_grey_surfaces", "gain_of_red", "shows_red_and_green_of", "white_of"]

_Floats = NDArray[np.float32]

#: Values of white where the type does not say it, and by how much some values may exceed them (reflectance of glints).
_WHITES, _GLINT = (1.0, 100.0, 255.0, 10_000.0, 65_535.0), 1.05
#: Shares below and above which pixels are shadow or saturated.
_DARK, _BRIGHT = 0.05, 0.97
#: Largest difference of red, green and blue of a grey surface, as a share of the largest.
_GREY = 0.15
#: Ratios of near infrared to red of grey surfaces that are taken as they are, and the one that others get. Haze
#: brightens red more; and a gain that is too large makes roofs vegetation, one that is a little too small does not.
_TOLERATED, _RATIO = (0.5, 1.6), 0.9
#: Least number of pixels for a gain, and least correlation of the two red bands.
_FEWEST, _LEAST_CORRELATION = 200, 0.5
#: A gain this near to 1 is rounding.
_ROUNDING = 0.02
#: Correlation from which two bands show the same colour of one flight.
_SAME_COLOUR = 0.97


def white_of(values: _Floats, dtype: str, depth: int) -> float:
    """Return the value of white in a band.

    Parameters
    ----------
    values : ndarray of float32
        NaN without data.
    dtype : str
        Type of the values in the file.
    depth : int
        Bits of the values of uint16.

    Examples
    --------
    >>> white_of(np.float32([0.1, 0.9]), "float32", 16), white_of(np.float32([120, 9000]), "int16", 16)
    (1.0, 10000.0)
    >>> white_of(np.float32([0, 90]), "uint8", 16), white_of(np.float32([0, 3000]), "uint16", 12)
    (255.0, 4095.0)
    """
    if dtype == "uint8":
        return 255.0
    if dtype == "uint16":
        return float((1 << depth) - 1)
    known = values[np.isfinite(values)]
    largest = float(np.quantile(known, 0.999)) if len(known) else 0.0
    return next((white for white in _WHITES if largest <= _GLINT * white), largest)


def band_of_shares(shares: _Floats, dtype: str) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """Return shares of white, NaN without data, as values of an image; those without data are 0.

    >>> band_of_shares(np.float32([0.5, 1.2, np.nan]), "uint8").tolist()
    [128, 255, 0]
    """
    top = np.float32(np.iinfo(dtype).max)
    values: NDArray[np.uint8] | NDArray[np.uint16] = np.clip(np.rint(np.nan_to_num(shares) * top), 0, top).astype(dtype)
    return values


def gain_of_grey_surfaces(infrared: _Floats, colours: Mapping[str, _Floats]) -> float:
    """Return the gain of near infrared by the surfaces that are grey in red, green and blue; 1 where it may be right.

    Parameters
    ----------
    infrared : ndarray, shape (n,)
        Shares.
    colours : mapping of str to ndarray, shape (n,)
        Shares of red, green and blue.

    Examples
    --------
    >>> grey = np.linspace(0.1, 0.9, 1000, dtype=np.float32)
    >>> colours = dict.fromkeys(("red", "green", "blue"), grey)
    >>> round(gain_of_grey_surfaces(grey / 8, colours), 3), gain_of_grey_surfaces(grey * 0.8, colours)
    (7.2, 1.0)
    """
    if not {"red", "green", "blue"} <= colours.keys():
        return 1.0
    bands = np.stack([colours[name] for name in ("red", "green", "blue")])
    top = bands.max(axis=0)
    # Leaves are greener than red, however pale.
    grey = (top > _DARK) & (top < _BRIGHT) & (top - bands.min(axis=0) < _GREY * top) & (bands[1] <= 1.02 * bands[0])
    grey &= infrared > 0
    if np.count_nonzero(grey) < _FEWEST:
        return 1.0
    ratio = float(np.median(infrared[grey] / bands[0, grey]))
    return 1.0 if _TOLERATED[0] <= ratio <= _TOLERATED[1] else _RATIO / ratio


def gain_of_red(own: _Floats, red: _Floats) -> float | None:
    """Return the gain that makes the red of colour infrared that of the colours; None where they do not agree.

    Examples
    --------
    >>> red = np.linspace(0.1, 0.9, 1000, dtype=np.float32)
    >>> round(gain_of_red(red / 2, red), 3), gain_of_red(red[::-1], red)
    (2.0, None)
    """
    used = (own > 0) & (red > _DARK) & (red < _BRIGHT)
    if np.count_nonzero(used) < _FEWEST or _correlation(own[used], red[used]) < _LEAST_CORRELATION:
        return None
    gain = float(np.median(red[used] / own[used]))
    return 1.0 if abs(gain - 1) <= _ROUNDING else gain


def shows_red_and_green_of(bands: NDArray[np.float32], colours: Mapping[str, _Floats]) -> bool:
    """Return whether three bands are near infrared, red and green of the flight of an image in colour.

    Their second and third band are then its red and green, whatever the gain, and more than its other bands.

    Parameters
    ----------
    bands : ndarray, shape (3, n)
    colours : mapping of str to ndarray, shape (n,)

    Examples
    --------
    >>> red, green, blue, nir = np.random.default_rng(0).random((4, 1000), dtype=np.float32)
    >>> colours = {"red": red, "green": green, "blue": blue}
    >>> shows_red_and_green_of(np.stack([nir, red, green]), colours), shows_red_and_green_of(
    ...     np.stack([red, green, blue]), colours
    ... )
    (True, False)
    """
    if bands.shape[1] < _FEWEST or not {"red", "green", "blue"} <= colours.keys():
        return False
    for band, name in ((bands[1], "red"), (bands[2], "green")):
        found = {colour: _correlation(band, values) for colour, values in colours.items()}
        if found[name] < _SAME_COLOUR or max(found, key=found.__getitem__) != name:
            return False
    return _correlation(bands[0], colours["red"]) < _SAME_COLOUR


def _correlation(one: _Floats, two: _Floats) -> float:
    a, b = one.astype(np.float64) - one.mean(), two.astype(np.float64) - two.mean()
    spread = float(np.sqrt((a * a).sum() * (b * b).sum()))
    return float((a * b).sum()) / spread if spread else 0.0
