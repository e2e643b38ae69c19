"""Parameters decide the result; execution options change the time alone, and no identity depends on them."""

import copy
import inspect
import pickle
import pydoc
from dataclasses import dataclass, fields
from typing import ClassVar

import pytest

from roofbench.core.errors import ParameterError
from roofbench.core.parameters import Parameterised, execution_option, parameter


@dataclass(frozen=True, kw_only=True)
class Threshold(Parameterised):
    name = "threshold"
    height: float = parameter(2.5, unit="m", minimum=0, doc="height above ground")
    threads: int = execution_option(1, minimum=1, doc="number of threads")


def test_execution_options_are_set_like_parameters_and_are_none():
    two = Threshold.build({"threads": "2", "height": 3})
    assert two.threads == 2
    assert set(Threshold.parameters()) == {"height"}
    assert set(Threshold.execution_options()) == {"threads"}
    assert {field.name for field in fields(Threshold)} == {"height", "threads"}
    assert two.values() == two.changed() == {"height": 3.0}
    assert two.execution_values() == {"threads": 2}


def test_objects_that_differ_in_execution_options_alone_are_equal():
    assert Threshold(threads=2) == Threshold(threads=5)
    assert hash(Threshold(threads=2)) == hash(Threshold(threads=5))
    assert Threshold(height=3) != Threshold()


def test_execution_options_are_checked_and_unknown_names_are_refused():
    with pytest.raises(ParameterError, match="threads must be at least 1, not 0"):
        Threshold(threads=0)
    with pytest.raises(ParameterError, match=r"threads must be at least 1, not 1\.5"):
        Threshold.build({"threads": "1.5"})
    with pytest.raises(ParameterError, match=r"no parameter 'thread' \(did you mean 'threads'\?\)"):
        Threshold.build({"thread": 2})


def test_a_derived_class_has_the_fields_of_its_base_and_its_own():
    @dataclass(frozen=True, kw_only=True)
    class Finer(Threshold):
        cell: float = parameter(0.5, unit="m", doc="cell")

    assert Threshold().values() == {"height": 2.5}
    assert Finer().values() == {"height": 2.5, "cell": 0.5}
    assert Finer(threads=3).execution_values() == {"threads": 3}


def test_help_shows_the_parameters_of_a_class():
    for documented in (Threshold, Threshold()):
        shown = pydoc.plain(pydoc.render_doc(documented))
        assert "Parameters\n |  ----------\n |  " in shown
        assert "default" in shown
    assert "Parameters" not in Threshold.description()


@dataclass(frozen=True, kw_only=True)
class Reading(Parameterised):
    name = "reading"
    modes: ClassVar = {"paper": {"rise": 0.0, "share": 1.0}}
    mode: str = parameter("default", choices=("default", "paper"), doc="set of defaults")
    rise: float = parameter(0.1, minimum=0, doc="largest rise")
    share: float = parameter(0.5, minimum=0, maximum=1, doc="share")
    height: float = parameter(2.5, doc="height")


def test_a_mode_sets_the_parameters_that_are_not_given():
    paper = Reading(mode="paper")
    assert paper.values() == {"mode": "paper", "rise": 0.0, "share": 1.0, "height": 2.5}
    assert paper.changed() == {"mode": "paper"}
    assert Reading().values() == {"mode": "default", "rise": 0.1, "share": 0.5, "height": 2.5}
    assert Reading().changed() == {}


@pytest.mark.parametrize("values", [{"mode": "paper", "rise": "0.1"}, {"rise": 0.1, "mode": "paper"}])
def test_a_parameter_beside_a_mode_overrides_it_even_with_the_plain_default(values):
    chosen = Reading.build(values)
    assert (chosen.rise, chosen.share) == (0.1, 1.0)
    assert chosen.changed() == {"mode": "paper", "rise": 0.1}
    assert Reading.build(chosen.changed()) == Reading.build(chosen.values()) == chosen
    assert copy.copy(chosen) == pickle.loads(pickle.dumps(chosen)) == chosen
    assert pickle.loads(pickle.dumps(chosen)).given() == chosen.given() == {"mode": "paper", "rise": 0.1}


