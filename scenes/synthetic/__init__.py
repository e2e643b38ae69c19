"""The synthetic scene generator: terrain, streets, buildings, trees, and the simulated laser scanner and camera.

From truth to measurement: `recipe` (parameters) and `streams` (random numbers) -> `layout`, `terrain`, `buildings`,
`vegetation`, `clutter` -> `world` -> `lidar`, `orthoimage` (through `surface`, `lighting`), `survey` (the DEM),
`reference`. `make` puts them into a `Scene`, `presets` names recipes.
"""

from .make import make_scene
from .presets import preset_names
from .recipe import SceneParameters

__all__ = ["SceneParameters", "make_scene", "preset_names"]
