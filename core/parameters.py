"""Parameters: the declared, checked and documented fields of detectors, evaluators and scene presets.

A *parameter* is a dataclass field made by `parameter`. It carries its unit, range, meaning and source, so that one
declaration serves validation, ``-d "name[parameter=value]"`` on the command line, sweeps and the documentation.

An *execution option* is a dataclass field made by `execution_option`: the number of threads, for instance. It changes
the time and memory of a run and never its result. It is set in the same way, ``name[threads=2]`` or ``-p threads=2``,
but it is no parameter: keys, labels and sweeps do not see it, and objects that differ in it alone are equal.

A parameter that is *used with* certain values of another one has no effect beside other values. It then has its
default, whatever was given, so that equal runs have equal keys: ``improved[voting=false,majority=0.7]`` is
``improved[voting=false]``.

A *mode* is a named set of defaults: `Parameterised.modes` maps values of the parameter ``mode`` to defaults that
replace those of the fields. A parameter that is *given*, by name on construction, overrides it, whatever its value:
``original[mode=paper,rise=0.1]``. An object remembers which were given, so that a later change of the mode or of other
defaults (`with_defaults`) leaves them as they are; equality and `changed` do not see it.
"""

from __future__ import annotations

import dataclasses
import inspect
import types
import typing
from collections.abc import Mapping
from typing import Any, ClassVar, Self

from .conditions import Uses, counts_beside, uses_in_words
from .display import Displayed
from .errors import ParameterError
from .parameter_rules import Parameter, parameter_text
from .registry import nearest_hint

__all__ = ["Parameterised", "execution_option", "parameter"]

#: Names of parameters that a message lists at most.
_MOST_NAMES = 24


def parameter(
    default: Any,
    *,
    unit: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple[Any, ...] = (),
    doc: str = "",
    source: str = "",
    swept: tuple[Any, ...] = (),
) -> Any:
    """Declare a parameter of a detector, evaluator or preset: a dataclass field with unit, range and meaning.

    Examples
    --------
    >>> import dataclasses
    >>> @dataclasses.dataclass(frozen=True, kw_only=True)
    ... class Threshold(Parameterised):
    ...     height: float = parameter(2.5, unit="m", minimum=0, doc="height above ground")
    >>> Threshold(height=-1)
    Traceback (most recent call last):
    roofbench.core.errors.ParameterError: Threshold: height must be at least 0 m, not -1
    """
    facts = {
        "unit": unit,
        "minimum": minimum,
        "maximum": maximum,
        "choices": choices,
        "doc": doc,
        "source": source,
        "swept": swept,
    }
    return dataclasses.field(default=default, metadata={"parameter": facts})


def execution_option(
    default: Any,
    *,
    unit: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple[Any, ...] = (),
    doc: str = "",
) -> Any:
    """Declare an execution option: a dataclass field that changes the time of a run and never its result.

    Examples
    --------
    >>> import dataclasses
    >>> @dataclasses.dataclass(frozen=True, kw_only=True)
    ... class Threshold(Parameterised):
    ...     height: float = parameter(2.5, unit="m", minimum=0, doc="height above ground")
    ...     threads: int = execution_option(1, minimum=1, doc="number of threads")
    >>> fast = Threshold.build({"threads": "2"})
    >>> fast.threads, fast.values(), fast == Threshold()
    (2, {'height': 2.5}, True)
    """
    facts = {"unit": unit, "minimum": minimum, "maximum": maximum, "choices": choices, "doc": doc}
    return dataclasses.field(default=default, compare=False, metadata={"execution": facts})


