"""What verbs do with a design file that states an array: those that take one beam of it say so."""

import re
from pathlib import Path

import pytest

from studies.cli import commands, main

ARRAY = (
    'base = "paper"\nhall_noise = 0.001\n[array]\nrows = 1\ncolumns = 2\npitch = 20.0\npolarity = ["up", "down"]\n'
)


@pytest.fixture
def pair(tmp_path):
    file = tmp_path / "pair.toml"
    file.write_text(ARRAY)
    return file


def said(capsys, *words):
    """Standard output of a command that succeeds, and the sentences beside it that tell of one beam."""
    assert main([*map(str, words)]) == 0
    printed, beside = capsys.readouterr()
    return printed, [line for line in beside.splitlines() if "one of its beams" in line]


def test_a_verb_of_one_beam_says_so_once_and_answers_as_without_the_table(pair, tmp_path, capsys):
    beam = tmp_path / "beam.toml"
    beam.write_text(ARRAY.partition("[array]")[0])
    for words in (["analytic", "--depth", "1"], ["sweep", "--axis", "D=8,9", "--depth", "1", "--models", "paper"]):
        verb, *options = words
        of_array, sentences = said(capsys, verb, pair, *options, "--json")
        of_beam, none = said(capsys, verb, beam, *options, "--json")
        assert of_array == of_beam
        assert (len(sentences), none) == (1, [])


def test_a_verb_that_takes_arrays_does_not_say_so(pair, capsys):
    assert said(capsys, "readings", pair)[1] == []


def test_verbs_that_read_the_table_are_those_declared_to_take_arrays():
    sources = [file.read_text() for file in Path(commands.__file__).parent.glob("*_commands.py")]
    found = [part for source in sources for part in re.split(r"^(?=@verb\b)", source, flags=re.MULTILINE)[1:]]
    reads = {part for part in found if "stated_array" in part or "grid_of" in part}
    assert {part for part in found if "arrays=True" in part} == reads
    assert len(reads) > 5
