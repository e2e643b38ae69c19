"""Baselines: reference scores of a version of the code, as a small JSON file that is kept in git.

A baseline contains index values by detector, scene and seed, the content hash of each scene, and the recipes that
repeat the runs; it contains no detections. Values are rounded to nine decimals on both sides of a comparison. There is
one line per scene and seed, so that changes are readable in a diff.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self

from ...core.errors import InputError, ParameterError, UnknownNameError
from ...core.output import whole_file
from ...core.package import BENCHMARK_VERSION
from ...core.registry import nearest_hint
from ...detectors.base import Detector
from ...detectors.registry import make_detector
from ...evaluators.base import Evaluator
from ..identity.detector_code import DetectorCode
from ..identity.provenance import CodeVersion
from ..identity.recipes import PluginRecipe, SceneRecipe
from ..plan import KeyedEvaluator
from ..store.records import RunRow
from ..store.writer import Store
from ..suite import DetectorEntry, Suite

__all__ = ["Baseline", "BaselineScene", "Measured", "measure"]

_FORMAT = 1
_DECIMALS = 9


@dataclass(frozen=True)
class BaselineScene:
    """A scene of a baseline: its recipe and the hash of its content."""

    recipe: SceneRecipe
    content_hash: str


@dataclass(frozen=True)
class Measured:
    """Scores of one detector: the values of every run by scene and seed.

    Attributes
    ----------
    recipe : PluginRecipe
    seeds : tuple of int
    runs : mapping of (scene, seed) to mapping or None
        Index values by key (None where undefined); None for a run that failed or was skipped.
    code : DetectorCode, optional
        The code that ran; None in baselines of version 0.1.
    chosen : tuple of str, optional
        The parameters that were given or differed from their defaults. None in older baselines, which repeat every
        value.
    """

    recipe: PluginRecipe
    seeds: tuple[int, ...]
    runs: Mapping[tuple[str, int], Mapping[str, float | None] | None]
    code: DetectorCode | None = None
    chosen: tuple[str, ...] | None = None

    def installed(self) -> Detector:
        """Return the detector as it is installed now: a changed default is a change that the gate measures."""
        if self.chosen is None:
            return self.recipe.detector()
        return replace(self.recipe, parameters={name: self.recipe.parameters[name] for name in self.chosen}).detector()


@dataclass(frozen=True, kw_only=True)
class Baseline:
    """Reference scores of a version of the code.

    Attributes
    ----------
    suite : str
    version : CodeVersion
    created : str
        UTC, ISO 8601.
    evaluator : PluginRecipe
    scenes : mapping of str to BaselineScene
    detectors : mapping of str to Measured
        By label.
    benchmark : int, optional
        Version of the benchmark; None in baselines of version 0.1.
    """

    suite: str
    version: CodeVersion
    created: str
    evaluator: PluginRecipe
    scenes: Mapping[str, BaselineScene]
    detectors: Mapping[str, Measured]
    benchmark: int | None = BENCHMARK_VERSION

    def to_suite(self) -> Suite:
        """Return the suite that repeats it."""
        detectors = tuple(DetectorEntry(found.installed(), found.seeds) for found in self.detectors.values())
        scenes = tuple(scene.recipe for scene in self.scenes.values())
        return Suite(self.suite, scenes, detectors, (self.evaluator.evaluator(),))

    def counterparts(self, labels: Sequence[str]) -> dict[str, str]:
        """Return for each of these detectors the label of the detector of this baseline that it is compared with.

        It is the one of the same label, else the only one of the same name: ``ndsm[height=2]`` is compared with
        ``ndsm``. If there is one detector on each side, they are compared whatever their names. A detector without a
        counterpart is left out.

        Raises
        ------
        ParameterError
            Two of them would be compared with the same.
        """
        if len(labels) == len(self.detectors) == 1:
            return dict(zip(labels, self.detectors, strict=True))
        found: dict[str, str] = {}
        for label in labels:
            name = label.partition("[")[0]
            same = [known for known in self.detectors if known.partition("[")[0] == name]
            if label in self.detectors or len(same) == 1:
                found[label] = label if label in self.detectors else same[0]
        if len(set(found.values())) < len(found):
            raise ParameterError(f"{', '.join(found)}: each detector of a baseline can be compared with one only")
        return found

    def named(self, selections: Sequence[str]) -> tuple[Baseline, tuple[DetectorEntry, ...]]:
        """Return what the baseline has of the detectors that are selected, and these with its seeds, to be run.

        Raises
        ------
        UnknownNameError
            One of them has no counterpart in the baseline.
        """
        chosen = {entry.label: entry.detector for entry in map(DetectorEntry, map(make_detector, selections))}
        known = self.counterparts(list(chosen))
        for label in chosen:
            if label not in known:
                raise UnknownNameError(
                    f"the baseline has no detector {label!r}{nearest_hint(label, self.detectors)}; it has "
                    f"{', '.join(self.detectors)}: name the one to compare it with by against="
                )
        entries = (DetectorEntry(one, self.detectors[known[label]].seeds) for label, one in chosen.items())
        return self.only(known.values()), tuple(entries)

    def with_labels_of(self, other: Baseline) -> Baseline:
        """Return the baseline with detectors named as their counterparts in `other`."""
        named = other.counterparts(list(self.detectors))
        return replace(self, detectors={named.get(label, label): found for label, found in self.detectors.items()})

    def only(self, labels: Iterable[str]) -> Baseline:
        """Return the baseline with these detectors only, or raise `UnknownNameError`."""
        for label in (labels := list(labels)):
            if label not in self.detectors:
                raise UnknownNameError(
                    f"the baseline has no detector {label!r}{nearest_hint(label, self.detectors)}; "
                    f"it has {', '.join(self.detectors)}"
                )
        return replace(self, detectors={label: self.detectors[label] for label in labels})

    def with_scenes(self, pattern: str) -> Baseline:
        """Return the baseline with only the scenes whose name matches a pattern such as ``knox*``."""
        kept = {scene.name for scene in self.to_suite().with_scenes(pattern).scenes}
        return replace(
            self,
            scenes={name: scene for name, scene in self.scenes.items() if name in kept},
            detectors={
                label: replace(found, runs={run: values for run, values in found.runs.items() if run[0] in kept})
                for label, found in self.detectors.items()
            },
        )

    def to_json(self) -> str:
        """Return the file's text: one line per scene, and per detector, scene and seed."""
        head = {
            "format": _FORMAT,
            "suite": self.suite,
            "created": self.created,
            "roofbench": {"version": self.version.version, "commit": self.version.commit, "benchmark": self.benchmark},
            "evaluator": self.evaluator.to_dict(),
        }
        lines = [f"  {json.dumps(name)}: {json.dumps(value)}," for name, value in head.items()]
        scenes = [
            f"    {json.dumps(name)}: {json.dumps({'hash': scene.content_hash, **scene.recipe.to_dict()})}"
            for name, scene in self.scenes.items()
        ]
        detectors = []
        for label, measured in self.detectors.items():
            runs = [
                f"        {json.dumps([scene, seed, None if values is None else dict(values)])}"
                for (scene, seed), values in sorted(measured.runs.items())
            ]
            facts = {**measured.recipe.to_dict(), "seeds": list(measured.seeds)}
            if measured.chosen is not None:
                facts["chosen"] = list(measured.chosen)
            if measured.code is not None:
                facts["code"] = measured.code.to_dict()
            body = [f"      {json.dumps(name)}: {json.dumps(value)}," for name, value in facts.items()]
            listed = ",\n".join(runs)
            text = "\n".join([*body, f'      "runs": [\n{listed}\n      ]'])
            detectors.append(f"    {json.dumps(label)}: {{\n{text}\n    }}")
        parts = [*lines, '  "scenes": {', ",\n".join(scenes), "  },", '  "detectors": {', ",\n".join(detectors), "  }"]
        return "{\n" + "\n".join(parts) + "\n}\n"

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the file; it appears complete or not at all."""
        with whole_file(path, overwrite=overwrite) as scratch:
            scratch.write_text(self.to_json(), encoding="utf-8")

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Return the baseline of a file that `save` wrote.

        Raises
        ------
        InputError
            Missing file, or a file that is no baseline of a known format.
        """
        file = Path(path)
        if not file.is_file():
            raise InputError(f"{file}: no such baseline; make one with roofbench baseline save -o {file}")
        try:
            content = json.loads(file.read_text(encoding="utf-8"))
            if content["format"] != _FORMAT:
                raise InputError(f"{file}: baseline of format {content['format']}, this roofbench knows {_FORMAT}")
            return cls._from(content)
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            if isinstance(error, InputError):
                raise
            missing = f"it has no {error}" if isinstance(error, KeyError) else str(error)
            raise InputError(f"{file} is not a baseline ({missing}): 'roofbench baseline save' makes one") from error

    @classmethod
    def _from(cls, content: Mapping[str, Any]) -> Self:
        scenes = {}
        for name, values in content["scenes"].items():
            recipe = {key: value for key, value in values.items() if key != "hash"}
            scenes[name] = BaselineScene(SceneRecipe.from_dict(recipe), values["hash"])
        detectors = {
            label: Measured(
                PluginRecipe(values["use"], values["parameters"]),
                tuple(values["seeds"]),
                {(scene, seed): found for scene, seed, found in values["runs"]},
                DetectorCode.from_dict(values["code"]) if "code" in values else None,
                tuple(values["chosen"]) if "chosen" in values else None,
            )
            for label, values in content["detectors"].items()
        }
        roofbench = content["roofbench"]
        return cls(
            suite=content["suite"],
            version=CodeVersion(roofbench["version"], roofbench["commit"], False),
            created=content["created"],
            evaluator=PluginRecipe(**content["evaluator"]),
            scenes=scenes,
            detectors=detectors,
            benchmark=roofbench.get("benchmark"),
        )


