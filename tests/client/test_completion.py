"""The completion for bash against what --help says, in a real bash."""
import re
import subprocess

import pytest
import yaml

from conftest import BUILD, ROOT

# Completes the words given, the last of them, and prints what there is.
ASK = """
source <("$1" completion bash)
stratus() { "$STRATUS" "$@"; }
STRATUS=$1; shift
COMP_WORDS=(stratus "$@"); COMP_CWORD=$#; COMPREPLY=()
_stratus
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.fixture
def complete(tmp_path):
    def ask(*words, url="http://127.0.0.1:9"):
        command = ["bash", "-c", ASK, "bash", BUILD.resolve() / "stratus", *words]
        done = subprocess.run(command, capture_output=True, text=True, timeout=300, env={"PATH": "/usr/bin:/bin", "STRATUS_SERVER": url}, cwd=tmp_path, check=True)
        assert done.stderr == ""
        return done.stdout.split()

    return ask


def help_of(stratus, *command):
    return stratus(None, *command, "--help").stdout


def test_every_command_and_option_of_the_help(complete, stratus):
    text = help_of(stratus)
    commands = re.findall(r"^  ([a-z]+)  +", text, re.M)
    assert len(commands) >= 12
    assert sorted(word for word in complete("") if not word.startswith("-")) == sorted(commands)
    for command in commands:
        flags = re.findall(r"^  (?:(-\w), )?(--[a-z-]+)", help_of(stratus, command), re.M)
        assert len(flags) >= 6
        assert sorted(complete(command, "-")) == sorted(flag for pair in flags for flag in pair if flag)


def test_options_before_the_command(complete):
    assert complete("--server", "http://x", "ren") == ["render"]
    assert complete("--server", "") == []
    assert complete("-q", "info", "--sc") == ["--scene"]


def test_values(complete, tmp_path):
    (tmp_path / "scene.json").write_text("{}")
    (tmp_path / "folder").mkdir()
    assert complete("batch", "--format", "") == ["png", "exr"]
    assert complete("render", "sc") == ["scene.json"]
    assert complete("render", "-o", "sc") == ["scene.json"]
    assert complete("batch", "-o", "") == ["folder"]
    assert complete("bench", "--rate", "") == []
    assert complete("asset", "pu") == ["put"] and complete("asset", "put", "sc") == ["scene.json"]
    assert complete("completion", "") == ["bash", "members"]
    assert complete("health", "sc") == []


def test_names_that_the_daemon_knows(real_daemon, complete, stratus):
    presets = stratus(real_daemon, "presets", "-q").stdout.split()
    assert len(presets) > 5 and complete("render", "--preset", "", url=real_daemon.url) == presets
    assert complete("presets", presets[0][:-1], url=real_daemon.url)[0] == presets[0]
    assert complete("render", "--set", "sun.el", url=real_daemon.url) == ["sun.elevation_deg="]
    assert complete("render", "--preset", "") == []  # no daemon, no names


def test_members_are_those_of_the_schema(real_daemon, stratus):
    sections = yaml.safe_load((ROOT / "openapi.yaml").read_text())["components"]["schemas"]["Scene"]["properties"]
    members = [f"{section}.{name}" for section, schema in sections.items() for name in schema["properties"]]
    assert stratus(real_daemon, "completion", "members").stdout.split() == members


def test_usage(stratus):
    assert stratus(None, "completion", "fish").returncode == 2
    assert stratus(None, "completion").returncode == 2
    assert stratus(None, "completion", "members").returncode == 3
