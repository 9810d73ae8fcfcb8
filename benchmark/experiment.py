"""The input of every experiment."""
from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from benchmark.datasets import Dataset


@dataclass(frozen=True)
class Effort:
    """How much is measured: more takes longer, and the figures scatter less."""

    shape: tuple[int, int] = (480, 640)     # of rendered scenes
    per_lens: int = 8                       # images of each kind of lens, in tables and plates
    per_level: int = 1000                   # images of each level, in the table of accuracies
    rounds: int = 15                        # runs of which the median is taken
    latencies: int = 40                     # frames sent to the node, for each size and encoding
    viewpoints: int = 3                     # of the room, under each condition
    every: int = 1                          # step between the points of a curve that are measured
    frames: int = 30                        # of a sequence
    endurance: int = 10_000                 # frames over which memory is watched


QUICK = Effort((240, 320), 3, 1, 3, 5, 1, 4, 4, 100)


@dataclass(frozen=True)
class Experiment:
    """
    The data, the detectors, and the output folder.

    Attributes
    ----------
    dataset
        The images with annotated lines to measure on.
    rendered
        Rendered images, which the report may show; photographs may have any licence.
    sequences
        Folders of frames, for repeatability.
    attitudes
        Folder of photographs with true attitudes, None without one.
    peers
        Names for :func:`benchmark.peers.load`, without the published method.
    output
        Folder of the report.
    effort
        How much is measured.
    photographs
        Whether plates of the data set are drawn, too.

    """

    dataset: Dataset
    rendered: Dataset
    sequences: tuple[Path, ...]
    attitudes: Path | None
    peers: tuple[str, ...]
    output: Path
    effort: Effort
    photographs: bool

    @property
    def figures(self) -> Path:
        """Folder of the figures."""
        return self.output / 'figures'
