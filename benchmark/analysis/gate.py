"""The gate: whether a change of the code makes a detector worse.

Candidate and baseline are paired by scene; of a stochastic detector the mean over seeds counts on each scene. There is
one conclusion per index. Differences are signed so that positive is better; up to a margin they count as no difference:

worse
    by the test of (difference + margin), its mean is below zero;
better
    by the test of (difference - margin), its mean is above zero;
equal
    the 95 % bootstrap interval of the mean difference lies within the margin;
not measurable
    there are too few scenes for any test to reach the level after Holm's correction: the two-sided p of n paired
    differences cannot fall below ``2 ** (1 - n)``;
undecided
    anything else: the data are consistent with no difference and with one beyond the margin.

Why an identical detector passes: with equally many seeds on both sides, baseline and candidate are exchangeable, so
the difference of each scene is symmetric about zero, whatever its variance. The sign-flip test is exact for that, and
the margin, which is added to every difference, can only raise its p. Holm's correction is over the indices of a
detector, for one-sided tests in one direction; it holds for any dependence between the indices. Hence an identical
detector is called `worse` on any index in at most half of the level of all gate runs, a deterministic one never.
"""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence

from ...core.errors import ParameterError, UnknownNameError
from ...core.registry import nearest_hint, parse_assignment
from ...evaluators.base import Index
from .baseline import Baseline, Measured
from .inference import bootstrap_interval, holm, lowest_p, scenes_needed, sign_flip_p
from .results import Conclusion, GateResult, IndexConclusion

__all__ = ["GATE_LEVEL", "compare", "different_scenes", "margins_of", "seeds_share"]

#: At most one of 200 gate runs of an identical detector concludes `worse`.
GATE_LEVEL = 0.01
#: Margins by unit: half a percentage point, 0.01 of a ratio, two centimetres, a tenth of a pixel.
DEFAULT_MARGINS = {"fraction": 0.005, "ratio": 0.01, "m": 0.02, "px": 0.1, "count": 0.0}


def margins_of(texts: Sequence[str], indices: Sequence[Index]) -> dict[str, float]:
    """Return the margin of every gated index: defaults by unit, replaced by ``INDEX=0.005``."""
    margins = {index.key: DEFAULT_MARGINS.get(index.unit, 0.0) for index in indices}
    keys = {name: index.key for index in indices for name in (index.symbol, index.key) if name}
    for text in texts:
        name, value = parse_assignment(text)
        if name not in keys:
            raise UnknownNameError(
                f"margin={text}: {name!r} is not gated{nearest_hint(name, keys)}; gated are {', '.join(margins)}"
            )
        try:
            margin = float(value)
        except ValueError:
            raise ParameterError(f"cannot read margin={text}: write INDEX=NUMBER, fractions as 0.005") from None
        if not 0 <= margin < float("inf"):
            raise ParameterError(f"margin={text}: a margin is a finite number of at least 0")
        margins[keys[name]] = margin
    return margins


def different_scenes(baseline: Baseline, candidate: Baseline) -> list[str]:
    """Return one sentence for each difference between two baselines that makes them incomparable."""
    found = []
    for name in sorted({*baseline.scenes, *candidate.scenes}):
        one, two = baseline.scenes.get(name), candidate.scenes.get(name)
        if one is None or two is None:
            found.append(f"scene {name} is only in the {'candidate' if one is None else 'baseline'}")
        elif one.content_hash != two.content_hash:
            found.append(f"scene {name} has changed since the baseline")
    versions = baseline.benchmark, candidate.benchmark
    if None not in versions and versions[0] != versions[1]:
        found.append(
            f"the version of the benchmark is {versions[1]}, that of the baseline {versions[0]}: save it again"
        )
    if baseline.evaluator != candidate.evaluator:
        found.append("the evaluators or their parameters differ")
    missing = [label for label in baseline.detectors if label not in candidate.detectors]
    found += [f"the candidate has no detector {label}" for label in missing]
    return found


def compare(
    baseline: Baseline,
    candidate: Baseline,
    *,
    indices: Sequence[Index],
    margins: Mapping[str, float],
    level: float = GATE_LEVEL,
    extra: Sequence[IndexConclusion] = (),
) -> GateResult:
    """Return the conclusions on every detector of both sides; the scenes must be the same."""
    conclusions: list[IndexConclusion] = []
    failures: list[str] = []
    for label, before in baseline.detectors.items():
        after = candidate.detectors.get(label)
        if after is not None:
            conclusions += compare_detector(label, before, after, indices=indices, margins=margins, level=level)
            failures += [
                f"{label} on {scene}, seed {seed}"
                for (scene, seed), values in before.runs.items()
                if values is not None and after.runs.get((scene, seed), values) is None
            ]
    return GateResult(
        baseline=str(baseline.version),
        candidate=str(candidate.version),
        evaluator=baseline.evaluator.use,
        conclusions=(*conclusions, *extra),
        failures=tuple(failures),
        level=level,
    )


