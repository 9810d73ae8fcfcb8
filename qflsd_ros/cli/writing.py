"""Files that are whole or not there."""
from __future__ import annotations

import os
from pathlib import Path


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that nobody ever sees half of it; OSError where that fails."""
    partial = path.with_name(f'.{os.getpid()}.part')  # short: the name itself may be the longest
    try:
        partial.write_bytes(content)
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
