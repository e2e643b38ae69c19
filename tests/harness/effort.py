"""How much random tests try.

Property tests draw the same examples every time. With the environment variable ``ROOFBENCH_TESTS=nightly`` they draw
others every time, and many more of them.
"""

import os

from hypothesis import HealthCheck, settings

__all__ = ["NIGHTLY", "examples", "of", "use_profile"]

NIGHTLY = os.environ.get("ROOFBENCH_TESTS") == "nightly"


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
        derandomize=not NIGHTLY,
        print_blob=True,
        max_examples=of(100, 1000),
        suppress_health_check=[HealthCheck.too_slow],
    )
    settings.load_profile("roofbench")
