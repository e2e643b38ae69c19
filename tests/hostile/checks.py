"""What must hold after any call, however hostile its input."""

from __future__ import annotations

from pathlib import Path

from hostile.sandbox import Outcome

__all__ = ["MOST_MEMORY", "check", "content"]

#: Peak memory of a call on small files, bytes.
MOST_MEMORY = 1 << 30


def content(folder: Path) -> dict[Path, bytes]:
    """Return the bytes of all regular files below a folder."""
    files = (path for path in folder.rglob("*") if path.is_file() and not path.is_symlink())
    return {path.relative_to(folder): path.read_bytes() for path in files}


def check(
    outcome: Outcome,
    before: dict[Path, bytes],
    folder: Path,
    *outputs: str | None,
    memory: int = MOST_MEMORY,
    checks: bool = False,
) -> None:
    """Raise unless a call ended in time, in bounded memory, in words, and wrote its outputs alone or nothing.

    A command that `checks` may print findings and several errors before it ends with exit code 2.
    """
    shown = f"exit code {outcome.code}\n{outcome.stdout[-2000:]}\n{outcome.stderr[-4000:]}"
    assert not outcome.hung, f"no answer within {outcome.seconds:.0f} s"
    assert outcome.code in {0, 1, 2, 3, 4}, shown
    assert "Traceback" not in outcome.stderr, shown
    assert "Warning: " not in outcome.stderr, shown
    assert outcome.peak_memory < memory, f"{outcome.peak_memory / 1e6:.0f} MB"
    if outcome.code == 2:
        errors = [line for line in outcome.stderr.splitlines() if line.startswith("Error: ")]
        assert len(errors) == 1 or (checks and errors), shown
        assert outcome.stdout == "" or checks, shown
    after = content(folder)
    assert {path: after.get(path) for path in before} == before, "the inputs were changed"
    allowed = set() if outcome.code == 2 else {*outputs}
    made = {path for path in after if path not in before}
    assert {path.parts[0] for path in made} <= allowed, sorted(made)
