"""Reasons of bad frames: one list, and no frame is rejected for any other."""
from __future__ import annotations

from pathlib import Path
import re

import pytest
from qflsd_ros.sources.frames import FrameError, MAX_TEXT
from qflsd_ros.sources.reasons import markdown_table, Reason

ROOT = Path(__file__).parents[2]
CODE = '\n'.join(path.read_text() for path in (ROOT / 'qflsd_ros').rglob('*.py'))


@pytest.mark.parametrize('reason', Reason)
def test_every_reason_is_given_somewhere_and_listed(reason: Reason) -> None:
    assert len(re.findall(rf'\bReason\.{reason.name}\b', CODE)) >= 1
    assert f'| `{reason.phrase}` | {reason.meaning} |' in markdown_table()
    assert f'`{reason.phrase}`' in (ROOT / 'doc' / 'troubleshooting.md').read_text()


def test_no_frame_is_rejected_for_a_reason_of_its_own() -> None:
    """Whoever raises an error of a frame takes the reason from the list."""
    kinds = re.findall(r'^class (\w+)\(FrameError\)', CODE, re.MULTILINE)
    assert len(kinds) >= 5
    raised = re.findall(rf'(?<!class )\b(?:{"|".join(kinds)}|FrameError)\(\s*([^\s,)]+)', CODE)
    assert len(raised) >= 10
    assert all(first.startswith('Reason.') for first in raised), raised


def test_a_line_of_a_log_stays_a_line() -> None:
    """Its beginning and its end are kept: what is wrong, and what would be right."""
    text = str(FrameError(Reason.NO_IMAGE, f'format {"x" * 1000000}: must be png'))
    assert len(text) <= MAX_TEXT
    assert text.startswith('format xxx') and text.endswith('x: must be png')
    assert '[998' in text and 'characters]' in text
    assert str(FrameError(Reason.NO_IMAGE, 'short')) == 'short'
