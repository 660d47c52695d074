"""What the documentation says of settings is so, and none is left out. (Manual pages: test_manual.py; metrics: tests/http/test_monitoring.py.)"""
import os
import pathlib
import re
import subprocess

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = ROOT / os.environ.get("STRATUS_BUILD", "build")
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
PLACES = [*PAGES, ROOT / "Dockerfile", ROOT / "ops" / "stratusd.env", ROOT / "ops" / "stratusd.service", *sorted((ROOT / "ops" / "man").glob("*.in"))]
# Of the client, and of make test.
OTHERS = {"STRATUS_SERVER", "STRATUS_API_KEY", "STRATUS_CA_CERT", "STRATUS_QUICK", "STRATUS_"}


def help_of(name, *command):
    return subprocess.run([BUILD / name, *command, "--help"], capture_output=True, text=True, check=True, timeout=60).stdout


def settings():
    """Of the daemon: {flag: variable}, which is None for those that only print something."""
    found = re.findall(r"^  (--[a-z-]+)(?: \S+)? +.*\n(?: {20,}(STRATUS_\w+) \[)?", help_of("stratusd"), re.M)
    return {flag: variable or None for flag, variable in found}


def test_every_setting_is_documented():
    text = "\n".join(page.read_text() for page in PAGES)
    known = settings()
    assert len(known) > 40
    for flag, variable in known.items():
        names = "|".join(name for name in (flag, variable) if name)
        assert flag in ("--help", "--version") or re.search(rf"(?<![\w-])({names})(?![\w-])", text), flag


def test_every_setting_that_is_named_exists():
    variables = set(settings().values()) | OTHERS
    for place in PLACES:
        assert set(re.findall(r"\bSTRATUS_[A-Z_]*", place.read_text())) <= variables, place


def test_every_flag_of_the_daemon_that_is_named_exists():
    """Behind the name of a program, or alone in code: those of stratusd, or of a command of the client."""
    commands = re.findall(r"^  ([a-z]+)  +", help_of("stratus"), re.M)
    known = set(settings())
    for command in commands:
        known |= set(re.findall(r"--[a-z-]+", help_of("stratus", command)))
    known |= set(re.findall(r"--[a-z-]+", help_of("stratus")))
    for page in PAGES:
        for flag in re.findall(r"`(--[a-z-]+)[ =A-Z]*`|stratusd[^`\n]* (--[a-z-]+)", page.read_text()):
            flag = flag[0] or flag[1]
            assert flag in known, (page.name, flag)
