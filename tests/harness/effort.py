"""How much random tests try.

The environment variable ``ROOFBENCH_TESTS`` chooses: not set (by hand), hypothesis draws other examples every time;
``ci``, the same examples every time; ``nightly``, others every time and many more of them.
"""

import os

from hypothesis import HealthCheck, settings

__all__ = ["NIGHTLY", "examples", "of", "use_profile"]

MODE = os.environ.get("ROOFBENCH_TESTS", "by-hand")
NIGHTLY = MODE == "nightly"


def of(usual: int, nightly: int) -> int:
    """Return how many cases a test tries."""
    return nightly if NIGHTLY else usual


def examples(count: int) -> settings:
    """Return the decorator for a property test of `count` examples; ten times as many at night."""
    return settings(max_examples=of(count, 10 * count))


def use_profile() -> None:
    """Set what all property tests share: no deadlines, since nothing here asserts time."""
    settings.register_profile(
        "roofbench",
        deadline=None,
        derandomize=MODE == "ci",
        print_blob=True,
        max_examples=of(100, 1000),
        suppress_health_check=[HealthCheck.too_slow],
    )
    settings.load_profile("roofbench")
