"""Parameters that do not count beside others: equal keys, and equal results."""

import numpy as np
import pytest
import shapely

from roofbench import make_scene
from roofbench.benchmark.identity.recipes import PluginRecipe
from roofbench.core.conditions import Condition
from roofbench.detectors.registry import DETECTORS, make_detector

#: Values of a parameter with which a condition does not hold.
UNMET = {"other than none": None, "above 0": 0.0, "of at most 1": 1.1}
DEPENDENCES = [
    (name, parameter, number)
    for name in ("ndsm", "original", "improved", "mpp")
    for parameter, uses in DETECTORS.get(name).used_with.items()
    for number in range(1 if isinstance(uses, dict) else len(uses))
]


def values_without_use(kind, parameter, number):
    """Return values of the others beside which the parameter does not count, by one of its uses alone."""
    uses = kind.used_with[parameter]
    uses = (uses,) if isinstance(uses, dict) else uses
    rules, chosen = kind.parameters(), {}
    for met in uses[:number] + uses[number + 1 :]:
        other, (one, *_) = next(iter(met.items()))
        chosen |= {} if isinstance(one, Condition) else {other: one}
    for other, found in uses[number].items():
        conditions = [one for one in found if isinstance(one, Condition)]
        if conditions:
            chosen[other] = UNMET[conditions[0].words]
        else:
            choices = rules[other].choices or (True, False)
            chosen[other] = next(value for value in choices if value not in found)
    return chosen


def other_values(kind, parameter):
    """Return two values of a parameter, both other than its default."""
    rule = kind.parameters()[parameter]
    if rule.choices:
        return [value for value in rule.choices if value != rule.default][:2]
    least = 0.0 if rule.minimum is None else rule.minimum
    most = least + 2 if rule.maximum is None else rule.maximum
    inner = (least + 0.3 * (most - least), least + 0.6 * (most - least))
    return [rule.type(value) for value in inner if value != rule.default]


@pytest.fixture(scope="module")
def scene():
    whole = make_scene("moonee-ponds-small", seed=2)
    west, south = whole.extent[:2]
    return whole.window((west, south, west + 50, south + 50), halo=0)


def result_of(detector, scene):
    found = detector.detect(scene, np.random.default_rng(0))
    return shapely.to_wkb(found.polygons).tolist(), {name: list(map(str, v)) for name, v in found.attributes.items()}


@pytest.mark.parametrize(("name", "parameter", "number"), DEPENDENCES)
def test_runs_that_differ_in_a_parameter_out_of_use_have_one_key(name, parameter, number):
    kind = type(make_detector(name))
    chosen = values_without_use(kind, parameter, number)
    plain = kind.build(chosen)
    assert parameter in plain.unused()
    for value in other_values(kind, parameter):
        changed = kind.build({**chosen, parameter: value})
        assert changed == plain
        assert PluginRecipe.of(changed) == PluginRecipe.of(plain)
        assert changed.unused() == plain.unused()


@pytest.mark.parametrize(("name", "parameter", "number"), DEPENDENCES)
def test_a_parameter_out_of_use_changes_no_bit_of_the_result(name, parameter, number, scene):
    kind = type(make_detector(name))
    chosen = values_without_use(kind, parameter, number)
    if name == "mpp":
        chosen = {"sweeps": 1, **chosen}
    plain = result_of(kind.build(chosen), scene)
    assert plain[0], "the scene shows nothing of this dependence"
    for value in other_values(kind, parameter)[:1]:
        forced = kind.build(chosen)
        object.__setattr__(forced, parameter, value)
        assert result_of(forced, scene) == plain
