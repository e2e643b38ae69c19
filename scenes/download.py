"""Download of one file over HTTP: resumed where it was interrupted, whole or not at all, checked by its SHA-256.

What has arrived is kept in ``NAME.part`` beside the target, with the server's entity tag in ``NAME.part.tag``, and the
next attempt asks for the rest. A server that cannot send parts, or whose file changed, sends the whole file again.
"""

from __future__ import annotations

import hashlib
import http.client
import os
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from urllib.parse import urlsplit

from ..core.errors import InputError, OutputError

__all__ = ["download", "file_checksum"]

_CHUNK = 1 << 20
_SECONDS = 60  # without any data


def download(url: str, target: Path, *, progress: Callable[[int, int], None] | None = None) -> str:
    """Download a file and return its SHA-256.

    Parameters
    ----------
    url : str
        ``https://`` or ``http://``.
    target : Path
        Replaced when the download is complete.
    progress : callable, optional
        Called with (bytes received, bytes in all); 0 where the server does not say how many.

    Raises
    ------
    InputError
        The address is wrong, the server refuses, or the connection ended early; what has arrived is kept.
    OutputError
        The file cannot be written.
    """
    if urlsplit(url).scheme not in ("http", "https"):
        raise InputError(f"{url}: only addresses that start with https:// or http:// can be downloaded")
    part, tag = target.with_name(target.name + ".part"), target.with_name(target.name + ".part.tag")
    request = urllib.request.Request(url, headers={"User-Agent": "roofbench"})  # noqa: S310 - the scheme is checked
    begun = part.stat().st_size if part.exists() and tag.exists() else 0
    if begun:
        request.add_header("Range", f"bytes={begun}-")
        request.add_header("If-Range", tag.read_text("utf-8"))
    try:
        with urllib.request.urlopen(request, timeout=_SECONDS) as answer:  # noqa: S310 - the scheme is checked
            resumed = answer.status == http.HTTPStatus.PARTIAL_CONTENT
            begun = begun if resumed else 0
            expected = begun + int(answer.headers.get("Content-Length") or 0)
            _keep_tag(tag, answer.headers.get("ETag"))
            received = _append(answer, part, begun, expected, progress)
    except urllib.error.HTTPError as error:
        if error.code == http.HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE:
            part.unlink(missing_ok=True)
            return download(url, target, progress=progress)
        raise InputError(f"{url}: the server answers {error.code} {error.reason}") from error
    except (urllib.error.URLError, http.client.HTTPException, TimeoutError, ConnectionError) as error:
        reason = getattr(error, "reason", None) or error
        raise InputError(f"{url} cannot be downloaded: {reason}; call again to continue") from error
    except OSError as error:
        raise OutputError(f"{target} cannot be written: {error.strerror or error}") from error
    if expected and received != expected:
        raise InputError(f"{url}: {received:,} of {expected:,} bytes arrived; call again to continue")
    os.replace(part, target)
    tag.unlink(missing_ok=True)
    return file_checksum(target)


def file_checksum(path: Path) -> str:
    """Return the SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _keep_tag(tag: Path, value: str | None) -> None:
    # A weak tag does not promise the same bytes, so a part cannot be continued by it.
    if value and not value.startswith("W/"):
        tag.write_text(value, "utf-8")
    else:
        tag.unlink(missing_ok=True)


def _append(
    answer: http.client.HTTPResponse,
    part: Path,
    begun: int,
    expected: int,
    progress: Callable[[int, int], None] | None,
) -> int:
    """Write what the server sends behind the first `begun` bytes; return the number of bytes of the file."""
    received = begun
    with part.open("ab" if begun else "wb") as file:
        while True:
            try:
                chunk = answer.read(_CHUNK)
            except http.client.IncompleteRead as error:
                chunk = error.partial
                file.write(chunk)
                return received + len(chunk)
            if not chunk:
                return received
            file.write(chunk)
            received += len(chunk)
            if progress is not None:
                progress(received, expected if expected > begun else 0)
