"""Verdicts of evaluators that find each object correct or wrong by its coverage."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..verdict_table import SIDES, Measure, VerdictKind, Verdicts, VerdictTable
from .coverage import CountedSets

__all__ = ["SideVerdicts", "coverage_kinds", "coverage_verdicts"]


@dataclass(frozen=True, eq=False)
class SideVerdicts:
    """What an evaluator says about the objects of one side; left-out objects are marked by `coverage_verdicts`.

    Attributes
    ----------
    correct : ndarray of bool, shape (n,)
    reasons : sequence of str, n of them
    measures : mapping of str to ndarray, shape (n,)
    partner : ndarray of int64, shape (n,), optional
        Row of each object's partner, or -1; its main partner is named where this is -1 or not given.
    """

    correct: NDArray[np.bool_]
    reasons: Sequence[str]
    measures: Mapping[str, NDArray[np.float64]]
    partner: NDArray[np.int64] | None = None


def coverage_kinds(
    *, correct: tuple[str, str], excess: tuple[str, str], missing: tuple[str, str]
) -> tuple[VerdictKind, ...]:
    """Return the verdict kinds of an evaluator that knows correct, wrong and left-out objects.

    Parameters
    ----------
    correct, excess, missing : tuple of str
        Key and label of correct objects, of wrong detections and of wrong references.
    """
    return (
        VerdictKind(key=correct[0], label=correct[1], side="detection", role="correct", counts_as="correct"),
        VerdictKind(key=excess[0], label=excess[1], side="detection", role="excess", counts_as="wrong"),
        VerdictKind(key="left out", label="left out", side="detection", role="left out", counts_as="neutral"),
        VerdictKind(
            key=correct[0], label=f"reference: {correct[0]}", side="reference", role="outline", counts_as="correct"
        ),
        VerdictKind(key=missing[0], label=missing[1], side="reference", role="missing", counts_as="wrong"),
        VerdictKind(key="left out", label="left out", side="reference", role="left out", counts_as="neutral"),
    )


def coverage_verdicts(
    sets: CountedSets,
    kinds: tuple[VerdictKind, ...],
    measures: tuple[Measure, ...],
    *,
    detections: SideVerdicts,
    references: SideVerdicts,
) -> Verdicts:
    """Put the verdicts of both sides together.

    Parameters
    ----------
    sets : CountedSets
    kinds : tuple of VerdictKind
        As `coverage_kinds` returns them.
    measures : tuple of Measure
    detections, references : SideVerdicts
    """
    tables = []
    for side, given in zip(SIDES, (detections, references), strict=True):
        own, others, counted, coverage = (
            (sets.detected, sets.reference, sets.detections, sets.of_detections)
            if side == "detection"
            else (sets.reference, sets.detected, sets.references, sets.of_references)
        )
        left_out = counted.reasons.tolist()
        partner = coverage.partner_ids(others)
        if given.partner is not None:
            chosen = given.partner >= 0
            partner[chosen] = others.ids[given.partner[chosen]]
        tables.append(
            VerdictTable(
                ids=own.ids,
                kinds=tuple(kind.key for kind in kinds if kind.side == side),
                kind=np.where(counted.mask, np.where(given.correct, 0, 1), 2).astype(np.uint8),
                partner=partner,
                measures={measure.key: np.asarray(given.measures[measure.key], dtype=float) for measure in measures},
                reasons=tuple(out or reason for out, reason in zip(left_out, given.reasons, strict=True)),
            )
        )
    return Verdicts(
        kinds=kinds,
        measures=measures,
        detection_table=tables[0],
        reference_table=tables[1],
        detected=sets.detected,
        reference=sets.reference,
    )
