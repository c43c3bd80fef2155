"""Public modules from Python: what they export, what help shows, and what wrong arguments are told."""

import ast
import importlib
import inspect
import re
from pathlib import Path

import pytest

from fem.accuracy import QUICK
from fem.analyses.modes import modes
from fem.analyses.stability import critical
from fem.equilibrium import solve, trace
from geometry.design import BadInput, Design, paper
from geometry.loads import Load

MODULES = (
    "geometry.design",
    "geometry.loads",
    "fem.accuracy",
    "fem.equilibrium",
    "fem.analyses.force_targets",
    "fem.analyses.stability",
    "fem.analyses.small_shear",
    "fem.analyses.modes",
    "fem.analyses.vibration",
    "fem.analyses.timed_path",
    "analytic.beam",
    "analytic.magnet",
    "analytic.hall",
    "analytic.parts",
    "analytic.stream",
)


@pytest.mark.parametrize("name", MODULES)
def test_exported_names_exist_and_have_help(name):
    module = importlib.import_module(name)
    for exported in module.__all__:
        value = getattr(module, exported)
        if inspect.isfunction(value) or inspect.isclass(value):
            assert inspect.getdoc(value), exported
    # a star import brings no library along
    assert not any(inspect.ismodule(getattr(module, exported)) for exported in module.__all__)


@pytest.mark.parametrize("function", [solve, trace])
def test_help_names_every_parameter_and_its_unit(function):
    text = inspect.getdoc(function)
    section = text.partition("Parameters\n")[2].partition("\nReturns\n")[0]
    for name in inspect.signature(function).parameters:
        assert re.search(rf"^[\w, ]*\b{name}\b[\w, ]* :", section, re.MULTILINE), name
    assert "mm" in text
    assert re.search(r"^Returns$", text, re.MULTILINE)


@pytest.mark.parametrize(
    ("call", "error", "text"),
    [
        (
            lambda: solve(paper(), Load(1.0), "quick"),
            TypeError,
            "accuracy must be QUICK, STANDARD, FINE of fem.acc",
        ),
        (
            lambda: critical(paper(), accuracy="quick"),
            TypeError,
            "accuracy must be QUICK, STANDARD, FINE of fem.acc",
        ),
        (
            lambda: solve(paper(), Load(1.0), QUICK, magnet="none"),
            BadInput,
            "magnet must be rigid or ignored; got 'no",
        ),
        (lambda: critical(paper(), "none", accuracy=QUICK), BadInput, "magnet must be rigid or ignored; got 'none'"),
        (lambda: modes(paper(), "none", accuracy=QUICK), BadInput, "magnet must be rigid or ignored; got 'none'"),
        (lambda: solve(paper(), 1.0), TypeError, "the load must be a Load, such as Load(depth=1.0); got 1.0"),
        (lambda: solve("paper", Load(1.0)), TypeError, "the design must be a Design, such as paper(); got 'paper'"),
        (lambda: Load("1"), BadInput, "depth must be a number; got '1'"),
        (lambda: Load(depth=True), BadInput, "depth must be a number; got True"),
        (lambda: Load(1.0, friction=True), BadInput, "friction must be none, stick or a coefficient"),
        (lambda: Load(shear_x=0.2, grip=True), BadInput, "grip must be a positive height in mm; got True"),
        (lambda: Load(1.0, 0.2, friction=None), BadInput, "friction must be none, stick or a coefficient"),
        (lambda: Load(shear_x=0.2, grip="1"), BadInput, "grip must be a positive height in mm; got '1'"),
    ],
)
def test_wrong_arguments_are_told_what_is_accepted(call, error, text):
    with pytest.raises(error) as raised:
        call()
    assert str(raised.value).startswith(text)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("package", ["fem", "geometry", "analytic"])
def test_messages_below_studies_name_no_option_of_the_command_line(package):
    with pytest.raises(BadInput) as raised:
        solve(Design(magnet_diameter=0.0, magnet_height=0.0), Load(1.0), QUICK)
    assert str(raised.value) == "this design has no magnet (magnet_diameter is 0): choose the magnet ignored"
    for file in Path(package).rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            for message in ast.walk(node) if isinstance(node, ast.Raise) else ():
                if isinstance(message, ast.Constant) and isinstance(message.value, str):
                    assert not re.search(r"--[a-z]", message.value), file
