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
    Declare a dataclass field with its description, unit and allowed values as metadata.

    Numbers lie in ``low`` to ``high`` (both included), strings are one of ``choices``.  A
    ``read_only`` parameter can be set at start only.
    """
    return dataclasses.field(default=default, metadata={
        'description': description, 'unit': unit, 'low': low, 'high': high, 'choices': choices,
        'read_only': read_only})


def check(owner: Any) -> None:
    """
    Check every field of a dataclass made of :func:`parameter` fields, converting int to float.

    Scalars of numpy become those of Python.  Raises ``TypeError`` for a value of another type than
    the default's and ``ValueError`` for one out of range; both name the field, the value and the
    allowed type or range.
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
    """
    Return a value converted to the type of its field, if that does not change its meaning.

    Raises
    ------
    TypeError
        The value has another type.
    ValueError
        It is an integer that no field can hold, or not finite.

    """
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
    The parameters of the detector.

    Each field has its description, unit and range in ``dataclasses.fields(...).metadata``.

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
        0.7, 'Standard deviation of the Gaussian blur before the gradients; noise increases it.',
        'px', 0.0, 5.0)
    contrast_high: float = parameter(
        6.5, 'Upper threshold (Canny): each contour has an edge pixel across which the grey level '
        'changes by at least this. Low contrast of the image lowers it, noise raises it.',
        'grey levels', 1.0, 255.0)
    contrast_low: float = parameter(
        2.3, 'Lower threshold (Canny): the grey level changes by at least this across each edge '
        'pixel. Contrast and noise scale it by the same factor as contrast_high.',
        'grey levels', 0.5, 255.0)
    tolerance: float = parameter(
        0.7, 'Largest rms distance of edge points from their arc. During the search it also '
        'limits the distance of each point; after the final fit a point may lie farther away.',
        'px', 0.1, 10.0)
    min_length: float = parameter(
        15.0, 'Length of the shortest arc that is reported. It does not affect longer arcs.',
        'px', 3.0, 10000.0)
    min_radius: float = parameter(
        0.3, 'Smallest radius of an arc. Under the division model images of straight edges have a '
        'radius of at least 1 / sqrt(-lambda).',
        'of half the image diagonal', 0.01, 100.0)
    min_score: float = parameter(
        4.0, 'Least score of an arc: -log10 of the expected number of false alarms in an image of '
        'pure noise with independent points; in fact there are some more. A larger value keeps '
        'only more certain arcs.',
        '', -1000.0, 1000.0)
    min_distance: float = parameter(
        2.4, 'Suppression keeps the longest of parallel arcs closer than this. The limit is half '
        'as large for opposite polarities, and 1.5 times as large for a faint arc beside a '
        'strong one. 0 keeps all arcs.', 'px', 0.0, 100.0)
    max_gap: float = parameter(
        60.0, 'Longest gap over which two pieces are joined to one arc; 0 disables joining.',
        'px', 0.0, 1000.0)
    image_circle: str = parameter(
        'auto', 'Image circle of a fisheye: auto (found in each image that has a round rim about '
        'its centre and a uniform outside; no arc is detected at the rim and outside of it) or '
        'off. Method paper ignores it.',
        choices=('auto', 'off'))
    detect_every: int = parameter(
        1, 'Tracking only: one of so many images is searched for arcs; in those between, lines '
        'that are followed already are measured alone, which takes a fraction of the time. Lines '
        'that come into sight are found with the next search.',
        'images', 1, 100)
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
        2000, 'Method paper only: largest number of hypotheses on one contour, a bound of K in '
        '(12).',
        '', 1, 1000000)
    paper_seed: int = parameter(
        0, 'Method paper only: seed of its random triples.', '', 0, 2147483647)

    def __post_init__(self) -> None:
        """Check types, ranges and consistency."""
        check(self)
        if self.contrast_low > self.contrast_high:
            raise ValueError(f'contrast_low is {self.contrast_low}: must not exceed '
                             f'contrast_high, which is {self.contrast_high} grey levels')
