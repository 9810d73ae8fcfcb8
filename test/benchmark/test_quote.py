"""What the README quotes is read off the report."""
from __future__ import annotations

from benchmark import quote
import pytest

REPORT = """# Benchmark

## Table 2: running time

| image | lens |
| --- | ---: |
| (a) | wide |

| detector | mean ms | over ours | least over ours |
| --- | ---: | ---: | ---: |
| LSD | 20.0 | 4.00 | 3.1 |
| qflsd_ros | 5.00 | 1.00 | 1.00 |

## Accuracy on 7 annotated images

| detector | level | F | F1 | whole | curved whole | fragments | rms |
| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |
| LSD | a | 0.600 | 0.5 | 0.4 | - | 2.00 | 0.8 |
| qflsd_ros | a | 0.700 | 0.6 | 0.5 | - | 1.00 | 0.7 |
| LSD | b | 0.500 | 0.5 | 0.2 | 0.1 | 2.50 | 0.9 |
| qflsd_ros | b | 0.800 | 0.6 | 0.7 | 0.9 | 1.20 | 0.7 |

| detector | P | R |
| --- | ---: | ---: |
| LSD | 1.0 | 1.0 |

## Speed

| detector | ms |
| --- | ---: |
| LSD | 1.0 |
"""


def test_figures_are_means_over_levels() -> None:
    """Missing ones are left out of the mean, other tables are left alone."""
    sentence, _, *table = quote.summary(REPORT).splitlines()
    assert sentence.startswith('Accuracy on 7 annotated images, means over 2 levels')
    assert table[2:] == [
        '| LSD | 0.550 | 0.500 | 0.300 | 0.100 | 2.250 | 0.850 | 4.00 |',
        '| qflsd_ros | 0.750 | 0.600 | 0.600 | 0.900 | 1.100 | 0.700 | 1.00 |']


def test_only_what_is_between_the_marks_changes() -> None:
    """What was quoted before is gone."""
    readme = f'before\n{quote.BEGIN}old\n{quote.END}after\n'
    assert quote.renewed(readme, REPORT) == (
        f'before\n{quote.BEGIN}{quote.summary(REPORT)}\n{quote.END}after\n')
    with pytest.raises(ValueError, match='lacks the marks'):
        quote.renewed('nothing', REPORT)


def test_the_readme_quotes_the_report() -> None:
    """As long as there is a report."""
    readme = quote.README.read_text()
    if quote.RESULTS.is_file():
        assert readme == quote.renewed(readme, quote.RESULTS.read_text())
    else:
        assert quote.BEGIN + quote.END in readme
