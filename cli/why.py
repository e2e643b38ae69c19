"""``roofbench why``: what a stored run depends on."""

from __future__ import annotations

from .command import load_plugins
from .console import print_result
from .options import DEFAULT_STORE, PluginOption, RunArgument, StoreOption

__all__ = ["why"]


def why(run: RunArgument, store: StoreOption = DEFAULT_STORE, plugin: PluginOption = None) -> None:
    """Explain what a stored run depends on, and what has changed since."""
    from ..benchmark.store.writer import Store
    from ..reports.run_text import format_run

    load_plugins(plugin)
    with Store(store, must_exist=True) as opened:
        print_result(format_run(opened, opened.run(run)))
