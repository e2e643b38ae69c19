"""The catalogue: what there is to choose from, each name with its meaning.

A *kind* is one of detectors, evaluators, suites, scenes and indices. An *entry* is one name of a kind. Entries are
found where they live: registries of plugins, suites that come with roofbench, real scenes inside the
package, presets of the generator, and scene folders in the current directory.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Literal, TypeAlias, get_args

from ..core.errors import ParameterError, RoofbenchError, UnknownNameError
from ..core.parameter_rules import Parameter, parameter_text
from ..core.registry import nearest_hint, parse_selection
from ..detectors.base import Detector
from ..detectors.registry import DETECTORS, make_detector
from ..evaluators.base import Evaluator, Index
from ..evaluators.registry import DEFAULT, EVALUATORS, make_evaluator
from ..scenes import builtin
from ..scenes.folder import open_scene
from ..scenes.shipped import shipped_folder, shipped_names
from ..scenes.synthetic.presets import preset
from .identity.recipes import preset_names
from .suite import Suite, named_suite, suite_names

__all__ = ["KINDS", "Entry", "Kind", "entries", "entries_of", "find_plugin"]

Kind: TypeAlias = Literal["detectors", "evaluators", "suites", "scenes", "indices"]
KINDS: tuple[Kind, ...] = get_args(Kind)


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One name with what is known of it.

    Attributes
    ----------
    kind : Kind
    name : str
    meaning : str
        One line.
    facts : dict of str to str
        Further properties by their title, for instance the inputs of a detector.
    description : str
        Longer text of plugins and suites.
    parameters, options : tuple of Parameter
        Of plugins and scenes: parameters and execution options.
    indices : tuple of Index
        Of evaluators.
    example : str
        A command that uses it.
    """

    kind: Kind
    name: str
    meaning: str
    facts: dict[str, str] = field(default_factory=dict)
    description: str = ""
    parameters: tuple[Parameter, ...] = ()
    options: tuple[Parameter, ...] = ()
    indices: tuple[Index, ...] = ()
    example: str = ""


def entries(kind: Kind) -> list[Entry]:
    """Return the entries of a kind, in alphabetical order; indices in the order of their evaluator.

    Indices of the default evaluator come first. A plugin that cannot be made without parameters, or whose
    packages are missing, is listed with that reason.
    """
    if kind == "detectors":
        return [_plugin_entry(name, detector=True) for name in DETECTORS.names()]
    if kind == "evaluators":
        return [_plugin_entry(name, detector=False) for name in EVALUATORS.names()]
    if kind == "suites":
        return [_suite_entry(name) for name in suite_names()]
    if kind == "scenes":
        folders = sorted(file.parent for file in Path().glob("*/scene.toml"))
        shipped = [_shipped_entry(name) for name in shipped_names()]
        return [*shipped, *(_preset_entry(name) for name in preset_names()), *map(_folder_entry, folders)]
    # Indices of the default evaluator first.
    names = sorted(EVALUATORS.names(), key=lambda name: name != DEFAULT)
    return [_index_entry(name, index) for name in names for index in EVALUATORS.get(name).indices]


def entries_of(name: str) -> list[Entry]:
    """Return the entries of a name, whichever kind it is; an index may belong to several evaluators.

    Parameters
    ----------
    name : str
        Detector, evaluator, ``FILE.py:CLASS``, suite, preset, scene folder, or index by key or symbol.

    Raises
    ------
    UnknownNameError
        Nothing is called so; the nearest name is given.
    """
    word = name if ".py" in name else parse_selection(name)[0]
    if ".py" in word or word in DETECTORS.names() or word in EVALUATORS.names():
        try:
            plugin = find_plugin(name)
        except ParameterError:
            if word != name or ".py" in word:
                raise
            return [_plugin_entry(word, detector=word in DETECTORS.names())]  # it cannot be made without parameters
        return [_described(plugin, name=name if ".py" in word else word)]
    if word in suite_names():
        return [_suite_entry(word)]
    if word in preset_names():
        return [_preset_entry(word)]
    if (Path(word) / "scene.toml").is_file():
        return [_folder_entry(Path(word))]
    if word in shipped_names():
        return [_shipped_entry(word)]
    indices = entries("indices")
    found = [entry for entry in indices if word in (entry.name, entry.facts["symbol"])]
    if found:
        return found
    known = [entry.name for kind in KINDS[:-1] for entry in entries(kind)]
    known += [text for entry in indices for text in (entry.name, entry.facts["symbol"]) if text]
    raise UnknownNameError(
        f"nothing is called {word!r}{nearest_hint(word, known)}: 'roofbench list' shows what there is"
    )


