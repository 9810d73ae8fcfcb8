"""What a score says of noise: it orders accidents, and those with the default's are few."""
from __future__ import annotations

from finding import find
import numpy as np
import pytest
from qflsd_ros.core import Parameters

IMAGES = 12


@pytest.mark.parametrize('level', [3.0, 10.0, 30.0])
def test_white_noise_has_few_arcs_and_fewer_the_higher_their_score(level):
    scores = np.concatenate([
        find(np.clip(np.round(np.random.default_rng(seed).normal(128, level, (480, 640))), 0, 255)
             .astype(np.uint8), min_score=-1.0).table['score'] for seed in range(IMAGES)])
    counts = [np.count_nonzero(scores >= least) / IMAGES
              for least in (0.0, 2.0, Parameters().min_score)]
    assert counts[0] > 0.5, 'too few to count'
    assert counts[1] < counts[0] / 2
    assert counts[2] <= 0.5
