"""The detector reports its stages; the clock gives each a share of the time."""
from __future__ import annotations

from benchmark.experiments import stages
from benchmark.scenes.rendered import room
import pytest


def test_every_stage_has_a_time() -> None:
    """In the order in which they run; with one round the stages add up to the whole."""
    costs = stages.costs(room(0, -0.25, (120, 160)).gray, 1)
    total = costs.pop(stages.TOTAL)
    assert sum(costs.values()) == pytest.approx(total)
    assert list(costs)[:6] == ['noise', 'gradients', 'edges', 'chains', 'extraction', 'joining']
    assert min(costs.values()) >= 0


def test_the_clock_counts_a_stage_that_runs_twice() -> None:
    """The times of stages with one name add up."""
    clock = stages.Clock()
    for name in 'ab', 'cd', 'ab':
        clock(name)
    assert list(clock.ms) == ['ab', 'cd']
