"""The parameters of a synthetic scene: with a seed they define it completely.

Nouns
-----
recipe
    One value for every parameter. A preset is a recipe with a name; a sweep changes one of its values.
zone
    What a block is used for: houses, halls (industry), towers (downtown) or nothing (park, meadow).

Units are metres and degrees; shares lie between 0 and 1; densities are per hectare.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ...core.errors import ParameterError
from ...core.parameters import Parameterised, parameter

__all__ = ["MOST_TREES", "SceneParameters"]

#: Upper bound of the tree density, per hectare: candidates are drawn for it and thinned (see `vegetation`).
MOST_TREES = 300.0

_2011 = "Awrangjeb, Zhang & Fraser 2011, section 3"


@dataclass(frozen=True, kw_only=True)
class SceneParameters(Parameterised):
    """A recipe: everything but the seed.

    Raises
    ------
    ParameterError
        For a value outside its range, or values that contradict each other; the message names both.
    """

    name: ClassVar[str] = "scene generator"

    width: float = parameter(250.0, unit="m", minimum=40, maximum=2000, doc="extent from west to east")
    height: float = parameter(250.0, unit="m", minimum=40, maximum=2000, doc="extent from south to north")
    epsg: int = parameter(32756, minimum=1024, maximum=998999, doc="projected CRS of the scene")

    elevation: float = parameter(20.0, unit="m", minimum=-500, maximum=5000, doc="lowest natural ground")
    slope: float = parameter(1.0, unit="deg", minimum=0, maximum=40, doc="dip of the plane below the relief")
    aspect: float = parameter(35.0, unit="deg", minimum=0, maximum=360, doc="direction of ascent, from east over north")
    undulation: float = parameter(
        3.0,
        unit="m",
        minimum=0,
        maximum=200,
        doc="height range of the relief; its square adds to that of the plane",
    )
    terracing: float = parameter(0.8, minimum=0, maximum=1, doc="how far the ground under a building is levelled")

    orientation: float = parameter(8.0, unit="deg", minimum=-180, maximum=180, doc="direction of the streets")
    winding: float = parameter(0.0, unit="m", minimum=0, maximum=80, doc="how far streets stray from a straight line")
    orientation_spread: float = parameter(
        1.5, unit="deg", minimum=0, maximum=90, doc="deviation of houses from their street, standard deviation"
    )
    street_width: float = parameter(16.0, unit="m", minimum=4, maximum=60, doc="between parcel fronts")
    block_length: float = parameter(180.0, unit="m", minimum=20, maximum=1000, doc="between cross streets")
    parcel_width: float = parameter(17.0, unit="m", minimum=8, maximum=150, doc="frontage")
    parcel_depth: float = parameter(36.0, unit="m", minimum=15, maximum=150, doc="from street to back fence")
    setback: float = parameter(6.0, unit="m", minimum=0, maximum=30, doc="from parcel front to house")
    zone: str = parameter(
        "houses", choices=("houses", "towers"), doc="use of the blocks that are neither halls nor open"
    )
    hall_share: float = parameter(0.0, minimum=0, maximum=1, doc="share of the blocks that are industrial")
    open_share: float = parameter(0.0, minimum=0, maximum=0.95, doc="share of the blocks that are fields, farthest out")
    park_share: float = parameter(0.04, minimum=0, maximum=0.9, doc="share of the blocks without buildings")

    buildings: int = parameter(70, minimum=0, maximum=20000, doc="buildings in the reference, outbuildings included")
    counted: str = parameter(
        "buildings",
        choices=("buildings", "rectangles"),
        doc="what the number of buildings counts: an L-shaped house is one building and two rectangles",
    )
    plain_plans: float = parameter(
        0.34, minimum=0, maximum=1, doc="share of the houses that are one rectangle; others are L, T, U or C"
    )
    outbuildings: float = parameter(0.5, minimum=0, maximum=2, doc="garages and sheds of 10 m2 and more per house")
    garage_rows: float = parameter(
        0.0, minimum=0, maximum=1, doc="share of the parcels with a row of garages instead of a house"
    )
    row_share: float = parameter(
        0.0, minimum=0, maximum=1, doc="share of the parcels with a row of houses wall to wall instead of a house"
    )
    row_house_width: float = parameter(6.0, unit="m", minimum=4, maximum=12, doc="of a house of a row, mean")
    row_variety: float = parameter(
        0.3,
        minimum=0,
        maximum=1,
        doc="share of party walls with a step of the eaves; widths and depths differ with it",
        swept=(0, 0.3, 0.6, 1),
    )
    row_gables: float = parameter(
        0.2, minimum=0, maximum=1, doc="share of rows in which each house turns its gable to the street"
    )
    row_skew: float = parameter(
        0.0,
        unit="deg",
        minimum=-35,
        maximum=35,
        doc="between the party walls of rows and the perpendicular of their street",
        swept=(0, 10, 20, 30),
    )
    row_chimneys: float = parameter(
        0.0,
        minimum=0,
        maximum=1,
        doc="share of party walls of rows with a chimney at the ridge; houses beside one have no other",
        swept=(0, 0.5, 1),
    )
    row_parapets: float = parameter(
        0.0,
        minimum=0,
        maximum=1,
        doc="share of party walls of rows that end 0.3 to 0.6 m above the roofs",
        swept=(0, 0.5, 1),
    )
    building_size: float = parameter(
        1.0, minimum=0.4, maximum=1.6, doc="factor on the sides of buildings", swept=(0.6, 0.8, 1.0, 1.2)
    )
    gap: float = parameter(
        2.0, unit="m", minimum=0, maximum=20, doc="between a house and its neighbour, mean", swept=(0.5, 1, 2, 4)
    )
    storey_height: float = parameter(2.9, unit="m", minimum=2.2, maximum=6, doc="of houses")
    two_storeys: float = parameter(0.2, minimum=0, maximum=1, doc="share of houses with two storeys")
    roof_pitch: float = parameter(23.0, unit="deg", minimum=2, maximum=60, doc="of pitched roofs, mean")
    flat_roofs: float = parameter(0.06, minimum=0, maximum=1, doc="share of houses with flat or shed roofs")
    gable_roofs: float = parameter(
        0.35, minimum=0, maximum=1, doc="share of gables among the pitched roofs; others are hips"
    )
    roof_palette: str = parameter(
        "australian", choices=("australian", "central-european", "north-american"), doc="colours of roofs"
    )
    green_roof_share: float = parameter(
        0.0, minimum=0, maximum=1, doc="share of roofs that are painted green or planted", swept=(0, 0.1, 0.3, 0.6)
    )
    tallest: float = parameter(120.0, unit="m", minimum=10, maximum=500, doc="highest tower of a downtown")

    tree_density: float = parameter(
        20.0, unit="1/ha", minimum=0, maximum=MOST_TREES, doc="trees per hectare", swept=(0, 20, 40, 80)
    )
    tree_gap: float = parameter(
        1.5, unit="m", minimum=-3, maximum=30, doc="least distance of a trunk from a roof's edge", swept=(0, 2, 4, 8)
    )
    gap_trees: float = parameter(
        0.0,
        minimum=0,
        maximum=1,
        doc="share of the gaps of 1 to 6 m between buildings with a tree in it, whose crown reaches over both",
        swept=(0, 0.3, 0.6, 1),
    )
    tree_height: float = parameter(7.0, unit="m", minimum=2, maximum=40, doc="median")
    tree_clumping: float = parameter(0.3, minimum=0, maximum=1, doc="share of trees that stand in clumps")
    woodland: float = parameter(0.0, minimum=0, maximum=1, doc="share of trees in woods beside the parcels")
    conifers: float = parameter(0.1, minimum=0, maximum=1, doc="share of the trees")
    autumn_share: float = parameter(0.05, minimum=0, maximum=1, doc="share of trees that are not green")
    dryness: float = parameter(0.4, minimum=0, maximum=1, doc="share of the grass that is dry")
    clutter: float = parameter(1.0, minimum=0, maximum=3, doc="factor on cars, hedges, fences, pools, sheds, carports")

    point_spacing: float = parameter(
        0.5, unit="m", minimum=0.1, maximum=5, doc="root of the ground area per pulse", swept=(0.35, 0.5, 1, 1.5)
    )
    pulse: str = parameter(
        "all",
        choices=("first", "last", "all", "single"),
        doc="returns that the cloud holds; single: the first ones, written as 1 of 1",
    )
    scan_angle: float = parameter(12.0, unit="deg", minimum=0, maximum=30, doc="largest off-nadir angle of a pulse")
    vertical_noise: float = parameter(
        0.05, unit="m", minimum=0, maximum=1, doc="standard deviation", swept=(0.05, 0.15, 0.3)
    )
    horizontal_noise: float = parameter(0.12, unit="m", minimum=0, maximum=3, doc="standard deviation, each axis")
    dropouts: float = parameter(0.01, minimum=0, maximum=0.9, doc="share of pulses without a return, on dry ground")

    bands: str = parameter("rgb", choices=("rgb", "rgbi", "none"), doc="bands of the orthoimage")
    gsd: float = parameter(0.15, unit="m", minimum=0.05, maximum=2, doc="cell size of the orthoimage")
    view_angle: float = parameter(9.0, unit="deg", minimum=0, maximum=35, doc="off-nadir view at the scene's centre")
    flying_height: float = parameter(1500.0, unit="m", minimum=600, maximum=10000, doc="camera above the lowest ground")
    sun_elevation: float = parameter(
        48.0, unit="deg", minimum=10, maximum=90, doc="lower: longer shadows", swept=(25, 40, 55, 70)
    )
    sun_azimuth: float = parameter(40.0, unit="deg", minimum=0, maximum=360, doc="clockwise from north")
    blur: float = parameter(0.7, unit="px", minimum=0, maximum=5, doc="standard deviation of the point spread")
    exposure: float = parameter(1.0, minimum=0.3, maximum=3, doc="factor on the brightness of the orthoimage")
    image_noise: float = parameter(0.012, minimum=0, maximum=0.3, doc="standard deviation, share of the full scale")
    registration_shift: float = parameter(
        0.0, unit="m", minimum=0, maximum=10, doc="offset of the orthoimage against the points", swept=(0, 0.5, 1, 2)
    )

    point_colours: bool = parameter(False, doc="whether points have the colour of the orthoimage where they lie")
    image_from: str = parameter(
        "camera", choices=("camera", "nearest", "interpolated"),
        doc="orthoimage as taken, or rastered from the colours of the points, in pixels of 0.7 point spacings: gaps "
        "take the nearest colour or are interpolated",
    )  # fmt: skip
    image_processing: str = parameter(
        "none", choices=("none", "resampled", "compressed", "sharpened", "blurred"),
        doc="what was done to the orthoimage: resampled to pixels of 0.5 m and back, compressed as JPEG of quality 20, "
        "unsharp mask, blurred with a sigma of 0.3 m",
    )  # fmt: skip

    dem_error: float = parameter(
        0.12,
        unit="m",
        minimum=0,
        maximum=5,
        doc="standard deviation of the DEM's own error, vertical; three times that in place",
    )
    digitised: str = parameter(
        "ground",
        choices=("ground", "image"),
        doc="where the reference is measured: on the ground, or in the orthoimage, leaning and shifted with it",
    )
    reference_error: float = parameter(
        0.0, unit="m", minimum=0, maximum=3, doc="digitising error of a corner, each axis"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.parcel_depth * 2 + self.street_width > 2 * max(self.width, self.height):
            raise ParameterError(
                f"parcel_depth of {self.parcel_depth:g} m does not fit {self.width:g} x {self.height:g} m: "
                f"it must be at most {max(self.width, self.height) - self.street_width / 2:g} m here"
            )

    @property
    def hectares(self) -> float:
        """Area of the extent, hectares."""
        return self.width * self.height / 1e4
