"""The verbs of the command, as `--help` lists them."""

import re

from studies.cli.commands import ACTIONS

ORDER = """
    Design: design cad mesh cache catalogue size
    Simulation: solve analytic compare stability modes response cycle fit demo
    Sensing: field readings calibrate decode table layout
    Exploration: explore sweep sensitivity report store
    Validation: validate
    Options: --help --version
"""


def test_help_lists_the_verbs_in_groups_from_a_design_to_its_validation(run):
    text = run("--help")[1]
    listed = re.findall(r"^╭─ (\w+) |^│ ([-\w]+)", text, re.MULTILINE)
    assert [title + ":" if title else verb for title, verb in listed] == ORDER.split()


def test_validate_lists_its_studies(run):
    listed = re.findall(r"^│ ([-\w]+)", run("validate")[1], re.MULTILINE)
    assert listed[:4] == ["verify", "friction", "extremes", "accuracy"]
    assert set(listed) == {name.strip("_") for name in ACTIONS["Validation"]["validate"][2].split()}


def test_a_study_that_was_a_verb_is_found(refusal):
    err = refusal("verify", "--quick")
    assert err == "magtip: verify is a study of validation: type magtip validate verify\n"
