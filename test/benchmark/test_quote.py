"""Quotations in documents come from the report."""
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

## The lens

Of single frames.

| lambda | told |
| --- | ---: |
| -0.5 | 3 |

## Overhead of the node

| what | ms |
| --- | ---: |
| all of it | 0.30 |

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


def test_a_section_ends_where_the_next_one_begins() -> None:
    """Its text has neither its own title nor the next section."""
    assert quote.body(REPORT, 'The lens') == (
        'Of single frames.\n\n| lambda | told |\n| --- | ---: |\n| -0.5 | 3 |')
    with pytest.raises(ValueError, match="no section 'Nothing'"):
        quote.body(REPORT, 'Nothing')


def test_only_the_text_between_the_marks_changes() -> None:
    """The old quotation is gone; other marks keep theirs."""
    other = '<!-- other -->\nkept\n<!-- end of other -->\n'
    text = f'before\n{other}<!-- mark -->\nold\n<!-- end of mark -->\nafter\n'
    assert quote.renewed(text, 'mark', 'new') == (
        f'before\n{other}<!-- mark -->\nnew\n<!-- end of mark -->\nafter\n')
    with pytest.raises(ValueError, match='must have these marks once'):
        quote.renewed('nothing', 'mark', 'new')


def test_the_readme_quotes_the_report() -> None:
    """The table in the README is that of the report in the repository."""
    readme, report = quote.README.read_text(), quote.RESULTS.read_text()
    assert readme == quote.renewed(readme, quote.MEASURED, quote.summary(report))
