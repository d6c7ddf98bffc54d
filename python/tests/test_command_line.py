"""The table of docs/python.md has every option of the command line, and the names that it gives exist."""

import inspect
import re
import subprocess

import pytest
from conftest import ROOT

import hybank as hb


PROGRAMS = ("hybank", "hybank-ibr")


def rows(program):
    """(commands, options, text) of each row of the table of a program."""
    page = (ROOT / "docs" / "python.md").read_text()
    table = page[page.index("## The command line in Python") :]
    table = table[: table.index("\n## ", 1)]
    own, other = table.split("\nThe options of `hybank-ibr`")
    table = own if program == "hybank" else other
    lines = [line.strip("| \n").split(" | ") for line in table.splitlines() if line.startswith("| ")][2:]
    quoted = lambda text: re.findall(r"`([^`]+)`", text)  # noqa: E731
    return [(quoted(commands), quoted(options), text) for commands, options, text in lines]


@pytest.fixture(scope="module", params=PROGRAMS)
def program(request):
    return request.param


@pytest.fixture(scope="module")
def options(binary, program):
    """The options of each command, by its help."""
    binary = binary.with_name(program)
    if not binary.exists():
        pytest.skip(f"no {program} beside {binary.parent}")
    run = lambda *words: subprocess.run([binary, *words], check=True, capture_output=True, text=True).stdout  # noqa: E731
    commands = re.search(r"Commands:\n(.*?)\n\n", run("--help"), re.S).group(1)
    names = [name for name in re.findall(r"^  ([a-z-]+)  ", commands, re.M) if name != "help"]
    find = lambda text: set(re.findall(r"^ +(?:-\w, )?(--[a-z-]+)", text, re.M)) - {"--help"}  # noqa: E731
    return {name: find(run(name, "--help")) for name in names}


def test_every_option_has_its_row(options, program):
    known = {name: set() for name in options}
    for commands, named, _ in rows(program):
        for command in commands or known:
            assert command in options, command
            for option in named:
                # A row without commands is about all that have the option.
                assert option in options[command] or not commands, (command, option)
                known[command].add(option)
    for command, wanted in options.items():
        assert wanted <= known[command], (command, wanted - known[command])
    for _, named, _ in rows(program):
        assert all(any(option in of for of in options.values()) for option in named), named


@pytest.mark.parametrize("program, least", [("hybank", 40), ("hybank-ibr", 10)])
def test_the_names_of_the_table_exist(program, least):
    found = 0
    for _, named, text in rows(program):
        for name, keyword in re.findall(r"`([\w.]+)\((\w+)?=?[^`]*\)`", text):
            thing = hb
            for part in name.split("."):
                thing = getattr(thing, part)
            assert not keyword or keyword in inspect.signature(thing).parameters, f"{name}({keyword}=)"
            found += 1
            if "the same names" in text:
                same = [option.removeprefix("--").replace("-", "_") for option in named]
                same = [option for option in same if option in inspect.signature(thing).parameters]
                found += len(same)
        for name in re.findall(r"`((?:Bank|Stream|FuseReport|Analysis|Figures|Calibration|ibr\.View)\.\w+)`", text):
            thing = hb
            for part in name.split("."):
                thing = getattr(thing, part)
            found += 1
        assert "`" in text or text.startswith("left out"), text
    assert found > least


def test_every_command_has_a_row(options, program):
    assert {command for commands, _, _ in rows(program) for command in commands} == set(options)
