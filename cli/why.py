"""``roofbench why``: what a stored run depends on."""

from __future__ import annotations

import json

import typer

from .command import load_plugins
from .options import DEFAULT_STORE, PluginOption, RunArgument, StoreOption

__all__ = ["why"]


def why(run: RunArgument, store: StoreOption = DEFAULT_STORE, plugin: PluginOption = None) -> None:
    """Explain what a stored run depends on, and what has changed since."""
    from ..benchmark.analysis.leaderboard import repeat_command
    from ..benchmark.plan import differences, identity_now
    from ..benchmark.store.writer import Store
    from ..core.errors import RoofbenchError

    load_plugins(plugin)
    with Store(store, must_exist=True) as opened:
        row = opened.run(run)
        code, machine = opened.code(row.id), opened.machine(row.id)
        lines = [
            f"run {row.id}, key {row.key}",
            f"  status     {row.status}{': ' + row.reason if row.reason else ''}",
            f"  detector   {row.detector}  {json.dumps(row.parameters)}",
            f"  scene      {row.scene}, key {row.scene_key[:16]}",
            f"  seed       {row.seed}",
            f"  code       roofbench {row.version}, {len(code.modules)} modules, digest {code.digest[:16]}",
            f"  packages   {', '.join(f'{name} {version}' for name, version in code.packages.items())}",
            f"  cost       {row.seconds:.3f} s, CPU {row.cpu_seconds:.3f} s, {row.peak_memory / 1e6:.0f} MB",
            f"  machine    {', '.join(f'{name} {value}' for name, value in machine.items()) or 'not known'}",
            f"  finished   {row.finished}",
            f"  repeat     {repeat_command(row)}",
        ]
        try:
            changes = differences(opened, row.id, identity_now(row))
        except RoofbenchError as error:
            lines.append(f"It cannot be made again here: {error}")
        else:
            lines.append(
                "Nothing that it depends on has changed: it would not be run again."
                if not changes
                else "It would be run again: " + "; ".join(changes) + "."
            )
            if row.status == "failed" and not changes:
                lines[-1] = "Nothing that it depends on has changed; failures are tried again."
        if row.traceback:
            lines += ["", row.traceback.rstrip()]
    typer.echo("\n".join(lines))
