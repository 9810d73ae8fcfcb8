"""What can be wrong with a frame."""
from __future__ import annotations


class FrameError(ValueError):
    """A frame that cannot be worked on; ``reason`` is a short phrase to count it by."""

    def __init__(self, reason: str, text: str) -> None:
        super().__init__(text)
        self.reason = reason