def compare_detector(
    label: str,
    before: Measured,
    after: Measured,
    *,
    indices: Sequence[Index],
    margins: Mapping[str, float],
    level: float = GATE_LEVEL,
) -> list[IndexConclusion]:
    """Return the conclusion on every index of one detector."""
    pairs = [_pairs(before, after, index) for index in indices]
    differences = [
        [new - old if index.better == "higher" else old - new for old, new in found.values()]
        for index, found in zip(indices, pairs, strict=True)
    ]
    worse = _adjusted([[d + margins[i.key] for d in ds] for i, ds in zip(indices, differences, strict=True)])
    better = _adjusted([[margins[i.key] - d for d in ds] for i, ds in zip(indices, differences, strict=True)])
    conclusions = []
    for place, index in enumerate(indices):
        found, ds, margin = pairs[place], differences[place], margins[index.key]
        effect = statistics.fmean(ds) if ds else None
        low, high = bootstrap_interval(ds) or (None, None)
        conclusion: Conclusion = "undecided"
        p: float | None = None
        needed = scenes_needed(len(indices), level)
        share = None
        if lowest_p(len(ds)) > level / len(indices):
            conclusion = "not measurable"
        elif effect is not None and low is not None and high is not None:
            if effect < -margin and worse[place] <= level:
                conclusion, p = "worse", worse[place]
            elif effect > margin and better[place] <= level:
                conclusion, p = "better", better[place]
            elif -margin <= low and high <= margin:
                conclusion = "equal"
            else:
                p = None if abs(effect) <= margin else worse[place] if effect < 0 else better[place]
                share = seeds_share(before, after, index)
        conclusions.append(
            IndexConclusion(
                detector=label,
                index=index,
                conclusion=conclusion,
                baseline=statistics.fmean(old for old, _ in found.values()) if found else None,
                candidate=statistics.fmean(new for _, new in found.values()) if found else None,
                effect=effect,
                low=low,
                high=high,
                p=p,
                margin=margin,
                scenes=len(ds),
                scenes_needed=needed if conclusion == "not measurable" else 0,
                undefined=len(_by_scene(before, index).keys() - _by_scene(after, index).keys()),
                seeds_share=share,
            )
        )
    return conclusions


def _adjusted(differences: Sequence[Sequence[float]]) -> list[float]:
    """Return Holm-adjusted two-sided p of differences below zero: twice the one-sided ones.

    The correction is one-sided: a certain improvement of one index must not lower the bar for the others.
    """
    return [min(1.0, 2 * p) for p in holm([sign_flip_p(found) for found in differences])]


def _values(measured: Measured, index: Index) -> dict[str, list[float]]:
    values: dict[str, list[float]] = {}
    for (scene, _), found in measured.runs.items():
        value = None if found is None else found.get(index.key)
        if value is not None:
            values.setdefault(scene, []).append(value)
    return values


def _by_scene(measured: Measured, index: Index) -> dict[str, float]:
    return {scene: statistics.fmean(found) for scene, found in _values(measured, index).items()}


def _pairs(before: Measured, after: Measured, index: Index) -> dict[str, tuple[float, float]]:
    """Return (baseline, candidate) by scene, each the mean over its seeds, where both are defined."""
    old, new = _by_scene(before, index), _by_scene(after, index)
    return {scene: (old[scene], new[scene]) for scene in sorted(old.keys() & new.keys())}


def seeds_share(before: Measured, after: Measured, index: Index) -> float | None:
    """Return the share of the variance of the mean difference that comes from seeds; None where it cannot be estimated.

    Each scene's difference of two means carries the variance over seeds divided by their number, on both sides; the
    rest of the variance over scenes is the different effect of the change on them.
    """
    old, new = _values(before, index), _values(after, index)
    both = old.keys() & new.keys()
    sides = [side[scene] for scene in both for side in (old, new)]
    if len(both) < 2 or any(len(found) < 2 for found in sides):
        return None
    differences = [statistics.fmean(new[scene]) - statistics.fmean(old[scene]) for scene in both]
    own = sum(statistics.variance(found) / len(found) for found in sides) / len(both)
    total = statistics.variance(differences)
    return min(1.0, own / total) if total else None
