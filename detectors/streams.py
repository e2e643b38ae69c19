"""Random streams of detectors: each follows from seed, scene and detector, never from the order of runs."""

from __future__ import annotations

import numpy as np

from ..core.digests import digest

__all__ = ["random_stream", "random_stream_entropy"]


def random_stream_entropy(seed: int, scene: str, detector: str) -> list[int]:
    """Return the entropy of a task's random stream; it follows from seed, scene and detector, never from the order.

    Parameters are left out on purpose: a sweep compares their values under common random numbers.
    """
    return [seed, *(int(digest(text)[:16], 16) for text in (scene, detector))]


def random_stream(seed: int, scene: str, detector: str) -> np.random.Generator:
    """Return the generator from which a detector draws on a scene; both are given by name.

    Its state follows from the scene's name, but its seed sequence is another one, from which that cannot be read.
    """
    entropy = random_stream_entropy(seed, scene, detector)
    bits = np.random.PCG64(int(digest(["spawned", *entropy])[:32], 16))
    bits.state = np.random.PCG64(np.random.SeedSequence(entropy)).state
    return np.random.Generator(bits)
