"""Scenes: the measurements of one place, with its ground truth.

A *scene* has a name, an extent in metres of a projected CRS, and any of: points, orthoimage, DEM (bare earth),
reference footprints and evaluation area (where the reference is complete). Each is read when it is first asked for.
A detector receives `Scene.for_detection`: measurements only, neither reference nor classification.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol, TypedDict, Unpack, runtime_checkable

import numpy as np
import shapely

from ..core.display import Displayed
from ..core.errors import InputError, MissingInputError
from .geodata.footprints import Footprints
from .geodata.points import PointCloud
from .geodata.raster import Elevation, Grid, Image

if TYPE_CHECKING:
    from .ground.heights import Heights

__all__ = ["INPUTS", "NEUTRAL_NAME", "LayerFiles", "Layers", "Scene"]

#: The name of every scene that a detector sees: a real one would lead to the seed, and so to the reference.
NEUTRAL_NAME = "scene"

#: What a detector may require, and how it is named to people.
INPUTS: Mapping[str, str] = {
    "points": "point cloud",
    "image": "orthoimage",
    "colour": "orthoimage with red, green and blue",
    "brightness": "orthoimage with red, green and blue, or a grey one",
    "nir": "orthoimage with a near-infrared band",
    "dem": "bare-earth DEM",
}


class Layers(TypedDict, total=False):
    """The layers of a scene: each the value, or a function without arguments that reads it when it is first used."""

    points: PointCloud | Callable[[], PointCloud | None] | None
    image: Image | Callable[[], Image | None] | None
    dem: Elevation | Callable[[], Elevation | None] | None
    reference: Footprints | Callable[[], Footprints | None] | None
    area: shapely.Geometry | Callable[[], shapely.Geometry | None] | None


_LAYERS = tuple(Layers.__annotations__)


@runtime_checkable
class LayerFiles(Protocol):
    """A layer in files: called, it reads the whole; a window reads its part alone."""

    def __call__(self) -> Any:
        """Read the layer."""

    def window(self, extent: tuple[float, float, float, float]) -> Any:
        """Read the part inside ``(xmin, ymin, xmax, ymax)``, metres."""

    def digest(self, extent: tuple[float, float, float, float]) -> str:
        """Return a text that changes when the files that hold this part change; they are not read."""

    def meets(self, extent: tuple[float, float, float, float]) -> bool:
        """Return whether a file may hold something inside an extent."""


class Scene(Displayed):
    """A place with its measurements and its ground truth.

    Parameters
    ----------
    name : str
    extent : tuple of float
        ``(xmin, ymin, xmax, ymax)``, metres.
    crs : str, optional
        Authority code or WKT.
    points, image, dem, reference, area
        Layers: the value, or a function without arguments that reads it when it is first used, or None.
    content_hash : str or function, optional
        Digest of everything the scene holds; computed from the arrays when not given.
    facts : mapping, optional
        Provenance that JSON can hold: source, licence, generator parameters.
    """

    shown_by = "reports.notebook_view:scene_view"

    def __init__(
        self,
        name: str,
        extent: tuple[float, float, float, float],
        *,
        crs: str | None = None,
        content_hash: str | Callable[[], str] | None = None,
        facts: Mapping[str, Any] | None = None,
        **layers: Unpack[Layers],
    ) -> None:
        xmin, ymin, xmax, ymax = map(float, extent)
        if not (xmax > xmin and ymax > ymin):
            raise InputError(f"scene {name!r}: the extent {extent} is not [xmin, ymin, xmax, ymax] of an area")
        self.name = name
        self.extent = (xmin, ymin, xmax, ymax)
        self.crs = crs
        self.facts = dict(facts or {})
        unknown = sorted(set(layers) - set(_LAYERS))
        if unknown:
            raise TypeError(f"Scene() has no layer {unknown[0]!r}: there are {', '.join(_LAYERS)}")
        self._sources: dict[str, Any] = {name: layers.get(name) for name in _LAYERS}
        self._content_hash = content_hash
        self._heights: Heights | None = None
        self._is_for_detection = False
        #: Cell size of the ground filter, metres, which windows take over; None: from the density of the points.
        self.ground_cell: float | None = None
        #: Part of the extent whose buildings are wanted: of a window its extent without the halo.
        self.core = self.extent
        #: What a detector counted on the whole scene (`Detector.survey`), which windows take over; empty: count here.
        self.whole: Mapping[str, Any] = {}

    @property
    def contents(self) -> tuple[str, ...]:
        """What the scene holds, unread: some of ``points``, ``image``, ``dem``, ``reference``, ``area``."""
        return tuple(name for name, source in self._sources.items() if source is not None)

    def __repr__(self) -> str:
        return f"<Scene {self.name}: {', '.join(self.contents) or 'empty'}>"

    def _get(self, name: str) -> Any:
        value = self._sources[name]
        if callable(value):
            value = self._sources[name] = value()
        return value

    @property
    def points(self) -> PointCloud | None:
        """Point cloud, or None."""
        value: PointCloud | None = self._get("points")
        return value

    @property
    def image(self) -> Image | None:
        """Orthoimage, or None."""
        value: Image | None = self._get("image")
        return value

    @property
    def dem(self) -> Elevation | None:
        """Bare-earth elevation, or None."""
        value: Elevation | None = self._get("dem")
        return value

    @property
    def heights(self) -> Heights:
        """Heights above ground: the DEM where it is known, elsewhere the ground filter; computed at first use."""
        if self._heights is None:
            # The ground filter is compiled code, which takes a while to load.
            from .ground.heights import heights_of

            self._heights = heights_of(self.points, self.dem, self.extent, cell=self.ground_cell)
        return self._heights

    @property
    def notes(self) -> tuple[str, ...]:
        """What was estimated because the scene does not hold it, one sentence each; empty until it is used."""
        return self._heights.notes if self._heights is not None else ()

    @property
    def reference(self) -> Footprints | None:
        """Reference footprints, or None."""
        value: Footprints | None = self._get("reference")
        return value

    @property
    def area(self) -> shapely.Geometry | None:
        """Polygon inside which the reference is complete, or None when it is complete everywhere."""
        return self._get("area")

    @property
    def evaluation_grid(self) -> Grid | None:
        """Grid of the orthoimage, on which pixel indices are counted; None without an image."""
        return self.image.grid if self.image is not None else None

    @property
    def content_hash(self) -> str:
        """Digest that changes when anything that the scene holds changes."""
        if callable(self._content_hash):
            self._content_hash = self._content_hash()
        if self._content_hash is None:
            self._content_hash = self._digest()
        return self._content_hash

    def lacks(self, requires: tuple[str, ...]) -> str | None:
        """Return why a detector with these requirements cannot run here, or None when it can."""
        for need in requires:
            if need not in INPUTS:
                raise InputError(f"{need!r} is not a supported scene input: use {', '.join(INPUTS)}")
            if not self._holds(need):
                return f"scene {self.name!r} has no {INPUTS[need]}"
        return None

    def _holds(self, need: str) -> bool:
        if need in ("points", "dem"):
            return self._get(need) is not None
        image = self.image
        if image is None or need == "image":
            return image is not None
        if need in ("colour", "brightness"):
            return image.is_colour or (need == "brightness" and image.has_brightness)
        return need in image.bands

    def require(self, requires: tuple[str, ...]) -> None:
        """Raise `MissingInputError` when the scene lacks one of the inputs."""
        reason = self.lacks(requires)
        if reason:
            raise MissingInputError(reason)

    def window(self, extent: Sequence[float], halo: float = 0.0) -> Scene:
        """Return the part of the scene inside an extent, read by window where the layers lie in files.

        Reference footprints that meet the window are kept whole. The ground of the part is that of its own DEM and
        points, so that away from its border it is that of the scene (set `ground_cell` where there is no complete DEM);
        take a `halo` of the width that does not count.

        Parameters
        ----------
        extent : sequence of float
            ``(xmin, ymin, xmax, ymax)``, metres.
        halo : float
            Metres around the extent that belong to the part, too.

        Raises
        ------
        InputError
            The extent does not meet the scene.
        """
        (xmin, ymin, xmax, ymax), own = extent, self.extent
        low_x, low_y = max(xmin - halo, own[0]), max(ymin - halo, own[1])
        high_x, high_y = min(xmax + halo, own[2]), min(ymax + halo, own[3])
        if not (high_x > low_x and high_y > low_y):
            raise InputError(f"scene {self.name!r} lies in {own}: the window {tuple(extent)} does not meet it")
        wanted = (low_x, low_y, high_x, high_y)
        layers: Layers = {}
        for name in _LAYERS:
            if self._sources[name] is not None:
                layers[name] = partial(self._part, name, wanted)  # type: ignore[literal-required]
        part = Scene(
            self.name,
            wanted,
            crs=self.crs,
            facts=self.facts,
            content_hash=partial(self._part_hash, wanted),
            **layers,
        )
        part.ground_cell, part.whole = self.ground_cell, self.whole
        part.core = max(xmin, own[0]), max(ymin, own[1]), min(xmax, own[2]), min(ymax, own[3])
        return part

    def is_empty(self, extent: tuple[float, float, float, float], halo: float = 0.0) -> bool:
        """Return whether all measurements lie in files of which none meets a window."""
        xmin, ymin, xmax, ymax = extent
        wanted = (xmin - halo, ymin - halo, xmax + halo, ymax + halo)
        sources = [self._sources[name] for name in ("points", "image", "dem") if self._sources[name] is not None]
        return all(isinstance(source, LayerFiles) and not source.meets(wanted) for source in sources)

    def _part(self, name: str, extent: tuple[float, float, float, float]) -> Any:
        """Return a layer inside an extent; a layer in files is not kept."""
        source = self._sources[name]
        if isinstance(source, LayerFiles):
            return source.window(extent)
        value = self._get(name)
        if value is None:
            return None
        if name == "area":
            return shapely.intersection(value, shapely.box(*extent))
        if name == "reference":
            return value.take(shapely.intersects(value.polygons, shapely.box(*extent)))
        return value.window(extent)

    def _part_hash(self, extent: tuple[float, float, float, float]) -> str:
        sources = [source for source in self._sources.values() if source is not None]
        if all(isinstance(source, LayerFiles) for source in sources):
            files = [source.digest(extent) for source in sources]
        else:
            files = [self.content_hash]
        return hashlib.sha256(repr((extent, self.crs, files)).encode()).hexdigest()

    @property
    def left_out(self) -> tuple[str, ...]:
        """Files of its folder that are no part of the scene, with the reason."""
        return tuple(self.facts.get("left_out", ()))

    def for_detection(self) -> Scene:
        """Return the scene as a detector may see it: measurements under a neutral name, and nothing else.

        It has no reference, area, classification or facts, and holds no object, function or path that leads to them:
        the layers are read here. Such a scene returns itself.
        """
        if self._is_for_detection:
            return self
        cloud = self.points
        seen = Scene(
            NEUTRAL_NAME,
            self.extent,
            crs=self.crs,
            points=None if cloud is None else cloud.unclassified(),
            image=self.image,
            dem=self.dem,
        )
        seen.ground_cell, seen.core, seen.whole = self.ground_cell, self.core, self.whole
        seen._is_for_detection = True
        return seen

    def _digest(self) -> str:
        digest = hashlib.sha256(repr((self.extent, self.crs)).encode())

        def add(*arrays: Any) -> None:
            for array in arrays:
                if array is not None:
                    digest.update(repr((array.dtype.str, array.shape)).encode())
                    digest.update(np.ascontiguousarray(array).tobytes())

        if (cloud := self.points) is not None:
            add(cloud.x, cloud.y, cloud.z, cloud.return_number, cloud.number_of_returns)
            add(cloud.intensity, cloud.classification, cloud.colour, cloud.source)
        if (image := self.image) is not None:
            digest.update(repr((image.bands, image.grid)).encode())
            add(image.values, image.valid)
        if (dem := self.dem) is not None:
            digest.update(repr(dem.grid).encode())
            add(dem.values)
        if (reference := self.reference) is not None:
            for wkb in shapely.to_wkb(reference.polygons):
                digest.update(wkb)
            digest.update(reference.building_codes.tobytes())
        if self.area is not None:
            digest.update(shapely.to_wkb(self.area))
        return digest.hexdigest()
