"""The command line: its entry, its verbs and their options."""

from studies.cli.entry_point import main as main
