"""Mistakes on the command line in one sentence each: what is wrong, which rule it breaks, what to write instead."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from typing import Any

import typer

__all__ = ["UsageError", "usage_sentence"]

#: What the parser of the command line raises; a command without arguments, which shows its help, is no mistake.
UsageError: type[Any] = typer.BadParameter.__mro__[1]

_CHOICES = re.compile(r"'(?P<given>[^']*)' is not one of (?P<choices>'.*)")
#: Names that users expect for an option, each with the options that may be meant.
_OTHER_NAMES = {
    "--rank-by": ("--index",),
    "--scene": ("--scenes",),
    "--only": ("--scenes",),
    "--detectors": ("--detector",),
    "--metric": ("--index",),
    "--force": ("--overwrite",),
    "--out": ("--output",),
    "--workers": ("--jobs",),
    "--bbox": ("--extent",),
    "--seed": ("--seeds",),
}
_NUMBER = re.compile(r"integer|number|float|range|greater|less|parse")


def usage_sentence(error: Any, words: Sequence[str]) -> str:
    """Return an error of the parser as one sentence.

    Parameters
    ----------
    error : UsageError
    words : sequence of str
        The command line after the name of the program.
    """
    kind, context = type(error).__name__, error.ctx
    path = "roofbench" if context is None else str(context.command_path)
    parameter = getattr(error, "param", None)
    if kind == "MissingParameter" and parameter is not None:
        name = _name(parameter)
        option = f" {name} {parameter.metavar}" if name.startswith("-") else ""
        return f"{path} needs {_described(parameter)}: write '{_usage(context)}{option}', or see '{path} -h'"
    if kind == "NoSuchOption":
        name = str(error.option_name)
        if name in ("-p", "--parameter"):
            return f"{path} has no option {name}: write parameters behind the detector, such as -d 'ndsm[height=3]'"
        known = _options(context)
        other = next((one for one in _OTHER_NAMES.get(name, ()) if one in known), None)
        hint = f" (did you mean {other!r}?)" if other else _nearest(name, known)
        return f"{path} has no option {name!r}{hint}: '{path} -h' lists them"
    if kind == "BadOptionUsage" and context is not None:
        return _without_value(error, context, path)
    if kind == "BadParameter" and parameter is not None:
        given = _given(parameter, words)
        long = next((f"-{word}" for word in words if given and re.fullmatch(rf"-\w{re.escape(given)}", word)), "")
        hint = f" (did you mean '{long}'?)" if long in _options(context) else ""
        return f"{_name(parameter)} {_rule(parameter, error.message, given)}{hint}"
    if context is not None and (found := re.search(r"[Nn]o such command ['\"](.*?)['\"]", error.message)):
        known = context.command.list_commands(context)
        return f"{path} has no command {found[1]!r}{_hint(found[1], known)}; it has {', '.join(known)}"
    if context is not None and (found := re.search(r"unexpected extra argument(?:s|\(s\))? \((.*)\)", error.message)):
        return f"{path} does not take {found[1]!r} as well: write '{_usage(context)}', and quote names with spaces"
    sentence = str(error.format_message()).rstrip(".")
    return f"{sentence[:1].lower()}{sentence[1:]}: see '{path} -h'"


def _hint(name: str, known: Iterable[str]) -> str:
    from ..core.registry import nearest_hint  # here, since help has no use for registries

    return nearest_hint(name, known)


def _usage(context: Any) -> str:
    """Return the arguments of a command as they are typed, options left out."""
    return " ".join(str(context.get_usage()).partition(":")[2].replace("[OPTIONS]", "").split())


def _name(parameter: Any) -> str:
    if parameter.param_type_name == "argument":
        return str(parameter.metavar)
    return str(max(parameter.opts, key=len))


def _described(parameter: Any) -> str:
    name = _name(parameter)
    if name.startswith("-") and parameter.metavar:
        name = f"{name} {parameter.metavar}"
    meaning = re.split(r"\.(?: [A-Z]|$)| \(|: |; ", str(getattr(parameter, "help", None) or ""))[0]
    if meaning[1:2].islower():
        meaning = meaning[:1].lower() + meaning[1:]
    return f"{name} ({meaning})" if meaning else name


def _options(context: Any) -> list[str]:
    return [] if context is None else [name for one in context.command.get_params(context) for name in one.opts]


def _nearest(name: str, options: Iterable[str]) -> str:
    return _hint(name, [option for option in options if option.startswith("--")])


def _without_value(error: Any, context: Any, path: str) -> str:
    name = str(error.option_name)
    if "requires" not in error.message:
        return f"{name} takes no value: write {name} alone"
    parameter = next((one for one in context.command.get_params(context) if name in one.opts), None)
    value = getattr(parameter, "metavar", None) or "VALUE"
    return f"{name} needs {'values' if ' ' in value else 'a value'}: write '{name} {value}', or see '{path} -h'"


def _rule(parameter: Any, message: str, given: str | None) -> str:
    """Return what a value must be, and what was given."""
    choices = _CHOICES.search(message)
    if choices and given is None:
        given = choices["given"]
    what = "" if given is None else f", not {given!r}"
    if choices:
        known = re.findall(r"'([^']*)'", choices["choices"])
        hint = "" if given is None else _hint(given, known)
        return f"must be one of {', '.join(known)}{what}{hint}"
    if _NUMBER.search(message):
        return f"must be {_number(parameter, message)}{what}"
    return f"cannot be used: {message.rstrip('.')}"


def _number(parameter: Any, message: str) -> str:
    whole = "integer" in message or parameter.metavar == "N"
    kind = getattr(parameter, "type", None)
    low, high = (getattr(parameter, end, getattr(kind, end, None)) for end in ("min", "max"))
    text = "a whole number" if whole else "a number"
    if low is not None and high is not None:
        return f"{text} from {low:g} to {high:g}"
    if low is not None:
        return f"{text} of at least {low:g}"
    return f"{text} of at most {high:g}" if high is not None else text


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _given(parameter: Any, words: Sequence[str]) -> str | None:
    """Return the text that an option was given, as far as it can be seen; that of an argument is in the message."""
    for place, word in enumerate(words):
        for name in parameter.opts:
            if word == name and place + 1 < len(words):
                values = words[place + 1 : place + 1 + parameter.nargs] if parameter.nargs > 1 else [words[place + 1]]
                return next((value for value in values if not _is_number(value)), values[0])
            if name.startswith("--") and word.startswith(f"{name}="):
                return word.partition("=")[2]
            if len(name) == 2 and name.startswith("-") and word.startswith(name) and not word.startswith("--"):
                return word[2:]
    return None
