"""Columns and polygons as a GeoDataFrame; geopandas is imported when one is asked for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import geopandas as gpd

__all__ = ["geo_frame"]


def geo_frame(columns: Mapping[str, NDArray[Any]], polygons: NDArray[np.object_], crs: str | None) -> gpd.GeoDataFrame:
    """Return a GeoDataFrame; masked whole numbers stay whole, with <NA> where there is no value."""
    import geopandas
    import pandas as pd

    kept = {
        name: pd.arrays.IntegerArray(column.data.copy(), np.ma.getmaskarray(column))
        if np.ma.isMaskedArray(column) and np.issubdtype(column.dtype, np.integer)
        else column
        for name, column in columns.items()
        if name != "geometry"
    }
    return geopandas.GeoDataFrame(kept, geometry=polygons, crs=crs)
