"""A check that is found at once, and runs without their animation."""

import dataclasses

import pytest

from cablefem.response import write_json
from validation.commands.check import study as check_study
from validation.page.page import Section


@pytest.fixture(scope="session")
def level_check():
    """Both solvers at 5 percent: a second."""
    return check_study.check("level", tol=3e-2)


@pytest.fixture
def without_animation(monkeypatch):
    """Write no animation, half of the time of a short run; tests/commands/test_readback.py reads them."""
    from validation.page import paraview

    monkeypatch.setattr(paraview, "write_paraview_files", lambda response, folder: None)


@pytest.fixture
def instant_check(monkeypatch, without_animation, level_check):
    """Let `check` find at once what it found before, and write the verdict alone: only the command is tested here.

    Returns a function that changes what it finds.
    """
    from validation.commands.check import page as pages
    from validation.page import report

    def find(**changes):
        found = dataclasses.replace(level_check, **changes)
        monkeypatch.setattr(check_study, "check", lambda scene, **how: dataclasses.replace(found, tol=how["tol"]))

    find()
    section = Section("check-verdict", "Verdict", "<p>1</p>", "agree", "both solvers")
    monkeypatch.setattr(pages, "sections", lambda folder: [section])
    monkeypatch.setattr(report, "read_back_and_report", lambda command, of, lines: 0)
    monkeypatch.setattr(
        check_study.Check, "write", lambda check, out: write_json(out / "agreement.json", check.agreement())
    )
    return find
