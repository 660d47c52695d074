"""Every command line of the documentation, against the options that there are; the recipes are run, in little."""
import re
import shlex

import pytest

from conftest import ROOT

PAGES = ["README.md", "docs/clients.md", "docs/bench.md", "docs/operations.md", "docs/reference.md", "docs/maps.md", "ops/man/stratus.1.in"]
SMALL = ["--set", "output.width=32", "--set", "output.height=18", "--set", "clouds.resolution=64"]


def command_lines(page):
    """The words of each call of stratus in the shell blocks of a page (lines of a manual)."""
    text = (ROOT / page).read_text()
    blocks = re.findall(r"^\.Dl (stratus .*)$", text, re.M) if page.endswith(".in") else re.findall(r"```sh\n(.*?)```", text, re.S)
    for line in "\n".join(blocks).replace("\\\n", " ").splitlines():
        for part in re.split(r"[|;]|&&", line.split(" #")[0]):
            found = re.match(r"\s*(?:build/)?stratus ((?!completion).*)", part)
            if found:
                yield shlex.split(found[1].replace("${", "{"))


def flags(stratus, command):
    return set(re.findall(r"^  (?:-\w, )?(--[a-z-]+)", stratus(None, command, "--help").stdout, re.M)) | set(
        re.findall(r"^  (-\w), ", stratus(None, command, "--help").stdout, re.M)
    )


@pytest.mark.parametrize("page", PAGES)
def test_command_lines_are_such_as_there_are(stratus, page):
    known, seen = {}, 0
    for words in command_lines(page):
        command = words[0]
        known.setdefault(command, flags(stratus, command))
        assert known[command], f"{page}: there is no command {command}"
        for word in words[1:]:
            assert not re.match(r"--?[a-z]", word) or word in known[command], f"{page}: {command} has no {word}"
        seen += 1
    assert seen > 3 or page in ("docs/operations.md", "docs/reference.md", "docs/maps.md")


def recipe(command, words):
    """The line of clients.md for a command that has some words in it."""
    return next(line for line in command_lines("docs/clients.md") if line[0] == command and set(words) <= set(line))


@pytest.mark.parametrize(
    "command, words, less, made",
    [
        ("render", ["camera.projection=equirectangular"], ["--set", "output.width=32"], "sunset.exr"),
        ("animate", ["timelapse.mp4"], [*SMALL, "--duration", "0.2", "-o", "frames"], "frames/000005.png"),
        ("batch", ["--count"], [*SMALL, "--count", "3"], "skies/manifest.jsonl"),
        ("bench", ["--random"], [*SMALL, "--duration", "1", "--warm-up", "0"], None),
        ("optics", ["dsd.effective_radius_um=12"], [], None),
        ("sun", ["--day"], [], None),
    ],
)
def test_recipes(real_daemon, stratus, tmp_path, command, words, less, made):
    size = ("output.width=", "output.height=")
    line = recipe(command, words)
    line = [word for i, word in enumerate(line) if not word.startswith(size) and not (i + 1 < len(line) and line[i + 1].startswith(size))]
    done = stratus(real_daemon, *line, *less, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert made is None or (tmp_path / made).stat().st_size > 0
