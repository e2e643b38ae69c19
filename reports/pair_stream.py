"""Two detections of one place, compared in parts, as vector layers that are written batch by batch."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ..evaluators.in_parts import SideVerdicts
from ..evaluators.uncertainty.paired_files import PairedFiles
from .qgis_style import pair_styles
from .streamed_layers import Rows, StreamedLayer, write_streamed
from .verdict_stream import verdict_fields, verdict_rows

__all__ = ["write_pair_stream"]

#: Columns of the references that stand beside each other for A and B, and rows that are kept at a time.
_PAIRED, _BATCH = ("verdict", "partner", "reason"), 1 << 17


def write_pair_stream(found: PairedFiles, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write the fate of each reference in two detections, and the verdicts of both.

    The layers and columns are those of `write_pair`: ``references``, ``detections_a`` and ``detections_b``.
    """
    import pyarrow

    files, text, whole = found.files, pyarrow.string(), pyarrow.int64()
    kinds = {"verdict": text, "partner": whole, "reason": text}
    fields = {"fate": text} | {f"{key}_{side}": kinds[key] for key in _PAIRED for side in "ab"}
    with _references(found) as references:
        layers = [StreamedLayer("references", "reference", files.streams[2], files.repaired(2), fields, references)]
        layers += [
            StreamedLayer(
                f"detections_{name}",
                f"detection_{name}",
                files.streams[place],
                files.repaired(place),
                verdict_fields(),
                partial(_detections, found, place),
            )
            for place, name in enumerate("ab")
        ]
        write_streamed(
            layers,
            path,
            layer="comparison",
            styles=pair_styles(found.evaluator.verdict_kinds),
            overwrite=overwrite,
            scratch=files.work,
        )


def _detections(found: PairedFiles, place: int) -> Rows:
    return verdict_rows(found.verdicts(place)[0])


@contextmanager
def _references(found: PairedFiles) -> Iterator[Any]:
    """Yield what returns the rows of the references; the verdicts of A and of B are kept on disk meanwhile."""
    import pyarrow

    with TemporaryDirectory(prefix=".references-", dir=found.files.work) as folder:
        kept = []
        for place, name in enumerate("ab"):
            file = Path(folder) / f"{name}.arrow"
            verdicts = found.verdicts(place)[1]
            _keep(verdicts, file)
            ids = verdicts.ids
            del verdicts
            kept.append(pyarrow.ipc.open_file(pyarrow.memory_map(str(file))).read_all())
        fates = found.comparison.fates
        assert fates is not None

        def columns(part: slice) -> dict[str, Any]:
            count = part.stop - part.start
            sides = {
                f"{key}_{name}": rows[key].slice(part.start, count).combine_chunks()
                for key in _PAIRED
                for name, rows in zip("ab", kept, strict=True)
            }
            return {"fate": pyarrow.array(fates[part], pyarrow.string()), **sides}

        yield lambda: Rows(ids, columns)


def _keep(verdicts: SideVerdicts, file: Path) -> None:
    """Write the columns that stand beside each other as an Arrow file."""
    import pyarrow

    rows = verdict_rows(verdicts)
    fields = [pyarrow.field(name, kind) for name, kind in verdict_fields().items() if name in _PAIRED]
    schema = pyarrow.schema(fields)
    with pyarrow.ipc.new_file(str(file), schema) as sink:
        for begin in range(0, len(verdicts), _BATCH):
            columns = rows.columns(slice(begin, min(begin + _BATCH, len(verdicts))))
            sink.write_batch(pyarrow.record_batch([columns[name] for name in schema.names], schema=schema))
