"""The code of a detector, so that a change is noticed and the old code can run again.

Nouns
-----
framework
    The modules of roofbench that a detector depends on. An older version is found by its commit.
plugin sources
    The modules outside roofbench that a detector depends on: a file, files beside it, or those of an installed package.
    Their text is kept, because nothing else brings an older version back.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

from ...core.digests import digest
from ...core.errors import InputError
from ...core.package import NAME
from ...detectors.base import Detector
from .kept_files import KeptFiles
from .keys import module_file, source_closure

__all__ = ["DetectorCode"]

_FILE = "roofbench_plugin_"


@dataclass(frozen=True, kw_only=True)
class DetectorCode:
    """The code of a detector.

    Attributes
    ----------
    framework : str
        Digest of the modules of roofbench.
    plugin : str
        Digest of the modules outside roofbench; empty for a detector of roofbench.
    fingerprint : str
        Of the program or file that the detector reads; empty for most.
    sources : mapping of str to str
        Text of the plugin's modules by path, relative to the folder from which they are imported.
    kept : KeptFiles, optional
        Copies of its program and of the files that belong to it, where they are small.
    """

    framework: str
    plugin: str = ""
    fingerprint: str = ""
    sources: Mapping[str, str] = field(default_factory=dict)
    kept: KeptFiles | None = None

    @classmethod
    def of(cls, detector: Detector) -> Self:
        """Return the code of a detector."""
        modules = source_closure(type(detector)).modules
        inside = {name: value for name, value in modules.items() if name.partition(".")[0] == NAME}
        outside = {name: value for name, value in modules.items() if name not in inside}
        files = {_path_of(name): (module_file(name.partition(":")[0]), value) for name, value in outside.items()}
        sources = {path: file.read_text("utf-8") for path, (file, _) in files.items() if file is not None}
        for path in [Path(path) for path in sources if "/" in path]:
            for parent in list(path.parents)[:-1]:
                init = module_file(".".join(parent.parts))
                if init is not None and init.name == "__init__.py":
                    sources.setdefault(f"{parent.as_posix()}/__init__.py", init.read_text("utf-8"))
        return cls(
            framework=digest(inside),
            plugin=digest({path: value for path, (_, value) in files.items()}) if files else "",
            fingerprint=detector.fingerprint(),
            sources=dict(sorted(sources.items())),
            kept=KeptFiles.of(detector),
        )

    @property
    def digest(self) -> str:
        """Digest of everything that decides what runs."""
        return digest([self.framework, self.plugin, self.fingerprint])

    def unpack(self, folder: Path) -> None:
        """Write the plugin's modules below a folder."""
        for name, text in self.sources.items():
            target = (folder / name).resolve()
            if not target.is_relative_to(folder.resolve()):
                raise InputError(f"the baseline keeps a source outside its folder: {name!r}")
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(text, encoding="utf-8")

    def to_dict(self) -> dict[str, Any]:
        """Return JSON content."""
        kept = {} if self.kept is None else {"kept": self.kept.to_dict()}
        return {
            "framework": self.framework,
            "plugin": self.plugin,
            "fingerprint": self.fingerprint,
            "sources": dict(self.sources),
            **kept,
        }

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Return the code of what `to_dict` returned."""
        kept = content.get("kept")
        return cls(**{**content, "kept": None if kept is None else KeptFiles(**kept)})


def _path_of(module: str) -> str:
    """Return the path of a plugin's module below the folder from which it is imported."""
    name = module.partition(":")[0]
    file = module_file(name)
    if file is None:
        return name
    if name.startswith(_FILE) or "." not in name:
        return f"{name}/__init__.py" if file.name == "__init__.py" else file.name
    folder = name.replace(".", "/")
    return f"{folder}/__init__.py" if file.name == "__init__.py" else f"{folder}.py"
