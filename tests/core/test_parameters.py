"""Parameters decide the result; execution options change the time alone, and no identity depends on them."""

from dataclasses import dataclass, fields

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
