"""Where a filtered ground is unsure: far from any ground point, raised within walls, or cut off with a terrace.

Nouns
-----
far
    Cells with points whose nearest cell with a ground point lies more than `_FAR` metres away, or that have hardly any
    ground points around, unless these surround the gap and lie on a plane: the middle of a block in relief, dense
    forest, streets narrower than the steps of a smooth surface are wide. The ground there is interpolated.
raised
    Parts that the filter left although steps down surround them, or nearly half of them where the border of the scene
    cuts them (`raised`).
low
    Parts that the filter took off as buildings, so wide and so low that a terrace held by walls looks the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geodata.raster import Elevation, Grid
from .raised import raised_parts

__all__ = ["Doubt", "doubtful_ground"]

_Mask = NDArray[np.bool_]

#: Metres, see above: a hall of 80 m width has its middle 40 m from the ground beside it.
_FAR = 40.0
#: Share of the cells in a square of `_FAR` metres that must be ground points: fewer do not separate streets from roofs.
_SCARCE = 0.05
#: Share of the cells around a gap that must be ground points.
_SURROUNDED = 0.5
#: Metres: deviation of nineteen in twenty of the ground cells around a gap from a plane, up to which it is one.
_PLANE = 0.5
#: Metres beside a gap that show whether the ground around it is a plane.
_RIM = 5.0
#: Metres: lower steps surround land between ditches and canals.
_STEP = 3.0
#: Share of the outline of a part that must be steps, and where the border of the scene is the rest of it: a roof cut at
#: a corner has half, the upper side of a cliff through the scene a third.
_RINGED, _RINGED_OF_CUT = 0.6, 0.45
#: Share of the scene from which on a note is written, and how many places it names.
_SHARE, _NAMED = 0.001, 3


@dataclass(frozen=True, eq=False)
class Doubt:
    """Where a filtered ground is unsure, and why.

    Attributes
    ----------
    grid : Grid
    reasons : dict of str to ndarray of bool, shape (rows, columns)
        Cells by the reason, in words.
    """

    grid: Grid
    reasons: dict[str, _Mask]

    @property
    def cells(self) -> _Mask:
        """All doubtful cells, shape (rows, columns)."""
        found = np.zeros(self.grid.shape, dtype=bool)
        for part in self.reasons.values():
            found |= part
        return found

    def in_voids_of(self, dem: Elevation) -> Doubt:
        """Return what remains where a terrain model has no height."""
        row, column = np.indices(self.grid.shape)
        x, y = self.grid.to_world(row.ravel() + 0.5, column.ravel() + 0.5)
        index, inside = dem.grid.cells(x, y)
        known = np.zeros(len(x), dtype=bool)
        known[inside] = np.isfinite(dem.values.ravel()[index[inside]])
        void = ~known.reshape(self.grid.shape)
        return Doubt(self.grid, {reason: part & void for reason, part in self.reasons.items()})

    def note(self) -> str | None:
        """Return a note on the doubtful share of the scene, its largest places and the remedy; None if it is tiny."""
        import cv2

        cells = self.cells
        share = float(cells.mean()) if cells.size else 0.0
        if share < _SHARE:
            return None
        places, number_of_places = [], 0
        for reason, part in self.reasons.items():
            count, labels, statistics, _ = cv2.connectedComponentsWithStats(part.astype(np.uint8), connectivity=4)
            inner = cv2.distanceTransform(np.pad(part, 1).astype(np.uint8), cv2.DIST_L2, 3)[1:-1, 1:-1]
            sizes = statistics[1:, cv2.CC_STAT_AREA]
            number_of_places += count - 1
            for number in (1 + np.argsort(-sizes)[:_NAMED]).tolist() if count > 1 else ():
                # A place well inside the part; its centre may lie outside of it.
                row, column = np.unravel_index(int(np.argmax(np.where(labels == number, inner, -1))), part.shape)
                x, y = self.grid.to_world(row + 0.5, column + 0.5)
                area = float(sizes[number - 1]) * self.grid.gsd**2
                places.append((area, f"{area:,.0f} m2 around {float(x):.0f} {float(y):.0f} ({reason})"))
        named = [text for _, text in sorted(places, reverse=True)[:_NAMED]]
        elsewhere = " and elsewhere" if number_of_places > _NAMED else ""
        return (
            f"the filtered ground is uncertain on {share:.1%} of the scene: {', '.join(named)}{elsewhere}; "
            "check heights there, or give a terrain model as DEM"
        )


def doubtful_ground(ground: Elevation, seen: _Mask, covered: _Mask, low: _Mask, *, smooth: bool = False) -> Doubt:
    """Return the cells where a filtered ground is unsure.

    Parameters
    ----------
    ground : Elevation
        The filtered ground.
    seen : ndarray of bool, shape (rows, columns)
        Cells with a point on the ground.
    covered : ndarray of bool, shape (rows, columns)
        Cells with any point; without one (water) nothing is said.
    low : ndarray of bool, shape (rows, columns)
        Objects that may be terraces.
    smooth : bool
        Whether steps rise within some metres (`steps.SMOOTH`).
    """
    return Doubt(
        ground.grid,
        {
            "hardly any ground point around": _far(ground, seen, covered),
            "left as ground although steps surround it: may be a roof": _raised(ground, smooth=smooth),
            "taken off as a wide low building: may be a terrace": low,
        },
    )


def _far(ground: Elevation, seen: _Mask, covered: _Mask) -> _Mask:
    """Return the cells far from seen ground, or with hardly any around, unless it surrounds them as a plane."""
    import cv2

    if not seen.any():
        return covered.copy()
    cell = ground.grid.gsd
    away = cv2.distanceTransform((~seen).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * cell
    square = (2 * round(_FAR / 2 / cell) + 1,) * 2
    near, all_near = (
        cv2.blur(cells.astype(np.float32), square, borderType=cv2.BORDER_REFLECT) for cells in (seen & covered, covered)
    )
    far = np.asarray(covered & ((away > _FAR) | (~seen & (near < _SCARCE * all_near))))
    if not far.any():
        return far
    _, labels, statistics, _ = cv2.connectedComponentsWithStats((~seen).astype(np.uint8), connectivity=4)
    reach = max(1, round(_RIM / cell))
    rows, columns = seen.shape
    for number in np.unique(labels[far]).tolist():
        left, top, width, height = (int(value) for value in statistics[number, :4])
        if left == 0 or top == 0 or left + width == columns or top + height == rows:
            continue
        window = np.s_[max(top - reach, 0) : top + height + reach, max(left - reach, 0) : left + width + reach]
        gap = labels[window] == number
        around = (cv2.dilate(gap.astype(np.uint8), np.ones((2 * reach + 1,) * 2, np.uint8)) > 0) & ~gap
        if seen[window][around].mean() > _SURROUNDED and _is_plane(ground.values[window], around & seen[window]):
            far[window] &= ~gap
    return far


def _is_plane(values: NDArray[np.float32], cells: _Mask) -> bool:
    """Return whether the heights of some cells lie on a plane."""
    row, column = np.nonzero(cells)
    if len(row) < 3:
        return False
    heights = values[cells].astype(np.float64)
    place = np.column_stack([row, column, np.ones(len(row))])
    plane = np.linalg.lstsq(place, heights, rcond=None)[0]
    return float(np.quantile(np.abs(heights - place @ plane), 0.95)) < _PLANE


def _raised(ground: Elevation, *, smooth: bool) -> _Mask:
    """Return the parts of the ground within rings of steps down."""
    values = ground.values.astype(np.float32)
    raised = raised_parts(values, np.isnan(values), ground.grid.gsd, smooth=smooth)
    standing = [part for part in raised.parts if part.fall >= _STEP and part.stands(_RINGED, _RINGED_OF_CUT)]
    return raised.cells(standing)
