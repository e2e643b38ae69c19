"""Reading ahead: the window of the next tile is read in a thread while the present one is computed."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Callable

from ...scenes.scene import Scene

__all__ = ["ReadAhead"]


class ReadAhead:
    """At most one window that nobody has taken yet."""

    def __init__(self) -> None:
        self._key = ""
        self._thread: threading.Thread | None = None
        self._window: Scene | None = None

    def start(self, key: str, read: Callable[[], Scene]) -> None:
        """Begin to read a window; `read` returns it with its layers loaded."""
        from rasterio.errors import NotGeoreferencedWarning

        self.take("")
        # Filters belong to the process: a block of one thread that ignores this warning can end inside that of another.
        warnings.filterwarnings("ignore", category=NotGeoreferencedWarning)

        def work() -> None:
            try:
                self._window = read()
            except Exception:
                # Whoever needs the window reads it again, and reports what is wrong.
                self._window = None

        self._key = key
        self._thread = threading.Thread(target=work, name="roofbench-read-ahead", daemon=True)
        self._thread.start()

    def take(self, key: str) -> Scene | None:
        """Return the window of this key when it was read; any other is released."""
        if self._thread is not None:
            self._thread.join()
        window, matches = self._window, self._key == key
        self._key, self._thread, self._window = "", None, None
        return window if matches else None