def find_plugin(selection: str) -> Detector | Evaluator:
    """Return the detector or the evaluator that a name or ``FILE.py:CLASS`` means, whichever it is.

    Raises
    ------
    UnknownNameError
        No plugin is called so; the nearest name is given.
    """
    word = parse_selection(selection)[0]
    if ".py" in word:
        return _from_file(selection, word)
    if word in DETECTORS.names():
        return make_detector(selection)
    if word in EVALUATORS.names():
        return make_evaluator(selection)
    known = [*DETECTORS.names(), *EVALUATORS.names()]
    raise UnknownNameError(
        f"no detector or evaluator called {word!r}{nearest_hint(word, known)}; there are {', '.join(known)}"
    )


def _from_file(selection: str, word: str) -> Detector | Evaluator:
    file = Path(word.partition(".py")[0] + ".py")
    if ":" not in word.rpartition(".py")[2] and not DETECTORS.add_all(file) and not EVALUATORS.add_all(file):
        raise UnknownNameError(
            f"{file} contains no detector and no evaluator: derive a class from roofbench.Detector or "
            "roofbench.Evaluator"
        )
    try:
        return make_detector(selection)
    except ParameterError as error:
        try:
            return make_evaluator(selection)
        except ParameterError:
            raise error from None


def _plugin_entry(name: str, *, detector: bool) -> Entry:
    try:
        kind = (DETECTORS if detector else EVALUATORS).get(name)
    except (ImportError, RoofbenchError) as error:
        return Entry(kind="detectors" if detector else "evaluators", name=name, meaning=f"cannot be loaded: {error}")
    return _described(kind, name=name)


def _described(plugin: Detector | Evaluator | type[Detector | Evaluator], *, name: str) -> Entry:
    kind = plugin if isinstance(plugin, type) else type(plugin)
    description = kind.description()
    meaning = " ".join(description.partition("\n\n")[0].split())
    options, parameters = tuple(kind.execution_options().values()), tuple(kind.parameters().values())
    if not isinstance(plugin, type):
        # A selection such as original[mode=paper]: its values, those that the mode sets included.
        values = plugin.values()
        parameters = tuple(replace(rule, default=values[rule.name]) for rule in parameters)
    changed = _example_value(parameters) or _required_value(kind)
    selection = f"'{name}[{changed}]'" if changed else name
    if issubclass(kind, Detector):
        return Entry(
            kind="detectors",
            name=name,
            meaning=meaning,
            facts={
                "inputs": ", ".join(kind.requires),
                "random": "yes" if kind.stochastic else "no",
                "paper": kind.paper,
            },
            description=description,
            parameters=parameters,
            options=options,
            example=f"roofbench run quick -d {selection}",
        )
    ranks = kind.ranking_index()
    return Entry(
        kind="evaluators",
        name=name,
        meaning=meaning,
        facts={
            "indices": str(len(kind.indices)),
            "ranks by": f"{ranks.key} ({ranks.symbol})" if ranks.symbol else ranks.key,
            "paper": kind.paper,
        },
        description=description,
        parameters=parameters,
        options=options,
        indices=kind.indices,
        example=f"roofbench evaluate detected.gpkg reference.gpkg -e {selection}",
    )


