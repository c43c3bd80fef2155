"""Options, JSON keys and columns of version 0.2 (contract.json) are there: users' scripts depend on them."""

import json
import re
from pathlib import Path

import pytest

CONTRACT = json.loads(Path(__file__).with_name("contract.json").read_text("utf-8"))


def paths(value, before=""):
    """Paths of all keys in JSON, such as `derived.H_mm` and `rows[].name`."""
    if isinstance(value, dict):
        for name, part in value.items():
            yield before + name
            yield from paths(part, f"{before}{name}.")
    elif isinstance(value, list):
        for part in value:
            yield from paths(part, f"{before.removesuffix('.')}[].")


@pytest.mark.parametrize(("verb", "options"), CONTRACT["options"].items())
def test_no_option_is_gone(verb, options, run):
    assert set(options.split()) <= set(re.findall(r"--[a-z][a-z0-9-]*", run(*verb.split(), "--help")[1]))


@pytest.mark.parametrize(("command", "keys"), CONTRACT["keys"].items(), ids=lambda text: text.split()[0])
def test_no_key_is_gone(command, keys, run):
    lines = [json.loads(line) for line in run(*command.split(), "--json")[1].splitlines()]
    assert set(keys.split()) <= {path for line in lines for path in paths(line)}
