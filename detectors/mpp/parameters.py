"""The parameters of the detector ``mpp``.

Each parameter names its source: an equation of Yu, Li, Guan & Wang (2013), or "roofbench" for what the repaired model
adds (docs/results/mpp.md gives the reasons and the measured effect of each).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from ...core.conditions import ABOVE_ZERO, AT_MOST_ONE, Uses
from ...core.errors import ParameterError
from ...core.parameters import Parameterised, execution_option, parameter

__all__ = ["MPPParameters", "check_sides"]

_OWN = "roofbench"


def check_sides(owner: str, least: float, largest: float) -> None:
    """Raise `ParameterError` where the shortest side that is allowed is longer than the longest."""
    if least > largest:
        raise ParameterError(
            f"{owner}: least_side of {least:g} is more than largest_side of {largest:g}: lower least_side or raise "
            "largest_side"
        )


@dataclass(frozen=True, kw_only=True)
class MPPParameters(Parameterised):
    """What decides the result of ``mpp``, and the number of threads, which does not."""

    used_with: ClassVar[Mapping[str, Uses]] = {
        "roof_price": {"roofs": ("all",)},
        "roof_step": {"carried_share": (AT_MOST_ONE,)},
        "texture_limit": {"texture_weight": (ABOVE_ZERO,)},
        "least_evidence": ({"texture_weight": (ABOVE_ZERO,)}, {"texture_limit": (ABOVE_ZERO,)}),
        "start": {"optimiser": ("rjmcmc",)},
        "effort": {"optimiser": ("rjmcmc",)},
    }

    cell: float | None = parameter(
        None,
        unit="m",
        minimum=0.1,
        maximum=5,
        doc="cell of the working grid; by default from the point density",
        source=_OWN,
    )
    least_height: float = parameter(
        2.2,
        unit="m",
        minimum=0.5,
        doc="least mean height of a roof above ground",
        source="Awrangjeb et al. 2010, height threshold T_h (2.5 m)",
        swept=(2.0, 2.2, 2.5, 3.0),
    )
    least_side: float = parameter(
        2.0, unit="m", minimum=0.5, doc="shortest side of a building", source=_OWN, swept=(2.0, 3.0)
    )
    largest_side: float = parameter(120.0, unit="m", minimum=5, doc="longest side of a building", source=_OWN)
    slender: float = parameter(
        2.5,
        minimum=1,
        doc="ratio of the sides above which a rectangle along a larger one is a part of it",
        source=_OWN,
        swept=(2.0, 2.5, 3.0, 4.0, 1000.0),
    )
    part_share: float = parameter(
        0.1,
        minimum=0,
        maximum=1,
        doc="share of the area of a larger rectangle below which one along it is a part of it",
        source=_OWN,
        swept=(0, 0.05, 0.1, 0.2),
    )
    price: float = parameter(
        20.0,
        minimum=0,
        doc="energy of a rectangle (gamma): what its evidence must exceed",
        source=_OWN,
        swept=(10, 20, 40),
    )
    overlap: float = parameter(
        20.0, unit="1/m2", minimum=0, doc="energy of common area (omega)", source=_OWN, swept=(5, 20, 80)
    )
    fit_weight: float = parameter(
        0.2,
        minimum=0,
        maximum=1,
        doc="independent height measurements per m2: neighbouring heights deviate from a roof together",
        source=_OWN,
        swept=(0.1, 0.2, 0.4, 1.0),
    )
    least_tau: float = parameter(
        0.15,
        unit="m",
        minimum=0.01,
        doc="least standard deviation of heights around a roof (tau of equation 1)",
        source=_OWN,
        swept=(0.1, 0.15, 0.3),
    )
    ground_error: float = parameter(
        0.005,
        minimum=0,
        maximum=0.1,
        doc="error of the ground height under a building, metres per metre of its longest side",
        source=_OWN,
        swept=(0, 0.005, 0.01),
    )
    level: str = parameter(
        "building",
        choices=("part", "building", "block"),
        doc="what a footprint is: a house, wing or annex; a building, rows cut into houses; all that is built together",
        source=_OWN,
    )
    roofs: str = parameter(
        "all",
        choices=("all", "flat"),
        doc="plane, gable and hip roofs besides flat ones, or flat ones alone",
        source=_OWN,
    )
    roof_step: float = parameter(
        0.5,
        unit="m",
        minimum=0.1,
        doc="height step between neighbouring cells that separates two roofs",
        source=_OWN,
        swept=(0.3, 0.5, 1.0),
    )
    carried_share: float = parameter(
        0.65,
        minimum=0.5,
        maximum=1.1,
        doc="share of the rim of a roof that must be lower roof to make it a superstructure; above 1: none is one",
        source=_OWN,
        swept=(0.5, 0.65, 0.8, 1.1),
    )
    roof_price: float = parameter(
        3.0, minimum=0, doc="energy of each number that a roof has more than a flat one", source=_OWN
    )
    texture_weight: float = parameter(
        1.0,
        minimum=0,
        doc="weight of roughness, multiple returns and colours as evidence",
        source=_OWN,
        swept=(0, 0.5, 1.0),
    )
    texture_limit: float = parameter(
        3.0, minimum=0, doc="bound of that evidence, nats per m2", source=_OWN, swept=(2, 3, 4)
    )
    least_evidence: float = parameter(
        0.5,
        minimum=0,
        maximum=1,
        doc="least mean evidence of the high cells of a building, share of texture_limit; 0 disables the test",
        source=_OWN,
        swept=(0.0, 0.4, 0.5, 0.6),
    )
    low_price: float = parameter(
        5.0, minimum=0, doc="energy of low ground under a roof, nats per m2", source=_OWN, swept=(2, 3, 5, 8)
    )
    void_price: float = parameter(
        0.1,
        minimum=0,
        doc="energy of cells without points under a roof, nats per m2",
        source=_OWN,
        swept=(0.05, 0.1, 0.3),
    )
    optimiser: str = parameter(
        "search",
        choices=("search", "rjmcmc"),
        doc="search: greedy start and local search; rjmcmc: a reversible jump chain between the two as well",
        source="Yu et al. 2013, section 2.4 (rjmcmc); roofbench (search)",
    )
    start: str = parameter(
        "greedy", choices=("greedy", "empty"), doc="first state of the chain of optimiser=rjmcmc", source=_OWN
    )
    effort: float = parameter(
        0.25,
        minimum=0,
        doc="factor of the number of proposals of the chain of optimiser=rjmcmc",
        source=_OWN,
        swept=(0, 0.25, 1, 4),
    )
    sweeps: int = parameter(
        6,
        minimum=0,
        doc="maximum number of local-search sweeps; 0 disables the search and with it the greedy start",
        source=_OWN,
    )
    threads: int = execution_option(1, minimum=1, doc="number of threads")

    def __post_init__(self) -> None:
        super().__post_init__()
        check_sides("mpp", self.least_side, self.largest_side)
