"""The mutation run: what it changes, and what it says of tests that notice and of tests that do not."""

from __future__ import annotations

import ast
import subprocess

import pytest
from mutate import PACKAGES, all_mutants, main, mutants

from hicp_lib.core.checkout import CHECKOUT

SOURCE = '''"""Ünïcode - 1."""

from __future__ import annotations


def reach(x: float | None, low: int = 2) -> int | None:
    a = (x  # not a + b
         - low)
    return -a if a > 1.5 and x is not None and not low else 0
'''
CHANGES = [
    ("constant", "2", "3"),
    ("operator", "-", "+"),
    ("operator", "and", "or"),
    ("operator", "and", "or"),
    ("operator", ">", ">="),
    ("constant", "1.5", "2.25"),
    ("operator", "is not", "is"),
    ("operator", "not ", ""),
    ("operator", "-", ""),
    ("constant", "0", "1"),
]
TEST = """from hicp_lib.robot.reach import reach

def test_reach():
    assert reach(5.0, {low}) == {result}
"""


@pytest.fixture
def checkout(tmp_path):
    """A library of one function, in a repository, whose tests notice little."""
    for name in ("hicp_lib/robot", "tests/robot", "tools"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "hicp_lib" / "__init__.py").touch()
    (tmp_path / "hicp_lib" / "robot" / "__init__.py").touch()
    (tmp_path / "hicp_lib" / "robot" / "reach.py").write_text(SOURCE)
    (tmp_path / "tools" / "equivalent_mutants.toml").touch()
    (tmp_path / "pyproject.toml").touch()
    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    return tmp_path


def write_test(checkout, low, result):
    (checkout / "tests" / "robot" / "test_reach.py").write_text(TEST.format(low=low, result=result))


def test_changes_are_those_of_operators_and_numbers_but_not_of_type_hints(checkout):
    path = checkout / "hicp_lib" / "robot" / "reach.py"
    found = list(mutants(path, "reach.py"))
    assert sorted((each.kind, each.old, each.new) for each in found) == sorted(CHANGES)
    for each in found:
        changed = each.applied(path.read_bytes())
        assert ast.dump(ast.parse(changed)) != ast.dump(ast.parse(SOURCE)), each


def test_survivors_are_told_and_floors_kept(checkout, capsys):
    write_test(checkout, 0, -5.0)
    assert main(["--n", "20", "--workers", "2", "robot"], checkout) == 1
    said = capsys.readouterr().out
    assert "SURVIVED hicp_lib/robot/reach.py:9: > -> >=    return -a if a > 1.5" in said
    assert "noticed  hicp_lib/robot/reach.py:9: not  -> nothing" in said
    assert "constant  robot             0 of    3 noticed" in said


def test_equivalent_mutants_are_not_drawn_and_must_exist(checkout):
    text = "return -a if a > 1.5 and x is not None and not low else 0"
    change = 'old = ">"\nnew = ">="\nreason = "none"\n'
    named = f'[[mutant]]\nfile = "hicp_lib/robot/reach.py"\ntext = "{text}"\n{change}'
    (checkout / "tools" / "equivalent_mutants.toml").write_text(named)
    assert len(all_mutants(checkout, ["robot"])) == len(CHANGES) - 1
    (checkout / "tools" / "equivalent_mutants.toml").write_text(named.replace("1.5", "1.6"))
    with pytest.raises(SystemExit, match="no such mutant any more"):
        all_mutants(checkout, ["robot"])


def test_tests_that_fail_by_themselves_are_told(checkout):
    write_test(checkout, 0, 3)
    with pytest.raises(SystemExit, match="fail without any change"):
        main(["--n", "2", "robot"], checkout)


def test_the_packages_are_there_and_have_tests():
    for package in PACKAGES:
        assert (CHECKOUT / "tests" / package).is_dir()
    assert {mutant.kind for mutant in all_mutants(CHECKOUT, list(PACKAGES))} == {"operator", "constant"}