@pytest.mark.parametrize("rise", [0.0, 0.1, 0.3])
def test_what_is_given_stays_beside_another_mode_and_other_defaults_whatever_its_value(rise):
    chosen = Reading.build({"rise": str(rise)})
    assert chosen.given() == {"rise": rise}
    assert chosen.replaced({"mode": "paper"}).values() == {"mode": "paper", "rise": rise, "share": 1.0, "height": 2.5}
    assert chosen.with_defaults({"rise": 7, "height": 9}) == Reading(rise=rise, height=9)
    back = chosen.replaced({"mode": "paper"}).replaced({"height": 3}).replaced({"mode": "default"})
    assert back == Reading(rise=rise, height=3)
    one = Reading(rise=rise).set_params(mode="paper")
    assert (one.rise, one.set_params(share=0.5).replaced({"mode": "default"}).rise) == (rise, rise)


def test_what_is_given_is_no_part_of_the_value():
    chosen = Reading(rise=0.1)
    assert (chosen, hash(chosen), repr(chosen), chosen.changed()) == (Reading(), hash(Reading()), "Reading()", {})


def test_a_copy_with_every_parameter_has_none_given():
    copied = Reading(**Reading(share=0.7).get_params())
    assert copied.given() == {"share": 0.7}
    assert copied.replaced({"mode": "paper"}).rise == 0.0
    assert Reading(**Reading(mode="paper").get_params()).set_params(mode="default") == Reading()


def test_another_mode_changes_what_was_not_overridden():
    chosen = Reading(rise=0.3, height=3.0).replaced({"mode": "paper"})
    assert chosen.values() == {"mode": "paper", "rise": 0.3, "share": 1.0, "height": 3.0}
    assert chosen.replaced({"mode": "default"}) == Reading(rise=0.3, height=3.0)


def test_an_unknown_mode_is_refused():
    with pytest.raises(ParameterError, match="mode must be one of default, paper, not 'print'"):
        Reading(mode="print")


@dataclass(frozen=True, kw_only=True)
class Voter(Parameterised):
    name = "voter"
    voting: bool = parameter(True)
    majority: float = parameter(1)
    used_with: ClassVar = {"majority": {"voting": (True,)}}


def test_a_parameter_without_effect_makes_no_other_object():
    off = Voter(voting=False, majority=0.7)
    assert off == Voter(voting=False)
    assert off.values() == {"voting": False, "majority": 1.0}
    assert isinstance(off.majority, float)
    assert off.unused() == ["majority"]
    assert Voter(majority=0.7).changed() == {"majority": 0.7}
    assert Voter(majority=0.7).replaced({"voting": False}) == Voter(voting=False)


def test_a_sweep_over_a_parameter_without_effect_is_refused():
    with pytest.raises(ParameterError, match="voter: majority has no effect here: it is used with voting=True"):
        Voter(voting=False).replaced({"majority": 0.7})


def test_the_repr_shows_what_differs_from_the_defaults():
    assert repr(Threshold()) == "Threshold()"
    assert repr(Threshold(height=3, threads=2)) == "Threshold(height=3.0, threads=2)"
    assert repr(Reading(mode="paper")) == "Reading(mode='paper')"


def test_parameters_are_read_and_changed_as_in_scikit_learn():
    one = Threshold(threads=3)
    assert one.get_params() == one.get_params(deep=False) == {"height": 2.5, "threads": 3}
    assert type(one)(**one.get_params()) == one
    assert one.set_params(height=4) is one
    assert (one.height, one.threads) == (4.0, 3)
    with pytest.raises(ParameterError, match=r"did you mean 'height'"):
        one.set_params(heigth=5)
    with pytest.raises(ParameterError, match="at least 0"):
        one.set_params(threads=5, height=-1)
    assert (one.height, one.threads) == (4.0, 3)
    assert Reading().set_params(mode="paper").share == 1.0


@dataclass(frozen=True, kw_only=True)
class Described(Threshold):
    """Everything high is a building."""

    cell: float | None = parameter(None, unit="m", minimum=0.1, doc="cell size", source="our reading")


def test_help_lists_the_parameters_below_the_docstring():
    text = inspect.getdoc(Described)
    assert text.startswith("Everything high is a building.\n\nParameters\n----------\nheight : float, default 2.5\n")
    assert "cell : float or None, default None\n    Cell size.\n    At least 0.1 m.\n    Source: our reading." in text
    assert text.endswith("-----------------\nthreads : int, default 1\n    Number of threads.\n    At least 1.")
    assert Described.description() == "Everything high is a building."