def _example_value(parameters: tuple[Parameter, ...]) -> str:
    """Return ``name=value`` of the first parameter that has another value to show."""
    for rule in parameters:
        for value in (*rule.swept, *rule.choices):
            if value != rule.default:
                return f"{rule.name}={parameter_text(value)}"
    return ""


def _required_value(kind: type[Detector | Evaluator]) -> str:
    """Return ``name=...`` of the first parameter of a class that cannot be made without; else empty."""
    try:
        kind.build()
    except ParameterError:
        return f"{next(iter(kind.parameters()))}=..."
    except ImportError:
        return ""
    return ""


def _suite_entry(name: str) -> Entry:
    suite: Suite = named_suite(name)
    text = (resources.files(__package__) / "suites" / f"{name}.toml").read_text("utf-8")
    comment = []
    for line in text.splitlines():
        if not line.startswith("#"):
            break
        comment.append(line.lstrip("# "))
    description = " ".join(filter(None, comment))
    return Entry(
        kind="suites",
        name=name,
        meaning=description.partition(". ")[0].rstrip("."),
        facts={
            "scenes": str(len(suite.scenes)),
            "detectors": ", ".join(entry.label for entry in suite.detectors),
            "evaluators": ", ".join(evaluator.name for evaluator in suite.evaluators),
        },
        description=description,
        example=f"roofbench run {name}",
    )


def _preset_entry(name: str) -> Entry:
    parameters: tuple[Parameter, ...] = ()
    if name == "hamlet":
        side = f"{builtin.SIZE:g} x {builtin.SIZE:g} m"
        facts = {"extent": side, "image": f"rgb {builtin.GSD:g} m", "spacing": f"{builtin.DENSITY**-0.5:.1f} m"}
        meaning = "very small scene for first tries and tests, about 30 rectangles"
    else:
        recipe = preset(name)
        image = "none" if recipe.bands == "none" else f"{recipe.bands} {recipe.gsd:g} m"
        facts = {
            "extent": f"{recipe.width:g} x {recipe.height:g} m",
            "image": image,
            "spacing": f"{recipe.point_spacing:g} m",
        }
        meaning = f"synthetic, {recipe.buildings} {recipe.counted}, {recipe.pulse} pulses"
        parameters = tuple(replace(rule, default=getattr(recipe, rule.name)) for rule in recipe.parameters().values())
    return Entry(
        kind="scenes",
        name=name,
        meaning=meaning,
        facts=facts,
        parameters=parameters,
        example=f"roofbench scenes make {name} --seed 1 -o {name}",
    )


def _folder_entry(folder: Path) -> Entry:
    scene = open_scene(folder)
    xmin, ymin, xmax, ymax = scene.extent
    return Entry(
        kind="scenes",
        name=str(folder),
        meaning=f"scene folder with {', '.join(scene.contents)}",
        facts={"extent": f"{xmax - xmin:.0f} x {ymax - ymin:.0f} m", "image": "", "spacing": ""},
        example=f"roofbench scenes check {folder}",
    )


def _shipped_entry(name: str) -> Entry:
    folder = shipped_folder(name)
    assert folder is not None
    scene = open_scene(folder)
    found = _folder_entry(folder)
    return replace(
        found,
        name=name,
        meaning=f"real scene that comes with roofbench: {', '.join(scene.contents)}",
        description=f"{scene.facts['source']}. Licence: {scene.facts['licence']}.",
        example=f"roofbench run {name}",
    )


def _range(index: Index) -> str:
    low, high = index.range
    return f"from {low:g}" if math.isinf(high) else f"{low:g} to {high:g}"


def _index_entry(evaluator: str, index: Index) -> Entry:
    return Entry(
        kind="indices",
        name=index.key,
        meaning=f"{index.title}: {index.meaning}" if index.meaning else index.title,
        facts={
            "symbol": index.symbol,
            "unit": index.unit,
            "range": _range(index),
            "better": index.better,
            "evaluator": evaluator,
            "source": index.source,
        },
        example=f"roofbench run quick -e {evaluator} --index {index.key}",
    )
