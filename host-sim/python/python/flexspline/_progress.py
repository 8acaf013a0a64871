"""How far a run is: a bar of tqdm where it is installed, else a line, and only where somebody looks."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

Progress = bool | Callable[[int, int, str], object] | None
"""``None``: shown on a terminal and in a notebook. ``True``, ``False``: always, never. Or a function of (done, total, note)."""

Teller = Callable[[int, int, str], object]

_PATIENCE_S = 1.0
"""Work shorter than this shows nothing."""


def _somebody_looks() -> bool:
    return sys.stderr.isatty() or "ipykernel" in sys.modules


@contextmanager
def shown(progress: Progress, title: str) -> Iterator[Teller | None]:
    """What is told how far a run called ``title`` is."""
    if callable(progress):
        yield progress
    elif progress is False or (progress is None and not _somebody_looks()):
        yield None
    else:
        shower = _Shower(title)
        try:
            yield shower.tell
        finally:
            shower.close()


class _Shower:
    def __init__(self, title: str) -> None:
        self.title = title
        self.begun = time.monotonic()
        self.bar: Any = None
        self.width = 0

    def tell(self, done: int, total: int, note: str) -> None:
        if time.monotonic() - self.begun < _PATIENCE_S:
            return
        try:
            from tqdm import tqdm
        except ImportError:
            line = f"{self.title} {done}/{total}  {note}"
            print(f"\r{line:<{self.width}}", end="", file=sys.stderr, flush=True)
            self.width = len(line)
            return
        if self.bar is None:
            self.bar = tqdm(desc=self.title, total=total, leave=False, file=sys.stderr)
        self.bar.total, self.bar.n = total, done
        self.bar.set_postfix_str(note, refresh=True)

    def close(self) -> None:
        if self.bar is not None:
            self.bar.close()
        elif self.width:
            print(f"\r{'':<{self.width}}\r", end="", file=sys.stderr, flush=True)
