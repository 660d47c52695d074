"""The manual pages say what --help says, and are manual pages."""
import os
import pathlib
import re
import subprocess

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = ROOT / os.environ.get("STRATUS_BUILD", "build")
PAGES = {"stratusd": 8, "stratus": 1}


def run(*command, **options):
    return subprocess.run(command, capture_output=True, text=True, timeout=300, **options)


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """Paths of the pages as they are made now."""
    folder = tmp_path_factory.mktemp("man")
    paths = {}
    for name, section in PAGES.items():
        made = run(ROOT / "scripts" / "manual.sh", BUILD / name, ROOT / "ops" / "man" / f"{name}.{section}.in")
        assert made.returncode == 0 and made.stderr == ""
        paths[name] = folder / f"{name}.{section}"
        paths[name].write_text(made.stdout)
    return paths


def words(text):
    return " ".join(re.sub(".\b", "", text).split())


@pytest.fixture(scope="module")
def text(pages):
    """What a reader sees, in one line."""

    def shown(path):
        # Wide, so that no word is broken.
        result = run("mandoc", "-T", "ascii", "-O", "width=1000", path)
        assert result.returncode == 0
        return words(result.stdout)

    return {name: shown(path) for name, path in pages.items()}


def help_of(name, *command):
    """Without a home whose name would be printed."""
    result = run(BUILD / name, *command, "--help", env={"HOME": "$HOME", "PATH": os.environ["PATH"]})
    assert result.returncode == 0
    return result.stdout


def flags_of(help_text):
    return re.findall(r"^  (?:-\w, )?(--[a-z-]+)(?: (\S+))? ", help_text, re.M)


def test_every_flag_of_the_daemon(text):
    page, shown = text["stratusd"], help_of("stratusd")
    options = re.findall(r"^  (--[a-z-]+)(?: (\S+))? +(.*)\n(?: {20,}(STRATUS_\w+) \[(.*)\])?", shown, re.M)
    assert len(options) == len(flags_of(shown)) > 20
    for flag, value, meaning, variable, default in options:
        item = f"{flag} {value} {meaning}" if value else f"{flag} {meaning}"
        if variable:
            item += f" ({variable}, default `{default}')" if default else f" ({variable}, no default)"
        assert words(item) in page
    names = {flag for flag, *_ in options}
    assert set(re.findall(r"(?<![\w-])--[a-z-]+", page)) <= names
    variables = {variable for *_, variable, _ in options if variable}
    assert set(re.findall(r"STRATUS_\w+", page)) - {"STRATUS_"} == variables


def test_every_command_of_the_client(text):
    page, shown = text["stratus"], help_of("stratus")
    commands = re.findall(r"^  ([a-z]+)  +(.*)$", shown, re.M)
    assert {"render", "asset", "presets", "info", "health"} <= {name for name, _ in commands}
    known = {"--server", "--help", "--version"}
    for name, summary in commands:
        own = help_of("stratus", name)
        usage, _, rest = own.partition("\n\n")
        assert words(usage.removeprefix("usage: ")) in page
        assert summary in page
        for line in rest.splitlines():
            assert words(line) in page, line
        known |= {flag for flag, _ in flags_of(own)}
    assert set(re.findall(r"(?<![\w-])--[a-z-]+", page)) == known


def test_no_other_commands(text):
    commands = set(re.findall(r"^  ([a-z]+)  +", help_of("stratus"), re.M))
    assert set(re.findall(r"\bstratus ([a-z]+) \[options\]", text["stratus"])) == commands


@pytest.mark.parametrize("name", PAGES)
def test_pages_are_clean(pages, name):
    lint = run("mandoc", "-T", "lint", "-W", "warning", pages[name])
    assert lint.returncode == 0 and lint.stdout == "", lint.stdout
    assert run(BUILD / name, "--version").stdout.strip() in pages[name].read_text()


def test_exit_statuses(text):
    """Those that the programs' own help and tests know."""
    assert re.findall(r"(\d+) (?=[A-Z])", text["stratusd"].split("EXIT STATUS")[1].split("EXAMPLES")[0]) == ["0", "1", "2", "3"]
    assert re.findall(r"(\d+) (?=[A-Z])", text["stratus"].split("EXIT STATUS")[1].split("EXAMPLES")[0]) == ["0", "1", "2", "3", "4", "130"]
