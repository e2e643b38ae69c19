"""Numba's slow methods are replaced while a kernel is compiled, and return what numba's own return."""

import math
import operator

import numba
import numpy as np
import pytest
from llvmlite import ir as llvm
from llvmlite.binding import ffi
from numba.core import base, compiler, cpu, errors, ir, postproc, registry, targetconfig, types
from numba.core.runtime.context import NRTContext
from numba.core.types import functions
from numba.core.typing.context import BaseContext
from numba.extending import overload

from roofbench.core import quick_compilation as home
from roofbench.core.kernels import kernel

OWNERS = (
    *(functions.BaseFunction, targetconfig.TargetConfig, ir.Inst, postproc.PostProcessor),
    *(base.BaseContext, BaseContext, NRTContext, ir),
)
NAMES = (
    *("get_call_type", "__eq__", "__hash__", "values", "_rec_list_vars", "run", "refresh", "resolve_value_type"),
    *("_call_incref_decref", "_termcolor"),
)


def state():
    methods = [owner.__dict__.get(name) for owner in OWNERS for name in NAMES]
    return [*methods, errors._termcolor_inst, ffi.lib._lock._cblist]


@kernel
def reversed_into(target, source):
    target[:] = source
    return 0


def test_numba_is_as_before_after_a_kernel_and_after_an_error_of_one():
    @kernel
    def right(x):
        return x / 2

    @kernel
    def wrong(x):
        return x.nothing

    before = state()
    assert right(3) == 1.5
    with pytest.raises(numba.TypingError):
        wrong(3)
    assert [id(item) for item in state()] == [id(item) for item in before]


def test_a_slice_of_another_shape_is_still_refused():
    with pytest.raises(ValueError, match="cannot assign slice"):
        reversed_into(np.zeros(3), np.ones(2))
    target = np.zeros(2)
    reversed_into(target, np.ones(2))
    assert target.tolist() == [1, 1]


def test_the_types_of_scalar_functions_are_those_of_numba():
    context = registry.cpu_target.typing_context
    context.refresh()
    kinds = types.int64, types.int32, types.uint8, types.float32, types.float64, types.boolean, types.literal(2)
    for function in (operator.add, operator.truediv, operator.floordiv, operator.lt, operator.pow, max, abs):
        called = context.resolve_value_type(function)
        for one in kinds:
            for arguments in [(one,)] if function is abs else [(one, two) for two in kinds]:
                try:
                    own = home._call_type(called, context, arguments, {})
                except errors.TypingError:  # older versions of numba have no max(int64, bool)
                    with pytest.raises(errors.TypingError):
                        home._call_type_of_scalars(called, context, arguments, {})
                    continue
                implementation = called._impl_keys[own.args]
                for _ in range(2):
                    assert home._call_type_of_scalars(called, context, arguments, {}) == own
                    assert called._impl_keys[own.args] is implementation


def test_options_have_the_values_of_numba():
    plain, other, same = compiler.Flags(), compiler.Flags(), compiler.Flags()
    other.error_model = "numpy"
    same.nrt = plain.nrt
    for flags in (plain, other, same):
        assert home._values_of_options(flags) == flags.values()
    assert home._equal_options(plain, same)
    assert home._hash_of_options(plain) == home._hash_of_options(same)
    assert not home._equal_options(plain, other)
    assert home._equal_options(plain, cpu) is NotImplemented


def mixed(x, y):
    values = [(x, y), (y, x)]
    total = {"a": x}
    for item in values:
        total["b"] = item[0] + max(*item) if x > y else -y
    return total


def counted(stop):
    while stop > 0:
        yield stop
        stop -= 1


def test_the_variables_of_statements_are_those_of_numba():
    statements = [statement for block in compiler.run_frontend(mixed).blocks.values() for statement in block.body]
    for statement in statements:
        parts = [statement, *(part for part in vars(statement).values() if isinstance(part, ir.Inst))]
        for part in parts:
            assert home._variables(part, part.__dict__) == ir.Inst._rec_list_vars(part, part.__dict__)


@pytest.mark.parametrize("function", [mixed, counted])
def test_lifetimes_and_deletions_are_those_of_numba(function):
    own, other = compiler.run_frontend(function), compiler.run_frontend(function)
    home._post_process(postproc.PostProcessor(own), True)
    home._variable_lifetimes(postproc.PostProcessor(other), True)
    assert own.dump_to_string() == other.dump_to_string()
    assert own.variable_lifetime.livemap == other.variable_lifetime.livemap
    assert bool(other.generator_info) is (function is counted)


def test_the_types_of_values_are_those_of_numba():
    context = registry.cpu_target.typing_context
    context.refresh()
    for value in (operator.add, math.sqrt, len, min, float, 1, 2.5, True, "text", None, np.zeros(2), np, np.add, mixed):
        try:
            own = home._value_type(context, value)
        except ValueError:
            with pytest.raises(ValueError, match="Cannot determine"):
                home._type_of_value(context, value)
        else:
            assert home._type_of_value(context, value) == own


def test_an_overload_that_is_registered_late_is_found():
    def late(x):
        raise NotImplementedError

    @kernel
    def before(x):
        return x + 1

    @kernel
    def after(x):
        return late(x)

    assert before(1) == 2
    overload(late)(lambda x: lambda x: x + 5)
    assert after(1) == 6


def test_numbers_have_no_references():
    context = registry.cpu_target.target_context.subtarget(enable_nrt=True)
    number = types.int64, types.float32, types.boolean, types.literal(2)
    for kind in number:
        value = context.get_value_type(kind)
        function = llvm.Function(llvm.Module(), llvm.FunctionType(llvm.VoidType(), [value]), "function")
        builder = llvm.IRBuilder(function.append_basic_block())
        home._count_references(context.nrt, builder, kind, function.args[0], "NRT_incref")
        assert not builder.block.instructions
