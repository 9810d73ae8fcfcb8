"""
The detector's parameters: the only place where they are defined.

ROS descriptors, command-line flags and ``config/detector.yaml`` are made from this dataclass.
"""
from __future__ import annotations

import dataclasses
from dataclasses import dataclass
import math
from typing import Any

import numpy as np

METHODS = ('arcs', 'paper')
LONGEST = 64        # bits of an integer that is worth printing


def parameter(default: Any, description: str, unit: str = '',
              low: float | None = None, high: float | None = None,
              choices: tuple[str, ...] = (), read_only: bool = False) -> Any:
    """
    Declare a dataclass field that knows what it means and which values it takes.

    Numbers lie in ``low`` to ``high`` (both included), strings are one of ``choices``;
    what is ``read_only`` can be set at start alone.
    """
    return dataclasses.field(default=default, metadata={
        'description': description, 'unit': unit, 'low': low, 'high': high, 'choices': choices,
        'read_only': read_only})


def check(owner: Any) -> None:
    """
    Check every field of a dataclass made of :func:`parameter` fields, converting int to float.

    Scalars of numpy become those of Python.  Raises ``TypeError`` for a value of another type than
    the default's and ``ValueError`` for one out of range; both name the field, the value and what
    would be right.
    """
    for field in dataclasses.fields(owner):
        value = _of_type(field, getattr(owner, field.name))
        object.__setattr__(owner, field.name, value)
        choices, low, high = (field.metadata[key] for key in ('choices', 'low', 'high'))
        if choices and value not in choices:
            raise ValueError(f'{field.name} is {value!r}: must be one of {", ".join(choices)}')
        if low is not None and not low <= value <= high:
            unit = f' {field.metadata["unit"]}' if field.metadata['unit'] else ''
            raise ValueError(f'{field.name} is {value}: must lie in {low} to {high}{unit}')


def meant(field: dataclasses.Field[Any], value: Any) -> Any:
    """Return a value as the type of its field, where one of another type says the same."""
    if isinstance(value, np.generic):
        value = value.item()
    if type(value) is int and isinstance(field.default, float) and value.bit_length() <= LONGEST:
        return float(value)
    if value is False and field.metadata['choices'] and 'off' in field.metadata['choices']:
        return 'off'    # which YAML reads as a truth value
    return value


def _of_type(field: dataclasses.Field[Any], value: Any) -> Any:
    wanted, value = type(field.default), meant(field, value)
    if type(value) is int and wanted in (int, float) and value.bit_length() > LONGEST:
        raise ValueError(f'{field.name} is an integer of {value.bit_length()} bits: must lie '
                         f'in {field.metadata["low"]} to {field.metadata["high"]}')
    if type(value) is not wanted:
        raise TypeError(f'{field.name} is {value!r}, of type {type(value).__name__}: '
                        f'must be of type {wanted.__name__}')
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f'{field.name} is {value}: must be finite')
    return value


@dataclass(frozen=True)
class Parameters:
    """
    What a user can set of the detector.

    Every field carries its unit, range and one sentence in ``dataclasses.fields(...).metadata``.

    Raises
    ------
    ValueError
        A value is out of its range, or two values contradict each other.
    TypeError
        A value has another type than its default.

    """

    method: str = parameter(
        'arcs', 'Algorithm: arcs (this package) or paper (Algorithms 1 to 3 as printed, slow).',
        choices=METHODS)
    blur_sigma: float = parameter(
        0.7, 'Least standard deviation of the blur before the gradients; noise adds to it.',
        'px', 0.0, 5.0)
    contrast_high: float = parameter(
        6.5, 'Step across an edge from which on it starts a contour; less in an image of low '
        'contrast, more in a noisy one.', 'grey levels', 1.0, 255.0)
    contrast_low: float = parameter(
        2.3, 'Step across an edge down to which a contour that has started goes on; in proportion '
        'to contrast_high.', 'grey levels', 0.5, 255.0)
    tolerance: float = parameter(
        0.7, 'Largest rms distance of the edge pixels of an arc from it, and largest distance of '
        'each from the arc with which they are sought; single ones lie farther off in the end.',
        'px', 0.1, 10.0)
    min_length: float = parameter(
        15.0, 'Shortest arc reported; the others are the same whatever it is.',
        'px', 3.0, 10000.0)
    min_radius: float = parameter(
        0.3, 'Smallest radius of an arc; a division model has none below 1 / sqrt(-lambda).',
        'of half the image diagonal', 0.01, 100.0)
    min_score: float = parameter(
        4.0, 'Least score of an arc: -log10 of the number of false alarms, were its points '
        'independent; pure noise has some more. A larger one leaves only surer arcs.',
        '', -1000.0, 1000.0)
    min_distance: float = parameter(
        2.4, 'Of parallel arcs of the same polarity closer than this the longest is reported, of '
        'opposite polarity closer than half of this; no faint one a little farther beside it; 0 '
        'reports all.', 'px', 0.0, 100.0)
    max_gap: float = parameter(
        60.0, 'Longest gap between two pieces of one arc; with 0 nothing is joined.',
        'px', 0.0, 1000.0)
    paper_epsilon: float = parameter(
        500.0, 'Method paper only: bound epsilon on the algebraic error E of equation (10).',
        'px^2', 0.001, 1000000.0)
    paper_min_contour: float = parameter(
        0.05, 'Method paper only: shortest contour, as a share of the image size (Step 1).',
        'of the mean of width and height', 0.0, 1.0)
    paper_confidence: float = parameter(
        0.99, 'Method paper only: probability of finding the longest segment, 1 - P^K of (12).',
        '', 0.5, 0.9999)
    paper_max_hypotheses: int = parameter(
        2000, 'Method paper only: most hypotheses on one contour, whatever (12) asks for.',
        '', 1, 1000000)
    paper_seed: int = parameter(
        0, 'Method paper only: seed of its random triples.', '', 0, 2147483647)

    def __post_init__(self) -> None:
        """Check types, ranges and consistency."""
        check(self)
        if self.contrast_low > self.contrast_high:
            raise ValueError(f'contrast_low is {self.contrast_low}: must not exceed '
                             f'contrast_high, which is {self.contrast_high} grey levels')
