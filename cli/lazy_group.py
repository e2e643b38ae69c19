"""Commands that are imported when they are called, so that no command waits for the others."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, MutableMapping
from contextlib import contextmanager
from typing import Any

import typer
import typer.core
import typer.main

from ..core.errors import ParameterError
from .command import Command
from .usage_errors import UsageError, usage_sentence

__all__ = ["COMMANDS", "LazyGroup"]

#: Name of each command to its module with its function or group, and its meaning in the list of commands.
COMMANDS = {
    "run": ("run:run", "Run detectors on scenes and print the leaderboard."),
    "evaluate": ("evaluate:evaluate", "Compare detected with reference footprints."),
    "compare": ("compare:compare", "Compare two detections of one place, paired."),
    "detect": ("detect:detect", "Detect buildings on one scene."),
    "sweep": ("sweep:sweep", "Vary parameters of detectors or scenes."),
    "report": ("report:report", "Write an HTML report, or compare two stores."),
    "plot": ("plot:app", "Draw single figures as PNG, SVG or PDF."),
    "scenes": ("scenes:app", "Make, import, index, check, list and show scenes."),
    "list": ("list:list_names", "List detectors, evaluators, suites, scenes, indices."),
    "info": ("info:info", "Explain one of these names."),
    "new": ("new:new", "Write a detector, evaluator, suite or package."),
    "check-plugin": ("check_plugin:check_plugin", "Check a detector or evaluator."),
    "ls": ("ls:ls", "List stored runs."),
    "why": ("why:why", "Explain what a stored run depends on."),
    "score": ("score:score", "Evaluate stored detections with other evaluators."),
    "export": ("export:export", "Write a stored run as vector layers."),
    "baseline": ("baseline:app", "Save reference scores for the regression gate."),
    "gate": ("gate:gate", "Test whether a change made a detector worse."),
}


class _Commands(MutableMapping[str, Any]):
    """The commands by name; each is imported and built when it is asked for."""

    def __init__(self) -> None:
        self._built: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._built:
            module, _, attribute = COMMANDS[name][0].partition(":")
            target = getattr(importlib.import_module(f".{module}", __package__), attribute)
            if not isinstance(target, typer.Typer):
                target, function = typer.Typer(add_completion=False, rich_markup_mode=None), target
                target.command(name, cls=Command)(function)
            self._built[name] = typer.main.get_command(target)
        return self._built[name]

    def __setitem__(self, name: str, command: Any) -> None:
        self._built[name] = command

    def __delitem__(self, name: str) -> None:
        del self._built[name]

    def __iter__(self) -> Iterator[str]:
        return iter(COMMANDS)

    def __len__(self) -> int:
        return len(COMMANDS)


class LazyGroup(typer.core.TyperGroup):
    """The command ``roofbench``, whose commands are imported one by one."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands = _Commands()
        self._words: list[str] = []

    def make_context(self, info_name: Any, args: Any, parent: Any = None, **extra: Any) -> Any:
        """Read the command line; a mistake ends in one sentence."""
        self._words = list(args)
        with self._mistakes_in_a_sentence():
            return super().make_context(info_name, args, parent, **extra)

    def invoke(self, ctx: Any) -> Any:
        """Call the command; a mistake in its words ends in one sentence."""
        with self._mistakes_in_a_sentence():
            return super().invoke(ctx)

    @contextmanager
    def _mistakes_in_a_sentence(self) -> Iterator[None]:
        try:
            yield
        except UsageError as error:
            if type(error).__name__ == "NoArgsIsHelpError":
                raise
            raise ParameterError(usage_sentence(error, self._words)) from None

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of the commands in the order of the help."""
        return list(COMMANDS)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands with their meanings, without importing any."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, meaning) for name, (_, meaning) in COMMANDS.items()])
