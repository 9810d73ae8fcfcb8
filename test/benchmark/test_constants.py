"""Constants are read from the sources of the core with their meaning and origin."""
from __future__ import annotations

from pathlib import Path

from benchmark.constants import constants, constants_of, note
import qflsd_ros

SOURCE = """
A = 2.5         # px
# All of these are chosen,
# not tuned.
# The first
# of several.
B, C = 1.5, math.sin(0.1)  # grey levels
FIRST, SECOND = 0, 1

# Columns of a row.
X = 0
SIZE = 6        # px

TABLE = np.dtype([])
small = 3
D: dict[int, float] = {1: 4.0}
E = A * math.sqrt(math.pi)
"""


def test_constants_are_read_with_their_comments() -> None:
    """Numbers of columns, arrays and names in small letters are left out."""
    assert [constant[1:] for constant in constants_of(SOURCE, 'module')] == [
        ('A', '2.5', 'px', 2),
        ('B', '1.5', 'The first of several. grey levels', 7),
        ('C', 'math.sin(0.1)', 'The first of several. grey levels', 7),
        ('D', '{1: 4.0}', '', 16), ('E', 'A * math.sqrt(math.pi)', '', 17)]


def test_the_origin_of_all_constants_of_a_module() -> None:
    """One sentence may state it for all."""
    assert note(SOURCE) == 'All of these are chosen, not tuned.'
    assert note('A = 1.5') == ''


def test_every_constant_of_the_core_is_explained() -> None:
    """A comment stands beside or above each; all parts of the core have constants."""
    found = constants()
    assert [constant.title for constant in found if not constant.comment] == []
    assert {'attitude', 'detection', 'geometry', 'lens', 'tracking'} <= {
        constant.module.split('.')[-2] for constant in found}


def test_every_number_outside_the_core_is_explained() -> None:
    """A comment stands beside or above it, or the module states the origin of all of its own."""
    package = Path(qflsd_ros.__file__).parent
    found = [constant for file in sorted(package.rglob('*.py'))
             for constant in constants_of(file.read_text(), file.relative_to(package).as_posix())]
    assert len({constant.module for constant in found}) > 60
    assert [constant.title for constant in found if not constant.comment] == []
