"""The version is one everywhere, and script/release keeps it so, in a repository of its own."""
from __future__ import annotations

import os
from pathlib import Path
import re
import shutil
import subprocess

from catkin_pkg.changelog import get_changelog_from_path
from catkin_pkg.package import parse_package
import pytest
import yaml

ROOT = Path(__file__).parents[1]
FILES = ('package.xml', 'setup.py', 'CITATION.cff')
VERSION = '9.8.7'
DATE = '2031-02-03'
AUTHOR = {f'GIT_{who}_{what}': 'a@b.example' for who in ('AUTHOR', 'COMMITTER')
          for what in ('NAME', 'EMAIL')}


def stated(folder: Path) -> dict[str, str]:
    """Return the version that each file states."""
    return {
        'package.xml': parse_package(str(folder / 'package.xml')).version,
        'setup.py': re.search("version='(.*)'", (folder / 'setup.py').read_text())[1],
        'CITATION.cff': yaml.safe_load((folder / 'CITATION.cff').read_text())['version']}


class Repository:
    """A copy of what a release touches, as a git repository with a place to push to."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / 'work'
        (self.folder / 'script').mkdir(parents=True)
        for name in (*FILES, 'CHANGELOG.rst', 'script/release'):
            shutil.copy(ROOT / name, self.folder / name)
        self.write('CHANGELOG.rst', f'{VERSION} ({DATE})\n------------------\n* News.\n')
        self.tests(exit_code=0)
        self.git('init', '--quiet', '--initial-branch=main')
        self.git('init', '--quiet', '--bare', str(folder / 'origin'))
        self.git('remote', 'add', 'origin', str(folder / 'origin'))
        self.commit()

    def write(self, name: str, text: str) -> None:
        (self.folder / name).write_text(text)

    def tests(self, exit_code: int) -> None:
        """Let script/test end like this; a run of it leaves its mark outside of the tree."""
        file = self.folder / 'script' / 'test'
        file.write_text(f'#!/bin/sh\ntouch ../tested\nexit {exit_code}\n')
        file.chmod(0o755)

    def git(self, *arguments: str) -> str:
        return self.run('git', *arguments).stdout

    def commit(self) -> None:
        self.git('add', '--all')
        self.git('commit', '--quiet', '--message', 'state')

    def run(self, *command: str, code: int = 0) -> subprocess.CompletedProcess[str]:
        result = subprocess.run(command, cwd=self.folder, env=os.environ | AUTHOR, text=True,
                                capture_output=True)
        assert result.returncode == code, result.stdout + result.stderr
        return result

    def release(self, *arguments: str, code: int = 0) -> str:
        result = self.run('script/release', *arguments, code=code)
        return result.stdout + result.stderr

    @property
    def tested(self) -> bool:
        return (self.folder.parent / 'tested').exists()

    def unchanged(self) -> bool:
        """Tell whether there is no tag, no second commit and no change."""
        return (self.git('tag'), self.git('status', '--porcelain')) == ('', '') and (
            VERSION not in stated(self.folder).values())


@pytest.fixture
def repository(tmp_path: Path) -> Repository:
    """Return a repository that is ready for a release."""
    return Repository(tmp_path)


def test_the_version_is_one() -> None:
    """All files state the same, and the newest dated section of the changelog is about it."""
    version, = set(stated(ROOT).values())
    dated = {number: date for number, date, _ in get_changelog_from_path(
        str(ROOT / 'CHANGELOG.rst')).foreach_version() if number != 'forthcoming'}
    newest = max(dated, key=lambda number: [int(part) for part in number.split('.')])
    assert newest == version
    citation = yaml.safe_load((ROOT / 'CITATION.cff').read_text())
    assert str(citation['date-released']) == f'{dated[newest]:%Y-%m-%d}'


def test_a_release_is_committed_and_tagged_and_not_pushed(repository: Repository) -> None:
    said = repository.release(VERSION)
    assert repository.tested
    assert set(stated(repository.folder).values()) == {VERSION}
    assert f'date-released: {DATE}' in (repository.folder / 'CITATION.cff').read_text()
    assert repository.git('status', '--porcelain') == ''
    assert repository.git('describe', '--exact-match').strip() == VERSION
    assert repository.git('diff', '--name-only', 'HEAD~').split() == sorted(FILES)
    assert repository.git('ls-remote', 'origin') == ''
    assert f'git push origin main {VERSION}' in said


def test_a_version_that_is_set_already_is_tagged(repository: Repository) -> None:
    repository.release(VERSION)
    repository.git('tag', '--delete', VERSION)
    head = repository.git('rev-parse', 'HEAD')
    repository.release(VERSION, '--skip-tests')
    assert repository.git('rev-parse', f'{VERSION}^{{commit}}') == head


def test_tests_can_be_left_out(repository: Repository) -> None:
    repository.release('--skip-tests', VERSION)
    assert not repository.tested and repository.git('tag').strip() == VERSION


def test_a_dry_run_changes_nothing(repository: Repository) -> None:
    said = repository.release(VERSION, '--dry-run')
    assert VERSION in said and DATE in said
    assert repository.unchanged() and not repository.tested


def test_failing_tests_leave_everything_as_it_was(repository: Repository) -> None:
    repository.tests(exit_code=1)
    repository.commit()
    assert 'tests fail' in repository.release(VERSION, code=1)
    assert repository.tested and repository.unchanged()


@pytest.mark.parametrize('arguments, said', [
    ([], 'usage'), (['1.2'], "'1.2'"), (['v9.8.7'], "'v9.8.7'"), ([VERSION, '--force'], '--force'),
    (['9.8.8'], 'CHANGELOG.rst has no section')])
def test_refused_arguments(repository: Repository, arguments: list[str], said: str) -> None:
    assert said in repository.release(*arguments, code=1)
    assert repository.unchanged()


def test_uncommitted_changes_are_refused(repository: Repository) -> None:
    repository.write('new.txt', '')
    assert 'new.txt' in repository.release(VERSION, code=1)


def test_another_branch_is_refused(repository: Repository) -> None:
    repository.git('switch', '--quiet', '--create', 'idea')
    assert 'idea' in repository.release(VERSION, code=1)


def test_a_tag_that_exists_is_refused(repository: Repository) -> None:
    repository.git('tag', VERSION)
    assert 'exists' in repository.release(VERSION, code=1)


def test_a_file_without_a_version_is_named(repository: Repository) -> None:
    repository.write('setup.py', '')
    repository.commit()
    assert 'setup.py' in repository.release(VERSION, code=1)
    assert repository.git('tag') == ''
