"""The files of the page at /: how they are sent, and that its controls have the ranges of the contract. What it does is tested in tests/web."""
import json
import pathlib
import re

import pytest
import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGES = ROOT / "server" / "pages"
FILES = sorted(str(path.relative_to(PAGES)) for path in PAGES.rglob("*.*") if path.is_file())
TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
SCENE = yaml.safe_load((ROOT / "openapi.yaml").read_text())["components"]["schemas"]["Scene"]["properties"]


@pytest.mark.parametrize("name", ["", *FILES])
def test_files_are_sent_as_they_are(daemon, name):
    target = f"/web/{name}" if name else "/"
    answer = daemon.get(target)
    assert answer.status == 200
    assert answer.body == (PAGES / (name or "index.html")).read_bytes()
    assert answer.headers["Content-Type"].split(";")[0] == TYPES[pathlib.Path(name or "index.html").suffix]
    assert answer.headers["Cache-Control"] == "no-cache"
    assert answer.headers["X-Content-Type-Options"] == "nosniff"
    assert daemon.get(target, If_None_Match=answer.headers["ETag"]).status == 304
    assert daemon.head(target).status == 200


def test_policy_is_strict(daemon):
    policy = dict(part.strip().split(" ", 1) for part in daemon.get("/").headers["Content-Security-Policy"].split(";"))
    assert policy["default-src"] == "'none'"
    assert policy["script-src"] == policy["style-src"] == policy["connect-src"] == "'self'"
    assert "unsafe" not in str(policy)
    page = (PAGES / "index.html").read_text()
    assert not re.search(r"<style|\sstyle=|\son\w+=|<script(?![^>]*\ssrc=)", page), "nothing inline, which the policy would keep from working"


def test_nothing_of_the_page_comes_from_elsewhere():
    for name in FILES:
        addresses = set(re.findall(r"https?://[^\s\"'`)]+", (PAGES / name).read_text()))
        assert {a for a in addresses if not a.startswith(("http://www.w3.org/", "https://www.shadertoy.com/"))} == set(), name


@pytest.mark.parametrize("path", ["", "nothing.js", "../presets/all-sky.json", "..%2fpresets/all-sky.json", "style/", "a" * 500 + ".js"])
def test_other_files_are_not_there(daemon, path):
    assert daemon.get(f"/web/{path}").status == 404


def fields():
    """Of server/pages/scene/fields.js: what each control says of its member."""
    text = (PAGES / "scene" / "fields.js").read_text()
    parts = re.split(r'\bpath: "', text)[1:]
    assert len(parts) > 30
    for part in parts:
        path = part[: part.index('"')]
        said = {name: json.loads(value) for name, value in re.findall(r'\b(min|max|initial): ("[^"]*"|[-\w.]+)', part)}
        choices = re.search(r"choices: \[(.*?)\]\]", part, re.S)
        if choices:
            said["choices"] = re.findall(r'\["([^"]+)",', choices[1] + "],")
        yield pytest.param(path, said, id=path)


@pytest.mark.parametrize("path, said", fields())
def test_controls_have_the_ranges_of_the_contract(path, said):
    section, name, *index = path.split(".")
    schema = SCENE[section]["properties"][name]
    initial = schema.get("default")
    if index:
        initial = initial[int(index[0])]
        schema = (schema.get("prefixItems") or [schema["items"]] * schema["minItems"])[int(index[0])]
    if "oneOf" in schema:
        schema = schema["oneOf"][0]
    assert said.get("min") == schema.get("minimum")
    assert said.get("max") == schema.get("maximum")
    assert said.get("choices") == schema.get("enum")
    if initial is not None and section != "output" or name in ("exposure_ev", "tone"):
        assert said["initial"] == initial
