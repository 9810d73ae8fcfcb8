"""The stages are found by themselves, and the detector is left as it was."""
from __future__ import annotations

from benchmark.experiments import stages
from benchmark.experiments.rendered import room
from qflsd_ros.core import Detector


def test_stages_are_found_and_add_up() -> None:
    """Every stage that ran has a time; together they are the whole."""
    before = [getattr(*place) for place in stages.places(Detector)]
    costs = stages.costs(room(0, -0.25, (120, 160)).gray, 1)
    total = costs.pop(stages.TOTAL)
    assert abs(sum(costs.values()) - total) < 1e-9
    assert {name.partition('.')[0] for name in costs} >= {'edges', 'chains', 'extraction',
                                                          'joining', 'cv2'}
    assert [getattr(*place) for place in stages.places(Detector)] == before
