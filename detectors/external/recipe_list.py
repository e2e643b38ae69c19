"""The recipes: installed tools that `command` runs by a script that comes with roofbench.

Each script is a module of `recipes`. It does what users of the tool would do, and all outline their buildings by the
same code (`recipes.recipe_scene`), so that the tools are compared and not the outlines.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...core.package import NAME

__all__ = ["RECIPES", "Recipe"]


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """A tool and the module that uses it.

    Attributes
    ----------
    file : str
        Module in the folder ``recipes``.
    packages : tuple of str
        Python distributions that it needs, and whose versions are part of the key.
    programs : tuple of str
        Executables that it needs, and whose content is part of the key.
    """

    file: str
    packages: tuple[str, ...] = ()
    programs: tuple[str, ...] = ()

    @property
    def module(self) -> str:
        """The module for ``python -m``."""
        return f"{NAME}.detectors.external.recipes.{self.file}"


RECIPES: dict[str, Recipe] = {
    "cloth-filter": Recipe(file="cloth_filter", packages=("cloth-simulation-filter",)),
    "grass": Recipe(file="grass_lidar", programs=("grass",)),
    "pysmrf": Recipe(file="pysmrf_filter", packages=("pysmrf",)),
    "saga": Recipe(file="saga_slope", programs=("saga_cmd",)),
    "whitebox": Recipe(file="whitebox_classes", packages=("whitebox-workflows",)),
}
