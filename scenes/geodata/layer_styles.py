"""Default styles of the layers of a GeoPackage: QGIS draws a layer by the style that its file carries."""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path

from ...core.errors import OutputError

__all__ = ["add_layer_styles"]

#: The table as QGIS makes it, and its entry among the contents of the file.
_TABLE = """
CREATE TABLE layer_styles (
    id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, f_table_catalog TEXT(256), f_table_schema TEXT(256),
    f_table_name TEXT(256), f_geometry_column TEXT(256), styleName TEXT(30), styleQML TEXT, styleSLD TEXT,
    useAsDefault BOOLEAN, description TEXT, owner TEXT(30), ui TEXT(30),
    update_time DATETIME DEFAULT CURRENT_TIMESTAMP
)
"""
#: Of every entry: equal content gives equal bytes.
_DATE = "2000-01-01T00:00:00.000Z"


def add_layer_styles(path: Path, styles: Mapping[str, str]) -> None:
    """Add default styles to a GeoPackage.

    Parameters
    ----------
    path : Path
    styles : mapping of str to str
        Name of each layer to its style as QML.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    try:
        with closing(sqlite3.connect(path)) as connection, connection:
            connection.execute(_TABLE)
            connection.execute(
                "INSERT INTO gpkg_contents (table_name, data_type, identifier, last_change) "
                "VALUES ('layer_styles', 'attributes', 'layer_styles', ?)",
                [_DATE],
            )
            columns = dict(connection.execute("SELECT table_name, column_name FROM gpkg_geometry_columns"))
            connection.executemany(
                "INSERT INTO layer_styles (f_table_catalog, f_table_schema, f_table_name, f_geometry_column, "
                "styleName, styleQML, styleSLD, useAsDefault, description, owner, ui, update_time) "
                "VALUES ('', '', ?, ?, 'roofbench', ?, '', 1, 'verdicts of roofbench', '', NULL, ?)",
                [(layer, columns[layer], style, _DATE) for layer, style in styles.items() if layer in columns],
            )
    except sqlite3.Error as error:
        raise OutputError(f"{path.name} cannot be written: {error}") from error
