"""The whole benchmark on a tiny data set: for function, never for time."""
from __future__ import annotations

from pathlib import Path
import re
import sys

from benchmark import peers, quote
from benchmark.__main__ import main
from benchmark.scenes import rendered
import pytest

LARGEST = 2_000_000     # bytes of all figures


def test_one_command_writes_the_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every experiment has its section and its numbers, every picture is there."""
    monkeypatch.setenv('AMENT_PREFIX_PATH', sys.prefix)
    data, output = tmp_path / 'data', tmp_path / 'output'
    rendered.write(data, (120, 160), 2)
    assert main(['--data', str(data), '--sequence', str(data / 'wide'), '--output', str(output),
                 '--quick', '--figures-from-data']) == 0
    text = (output / 'RESULTS.md').read_text()
    for title in ('Conditions', 'Table 1', 'Table 2', 'Figures 3 and 4', 'Accuracy',
                  'What each step brings', 'Degraded copies', 'Robustness', 'Exactness',
                  'False alarms', 'The lens', 'Attitude', 'Repeatability', 'Tracks',
                  'Line features', 'Sameness', 'Speed', 'Growth', 'Cost of each stage', 'The node',
                  'Overhead of the node', 'Memory'):
        assert f'\n## {title}' in text
    assert f'| {peers.TITLES[peers.OURS]} | 0.' in quote.summary(text)
    pictures = re.findall(r'!\[.*\]\((.*)\)', text)
    assert len(pictures) == len(set(pictures)) == len(list((output / 'figures').iterdir()))
    assert sum((output / name).stat().st_size for name in pictures) < LARGEST
    assert len(list((output / 'photographs').iterdir())) == 3


def test_some_experiments_have_a_report_of_their_own(tmp_path: Path) -> None:
    """A partial report does not replace that of a run of all experiments."""
    (tmp_path / 'RESULTS.md').write_text('all')
    assert main(['--only', 'stages', '--quick', '--output', str(tmp_path)]) == 0
    assert (tmp_path / 'RESULTS.md').read_text() == 'all'
    assert '\n## Cost of each stage' in (tmp_path / 'partial.md').read_text()


@pytest.mark.parametrize(('arguments', 'message'), [
    (['--data', 'nowhere'], 'nowhere/manifest.json'), (['--sequence', 'nowhere'], 'nowhere'),
    (['--peer', 'nonsense'], "'nonsense' is not a detector")])
def test_what_cannot_be_used_is_named(arguments: list[str], message: str, tmp_path: Path,
                                      capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 2 and one line."""
    assert main([*arguments, '--quick', '--output', str(tmp_path)]) == 2
    assert message in capsys.readouterr().err


def test_another_detector_joins_in() -> None:
    """A function that returns rows x0 y0 x1 y1."""
    peer = peers.load('mine=numpy:zeros')
    assert peer.name == 'mine'
    assert [line.shape for line in peer.polylines([[0, 0, 5, 5]])] == [(2, 2)]