class Parameterised(Displayed):
    """Mixin of frozen dataclasses whose fields are parameters: checked on construction, listed on request.

    Attributes
    ----------
    modes : mapping
        Value of the parameter ``mode`` to the defaults that it sets, by parameter; empty for classes without modes.
    used_with : mapping
        Parameter to other parameters and those values or conditions of them beside which it counts (`conditions`); the
        parameters that are absent always count.
    """

    shown_by = "reports.notebook_view:parameters_view"
    modes: ClassVar[Mapping[str, Mapping[str, Any]]] = {}
    used_with: ClassVar[Mapping[str, Uses]] = {}

    def __init_subclass__(cls, **more: Any) -> None:
        super().__init_subclass__(**more)
        # Before the decorator of dataclasses, which keeps what a class has.
        if "__repr__" not in cls.__dict__:
            cls.__repr__ = Parameterised.__repr__  # type: ignore[method-assign]
        own = cls.__dict__.get("__doc__") or ""
        # With slots, the decorator makes the class a second time.
        own = own.text if isinstance(own, _Documentation) else own
        cls.__doc__ = _DocumentedParameters(own)  # type: ignore[assignment]

    def __new__(cls, *_: Any, **given: Any) -> Self:
        """Note which parameters are given: a mode sets the others."""
        created = super().__new__(cls)
        if given:
            object.__setattr__(created, "_given", frozenset(given))
        return created

    def __post_init__(self) -> None:
        owner = getattr(self, "name", None) or type(self).__name__
        if self.modes:
            given = self.__dict__.get("_given", frozenset())
            for name, value in self._mode_defaults().items():
                if name not in given:
                    object.__setattr__(self, name, value)
        for name, rule in {**self.parameters(), **self.execution_options()}.items():
            object.__setattr__(self, name, rule.check(getattr(self, name), owner))
        defaults = self.defaults() if self.used_with else {}
        for name in self.unused():
            object.__setattr__(self, name, self.parameters()[name].check(defaults[name], owner))

    def __repr__(self) -> str:
        """Return the class with the values that differ from their default: ``NDSM(height=3.0)``."""
        given = {**self.changed(), **self._changed_options()}
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in given.items())})"

    def _changed_options(self) -> dict[str, Any]:
        options = self.execution_options()
        return {name: value for name, value in self.execution_values().items() if value != options[name].default}

    @classmethod
    def description(cls) -> str:
        """Return its docstring without the list of parameters that `help` shows."""
        documented = cls.__dict__.get("__doc__")
        if isinstance(documented, (_DocumentedParameters, _Documentation)):
            documented = documented.text
        return inspect.cleandoc(documented or "")

    @classmethod
    def parameters(cls) -> dict[str, Parameter]:
        """Return the declared parameters by name, in order of declaration."""
        return cls._declared("parameter")

    @classmethod
    def execution_options(cls) -> dict[str, Parameter]:
        """Return the declared execution options by name, in order of declaration."""
        return cls._declared("execution")

    @classmethod
    def _declared(cls, kind: str) -> dict[str, Parameter]:
        """Return the fields that were declared as parameters or as execution options."""
        cached: dict[str, Parameter] | None = cls.__dict__.get(f"_declared_{kind}")
        if cached is None:
            hints = typing.get_type_hints(cls)
            cached = {}
            for field in dataclasses.fields(cls):  # type: ignore[arg-type]
                if kind in field.metadata:
                    plain, optional = _plain_type(hints[field.name])
                    cached[field.name] = Parameter(
                        name=field.name, type=plain, optional=optional, default=field.default, **field.metadata[kind]
                    )
            setattr(cls, f"_declared_{kind}", cached)
        return cached

    @classmethod
    def build(cls, values: Mapping[str, Any] | None = None) -> Self:
        """Build from a mapping (TOML, keyword arguments); text is parsed, unknown names answered by the nearest."""
        owner = getattr(cls, "name", None) or cls.__name__
        known = {**cls.parameters(), **cls.execution_options()}
        checked = {}
        for name, value in (values or {}).items():
            if name not in known:
                listed = ", ".join([*known][:_MOST_NAMES]) or "none"
                more = f" and {len(known) - _MOST_NAMES} more" if len(known) > _MOST_NAMES else ""
                raise ParameterError(
                    f"{owner}: no parameter {name!r}{nearest_hint(name, known)}; it has {listed}{more}"
                )
            rule = known[name]
            as_text = isinstance(value, str) and rule.type is not str
            checked[name] = rule.parse(value, owner) if as_text else rule.check(value, owner)
        return cls(**checked)

    def defaults(self) -> dict[str, Any]:
        """Return the default values by name, those of the mode included."""
        plain = {name: rule.default for name, rule in self.parameters().items()}
        return {**plain, **self._mode_defaults()}

    def _mode_defaults(self) -> Mapping[str, Any]:
        mode = getattr(self, "mode", None)
        return self.modes.get(mode, {}) if isinstance(mode, str) else {}

    def given(self) -> dict[str, Any]:
        """Return the values that were chosen: those given by name, and those that differ from their default.

        An object that was made with every parameter is a copy of another one: what it has in common with the defaults
        was not chosen.
        """
        named = self.__dict__.get("_given", frozenset())
        copied = named >= self.parameters().keys()
        kept = set() if copied else named - set(self.unused())
        changed = self.changed()
        return {name: value for name, value in self.values().items() if name in changed or name in kept}

    def with_defaults(self, values: Mapping[str, Any]) -> Self:
        """Return a copy with other values of the parameters that are not given."""
        given = self.given()
        return self.replaced({name: value for name, value in values.items() if name not in given})

    def replaced(self, values: Mapping[str, Any]) -> Self:
        """Return a copy with other values; a new mode changes every parameter that is not given.

        Raises
        ------
        ParameterError
            A parameter among `values` has no effect beside the others.
        """
        copy = type(self).build({**self.execution_values(), **self.given(), **values})
        for name in copy.unused():
            if name in values:
                needed = uses_in_words(self.used_with[name], parameter_text)
                owner = getattr(self, "name", None) or type(self).__name__
                raise ParameterError(f"{owner}: {name} has no effect here: it is used with {needed}")
        return copy

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return every parameter and execution option by name, as scikit-learn's estimators do.

        `deep` changes nothing: no parameter is an object with parameters of its own.
        """
        return {**self.values(), **self.execution_values()}

    def set_params(self, **values: Any) -> Self:
        """Change parameters in place and return the object, as scikit-learn's estimators do.

        `replaced` returns a changed copy instead. As with any key of a mapping, do not change an object that is used
        as one.

        Raises
        ------
        ParameterError
            Unknown parameter, or a value outside its range; nothing is changed then.
        """
        changed = self.replaced(values)
        self.__dict__.clear()  # what was derived from the old values goes as well
        self.__dict__.update(changed.__dict__)
        return self

    def unused(self) -> list[str]:
        """Return the names of the parameters that have no effect beside the values of others."""
        return [name for name, uses in self.used_with.items() if not counts_beside(uses, self.__getattribute__)]

    def values(self) -> dict[str, Any]:
        """Return the parameter values by name."""
        return {name: getattr(self, name) for name in self.parameters()}

    def execution_values(self) -> dict[str, Any]:
        """Return the values of the execution options by name."""
        return {name: getattr(self, name) for name in self.execution_options()}

    def changed(self) -> dict[str, Any]:
        """Return the values that differ from their default; `build` makes an equal object of them.

        The mode counts as changed when it is not the default one; the other values are compared with its defaults.
        """
        defaults = self.defaults()
        return {name: value for name, value in self.values().items() if value != defaults[name]}


class _DocumentedParameters:
    """Docstring of a class, followed by its parameters with unit, range and source.

    It is written when it is first read, which the decorator of dataclasses does, and then replaced by the text: `help`
    shows no docstring that is not a string.
    """

    def __init__(self, text: str) -> None:
        self.text: str = text

    def __get__(self, instance: Any, owner: type[Parameterised]) -> str:
        current: object = owner.__dict__.get("__doc__")
        if "__dataclass_fields__" not in owner.__dict__ or current is not self:
            return self.text  # the class is being made, or it is derived from the documented one
        try:
            titles = {"Parameters": owner.parameters(), "Execution options": owner.execution_options()}
        except (AttributeError, NameError, ParameterError, TypeError):
            return self.text  # the error is raised where the parameters are used
        sections = [inspect.cleandoc(self.text)]
        for title, rules in titles.items():
            if rules:
                sections.append("\n".join([title, "-" * len(title), *map(_documented, rules.values())]))
        documentation = _Documentation("\n\n".join(filter(None, sections)))
        documentation.text = self.text
        owner.__doc__ = documentation
        return documentation


class _Documentation(str):
    """A docstring with its parameters; `text` is the part that was written by hand."""

    text: str


def _documented(rule: Parameter) -> str:
    """Return a parameter in the form of numpydoc."""
    kind = rule.type.__name__ + (" or None" if rule.optional else "")
    lines = [f"{rule.name} : {kind}, default {rule.default!r}"]
    lines += [f"    {rule.doc[:1].upper()}{rule.doc[1:]}."] if rule.doc else []
    lines.append(f"    {rule.range_text[:1].upper()}{rule.range_text[1:]}.")
    lines += [f"    Source: {rule.source}."] if rule.source else []
    return "\n".join(lines)


def _plain_type(hint: Any) -> tuple[type, bool]:
    """Split ``float | None`` into (float, True); a `typing.Literal` counts as the type of its values."""
    optional = False
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        parts = [part for part in typing.get_args(hint) if part is not type(None)]
        optional = len(parts) < len(typing.get_args(hint))
        hint = parts[0]
    if typing.get_origin(hint) is typing.Literal:
        hint = type(typing.get_args(hint)[0])
    if hint not in (bool, int, float, str):
        raise TypeError(f"a parameter is a bool, int, float or str (or None), not {hint!r}")
    return hint, optional
