"""``roofbench scenes check``: the contents of a scene folder, and whether it is sound."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

import typer

from .console import print_result, say
from .options import FORMAT_HELP

__all__ = ["check"]


def check(
    scene: Annotated[Path, typer.Argument(metavar="SCENE", help="Scene folder.")],
    form: Annotated[Literal["table", "json"], typer.Option("--format", "-f", help=FORMAT_HELP)] = "table",
    update: Annotated[
        bool, typer.Option("--update-checksums", help="Accept edited files: write their checksums into the manifest.")
    ] = False,
) -> None:
    """Check a scene folder and print its contents; exit code 2 when there is a problem.

    Warnings name references of different buildings that overlap; they are no problem: registers have some.
    """
    from ..evaluators.overlay.reference_overlaps import reference_warnings
    from ..reports.scene_text import format_facts
    from ..scenes.checking import check_scene
    from ..scenes.folder import open_scene, update_checksums

    for name in update_checksums(scene) if update else ():
        say(f"- {name} was edited; its new checksum is in the manifest")
    report = check_scene(scene)
    reference = open_scene(scene).reference if "reference" in report.facts else None
    warnings = () if reference is None else reference_warnings(reference)
    if form == "json":
        print_result(json.dumps({"facts": report.facts, "problems": report.problems, "warnings": warnings}, indent=2))
    else:
        print_result(format_facts(report.facts), nl=False)
    for warning in warnings:
        say(f"Warning: {warning}")
    for problem in report.problems:
        say(f"Error: {problem}")
    if report.problems:
        raise typer.Exit(2)
