"""Workflows, issue forms and hooks: well-formed, and about files, extras and tests that exist."""
from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import re
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[1]
WORKFLOWS = sorted((ROOT / '.github' / 'workflows').glob('*.yml'))
FORMS = [ROOT / '.github' / 'ISSUE_TEMPLATE' / name for name in ('bug.yml', 'feature.yml')]
HOOKS = ROOT / '.pre-commit-config.yaml'
FOLDERS = 'benchmark|config|doc|examples|launch|qflsd_ros|script|test'
SETUP = (ROOT / 'setup.py').read_text()


def load(file: Path) -> dict[Any, Any]:
    """Return what a YAML file holds."""
    return yaml.safe_load(file.read_text())


def jobs() -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield all jobs of all workflows by their names."""
    for file in WORKFLOWS:
        yield from load(file)['jobs'].items()


def commands(job: dict[str, Any]) -> str:
    """Return all that a job runs."""
    return '\n'.join(step.get('run', '') for step in job['steps'])


def paths(text: str) -> set[str]:
    """Return the paths of this repository that a text names."""
    text = text.replace('src/qflsd_ros/', '')
    return set(re.findall(rf'(?<![\w/.-])(?:{FOLDERS})/[\w./-]*\w', text))


JOBS = dict(jobs())


@pytest.mark.parametrize('name', JOBS)
def test_steps_are_well_formed(name: str) -> None:
    """Each step either uses an action of a fixed version or runs a command."""
    job = JOBS[name]
    assert job['runs-on'] and job['steps']
    for step in job['steps']:
        assert ('uses' in step) != ('run' in step)
        assert re.fullmatch(r'[\w/-]+@v\d+', step.get('uses', 'none@v0'))
        assert set(step) <= {'name', 'uses', 'run', 'with'}


@pytest.mark.parametrize('name', JOBS)
def test_matrix_values_are_declared(name: str) -> None:
    text = yaml.safe_dump(JOBS[name])
    declared = JOBS[name].get('strategy', {}).get('matrix', {})
    assert set(re.findall(r'matrix\.(\w+)', text)) == set(declared) - {'exclude'}


@pytest.mark.parametrize('name', JOBS)
def test_paths_and_extras_exist(name: str) -> None:
    text = commands(JOBS[name])
    for path in paths(text):
        assert (ROOT / path).exists(), path
    for extras in re.findall(r'\.\[([\w,-]+)\]', text):
        for extra in extras.split(','):
            assert f"'{extra}': [" in SETUP
    for file in re.findall(r'\w+\.launch\.py', text):
        assert (ROOT / 'launch' / file).is_file()
    for marker in re.findall(r'script/test -m (\w+)', text):
        assert f'    {marker}\n' in (ROOT / 'setup.cfg').read_text()


def test_versions_are_those_that_are_promised() -> None:
    """Both ends of what setup.py accepts of Python, numpy 1 and 2, the container, two ROS."""
    assert JOBS['container']['container'] == 'ros:jazzy'
    assert JOBS['jazzy-wheels']['strategy']['matrix']['python'] == ['3.10', '3.13']
    assert JOBS['core']['strategy']['matrix']['numpy'] == ['1.26.*', '2.*']
    assert "python_requires='>=3.10'" in SETUP and "'numpy>=1.26'" in SETUP
    assert 'kilted' in commands(JOBS['kilted-wheels'])
    assert 'colcon build' in commands(JOBS['container'])


@pytest.mark.parametrize('file', FORMS, ids=lambda file: file.stem)
def test_issue_forms(file: Path) -> None:
    """Names, elements and their attributes are those that GitHub takes."""
    form = load(file)
    assert set(form) == {'name', 'description', 'labels', 'body'}
    identities = [element['id'] for element in form['body']]
    assert len(identities) == len(set(identities))
    for element in form['body']:
        assert element['type'] in ('input', 'textarea')
        assert set(element) <= {'type', 'id', 'attributes', 'validations'}
        assert element['attributes']['label']
        assert set(element['attributes']) <= {'label', 'description', 'placeholder', 'render'}


def test_a_bug_report_asks_for_what_is_needed_to_repeat_it() -> None:
    assert {'image', 'parameters', 'diagnostics'} <= {
        element['id'] for element in load(FORMS[0])['body']}


def test_hooks() -> None:
    """Those of others have a version; local ones call modules of the environment of the tests."""
    for repo in load(HOOKS)['repos']:
        assert repo['repo'] == 'local' or re.fullmatch(r'v\d+\.\d+\.\d+', repo['rev'])
        for hook in repo['hooks']:
            if 'entry' in hook:
                assert hook['entry'].startswith('.venv/bin/python -m ')


def test_the_pull_request_template_names_what_exists() -> None:
    for path in paths((ROOT / '.github' / 'pull_request_template.md').read_text()):
        assert (ROOT / path).exists()
