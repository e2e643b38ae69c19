"""Make a scene: from a preset's name and a seed to measurements and truth."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from ...core.errors import ParameterError
from ..builtin import hamlet
from ..scene import Scene
from .presets import preset
from .recipe import SceneParameters

if TYPE_CHECKING:
    from ..geodata.footprints import Footprints
    from ..geodata.points import PointCloud
    from ..geodata.raster import Elevation, Image
    from .world import World

__all__ = ["GENERATOR", "make_scene", "scene_of"]

#: Version of the generator: raised whenever the same recipe and seed give another scene.
GENERATOR = 5
#: Lower left corner of every synthetic scene, metres.
ORIGIN = (320000.0, 5810000.0)


def make_scene(preset_name: str, *, seed: int = 1, **parameters: Any) -> Scene:
    """Return a synthetic scene: the same for the same preset, seed and parameters, bit for bit.

    Points, image, DEM and reference are each made when first asked for.

    Parameters
    ----------
    preset_name : str
        ``"fairfield"``, ``"knox-small"``, ...; see `preset_names`. ``"hamlet"`` is the built-in scene, without
        parameters.
    seed : int
        Counts from 1, as in suites and on the command line.
    **parameters
        Any of `SceneParameters`, instead of the preset's values.

    Examples
    --------
    >>> scene = make_scene("fairfield-small", seed=1, tree_density=40)
    >>> len(scene.reference)
    12
    """
    if preset_name == "hamlet" and not parameters:
        return hamlet(seed)
    recipe = preset(preset_name, **parameters)
    axes = ",".join(f"{key}={getattr(recipe, key)}" for key in parameters)
    name = f"{preset_name}-{seed}" + (f"[{axes}]" if axes else "")
    return scene_of(recipe, seed=seed, name=name, preset=preset_name)


def scene_of(recipe: SceneParameters, *, seed: int, name: str = "synthetic", preset: str | None = None) -> Scene:
    """Return the scene of a recipe.

    Raises
    ------
    ParameterError
        When the seed is negative; when the extent is too small for the buildings.
    """
    if isinstance(seed, bool) or int(seed) != seed or seed < 0:
        raise ParameterError(f"{name}: seed must be a whole number of at least 0, not {seed!r}")
    seed = int(seed)
    extent = (ORIGIN[0], ORIGIN[1], ORIGIN[0] + recipe.width, ORIGIN[1] + recipe.height)

    # Imported when a piece is asked for: listing presets must not wait for the compiler.
    @cache
    def world() -> World:
        from .world import make_world

        return make_world(recipe, seed)

    @cache
    def photo() -> Image | None:
        from .orthoimage import photograph

        return photograph(world(), ORIGIN)

    @cache
    def coloured() -> PointCloud:
        from .image_making import coloured_points
        from .lidar import scan

        cloud, taken = scan(world(), ORIGIN), photo()
        return cloud if taken is None else coloured_points(cloud, taken)

    def points() -> PointCloud:
        from .lidar import scan

        return coloured() if recipe.point_colours else scan(world(), ORIGIN)

    def image() -> Image | None:
        from .image_making import processed, rastered

        made = photo() if recipe.image_from == "camera" else rastered(coloured(), extent, recipe)
        return None if made is None else processed(made, recipe.image_processing)

    def dem() -> Elevation:
        from .survey import measured_dem

        return measured_dem(world(), ORIGIN)

    def reference() -> Footprints:
        from .reference import digitise

        return digitise(world(), ORIGIN)

    return Scene(
        name,
        extent,
        crs=f"EPSG:{recipe.epsg}",
        points=points,
        image=image if recipe.bands != "none" else None,
        dem=dem,
        reference=reference,
        facts={
            "source": f"made by roofbench, generator version {GENERATOR}",
            "licence": "CC0-1.0",
            "preset": preset or "",
            "seed": seed,
            "parameters": recipe.values(),
        },
    )