def measure(
    suite: Suite, rows: Sequence[RunRow], store: Store, keyed: KeyedEvaluator, version: CodeVersion
) -> Baseline:
    """Return the baseline of stored runs of a suite."""
    values = store.index_values([row.id for row in rows if row.status == "ok"], keyed.key)
    scenes: dict[str, BaselineScene] = {}
    for row in rows:
        if row.scene not in scenes:
            scene = store.scene(row.scene_id)
            if scene.content_hash is not None and scene.reference is not None:
                scenes[row.scene] = BaselineScene(scene.recipe.relative_to(Path.cwd()), scene.content_hash)
    detectors = {}
    for entry in suite.detectors:
        runs: dict[tuple[str, int], Mapping[str, float | None] | None] = {}
        for row in rows:
            if row.label == entry.label and row.scene in scenes:
                found = values.get(row.id)
                runs[row.scene, row.seed] = None if found is None else _rounded(found, keyed.evaluator)
        recipe = PluginRecipe.of(entry.detector).relative_to(Path.cwd())
        chosen = tuple(entry.detector.given())
        detectors[entry.label] = Measured(recipe, entry.seeds, runs, DetectorCode.of(entry.detector), chosen)
    return Baseline(
        suite=suite.name,
        version=version,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        evaluator=keyed.recipe,
        scenes=scenes,
        detectors=detectors,
    )


def _rounded(values: Mapping[str, float | None], evaluator: Evaluator) -> dict[str, float | None]:
    """Return the values in the evaluator's order, rounded."""
    found = {index.key: values.get(index.key) for index in evaluator.indices}
    return {key: None if value is None else round(value, _DECIMALS) for key, value in found.items()}
