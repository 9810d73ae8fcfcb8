"""Parameters: what they take, and what they say to what they do not take."""
from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from qflsd_ros.core import Parameters

FIELDS = dataclasses.fields(Parameters)
NUMBERS = [field for field in FIELDS if field.metadata['low'] is not None]
FLOATS = [field for field in FIELDS if isinstance(field.default, float)]
each_number = pytest.mark.parametrize('field', NUMBERS, ids=lambda field: field.name)
each_float = pytest.mark.parametrize('field', FLOATS, ids=lambda field: field.name)
each_field = pytest.mark.parametrize('field', FIELDS, ids=lambda field: field.name)


@each_number
def test_default_in_range(field):
    assert field.metadata['low'] <= field.default <= field.metadata['high']


@each_field
def test_each_says_what_it_means(field):
    assert field.metadata['description'].endswith('.')
    assert field.metadata['low'] is not None or field.metadata['choices']


def test_defaults_are_those_of_the_fields():
    for field in FIELDS:
        assert getattr(Parameters(), field.name) == field.default


@each_number
@pytest.mark.parametrize('bound', ['low', 'high'])
def test_bounds_are_in_range(field, bound):
    value = type(field.default)(field.metadata[bound])
    if field.name == 'contrast_low' and bound == 'high':
        assert Parameters(contrast_low=value, contrast_high=value).contrast_low == value
    elif field.name == 'contrast_high' and bound == 'low':
        assert Parameters(contrast_low=value, contrast_high=value).contrast_high == value
    else:
        assert getattr(Parameters(**{field.name: value}), field.name) == value


@each_number
@pytest.mark.parametrize(('bound', 'beyond'), [('low', -1), ('high', 1)])
def test_out_of_range(field, bound, beyond):
    value = type(field.default)(field.metadata[bound]) + beyond
    with pytest.raises(ValueError) as caught:
        Parameters(**{field.name: value})
    for part in (field.name, value, field.metadata['low'], field.metadata['high'],
                 field.metadata['unit']):
        assert str(part) in str(caught.value)


@each_field
@pytest.mark.parametrize('value', [None, [1.0], b'1', 1j, True])
def test_wrong_type(field, value):
    with pytest.raises(TypeError) as caught:
        Parameters(**{field.name: value})
    for part in (field.name, repr(value), type(value).__name__, type(field.default).__name__):
        assert part in str(caught.value)


@each_number
def test_text_is_no_number(field):
    with pytest.raises(TypeError, match=f"{field.name} is '1'"):
        Parameters(**{field.name: '1'})


@each_float
@pytest.mark.parametrize('value', [math.nan, math.inf, -math.inf])
def test_not_finite(field, value):
    with pytest.raises(ValueError, match=f'{field.name} is {value}'):
        Parameters(**{field.name: value})


@pytest.mark.parametrize(('name', 'value'), [
    ('tolerance', 1), ('min_length', 20), ('max_gap', 0), ('contrast_low', 1),
    ('paper_epsilon', 700)])
def test_integer_for_float(name, value):
    taken = getattr(Parameters(**{name: value}), name)
    assert (taken, type(taken)) == (value, float)


@pytest.mark.parametrize('field', [field for field in FIELDS if isinstance(field.default, int)],
                         ids=lambda field: field.name)
def test_float_for_integer(field):
    with pytest.raises(TypeError, match=field.name):
        Parameters(**{field.name: float(field.default)})


@pytest.mark.parametrize(('name', 'value'), [
    ('tolerance', np.float64(0.5)), ('tolerance', np.float32(0.5)), ('tolerance', np.int16(2)),
    ('paper_seed', np.uint8(7)), ('paper_seed', np.int64(7)), ('method', np.str_('paper'))])
def test_scalars_of_numpy(name, value):
    taken = getattr(Parameters(**{name: value}), name)
    assert taken == value and type(taken) in (int, float, str)


@pytest.mark.parametrize('value', [np.True_, np.complex64(1), np.datetime64('2020'), np.ones(1)])
def test_other_things_of_numpy_are_no_numbers(value):
    with pytest.raises(TypeError, match='tolerance is .* must be of type float'):
        Parameters(tolerance=value)


@each_number
@pytest.mark.parametrize('value', [10**400, -10**400, 10**9000], ids=['large', 'low', 'longest'])
def test_integers_beyond_all_bounds(field, value):
    with pytest.raises(ValueError, match=f'{field.name} is an integer of .* bits: must lie in'):
        Parameters(**{field.name: value})


@pytest.mark.parametrize('method', ['', 'Arcs', 'lsd'])
def test_unknown_choice(method):
    with pytest.raises(ValueError, match=f'method is {method!r}: must be one of arcs, paper'):
        Parameters(method=method)


def test_low_above_high_names_both():
    with pytest.raises(ValueError) as caught:
        Parameters(contrast_low=30.0, contrast_high=20.0)
    for part in ('contrast_low', '30.0', 'contrast_high', '20.0'):
        assert part in str(caught.value)


def test_low_equal_to_high():
    assert Parameters(contrast_low=20.0, contrast_high=20.0).contrast_low == 20


def test_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError):
        Parameters().tolerance = 1.0


def test_replacing_checks_too():
    with pytest.raises(ValueError, match='tolerance'):
        dataclasses.replace(Parameters(), tolerance=-1.0)
    assert dataclasses.replace(Parameters(), tolerance=1.0) == Parameters(tolerance=1.0)


def test_equal_and_hashable():
    assert Parameters(min_length=20) == Parameters(min_length=20.0) != Parameters()
    assert len({Parameters(), Parameters(), Parameters(min_length=20)}) == 2
