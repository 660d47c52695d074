"""openapi.yaml against the running service: paths, methods, and every member's type, range and default."""
import json
import pathlib

import pytest
import yaml

from conftest import query_of

ROOT = pathlib.Path(__file__).resolve().parents[2]
CONTRACT = yaml.safe_load((ROOT / "openapi.yaml").read_text())
SECTIONS = CONTRACT["components"]["schemas"]["Scene"]["properties"]
MEMBERS = [(section, name, schema) for section, inner in SECTIONS.items() for name, schema in inner["properties"].items()]

# What a probe needs beside it so that only the member itself can be wrong.
BESIDE = {
    ("sun", "time"): {"sun": {"latitude_deg": 40, "longitude_deg": 0}},
    ("sun", "latitude_deg"): {"sun": {"time": "2024-03-20T12:00:00Z", "longitude_deg": 0}},
    ("sun", "longitude_deg"): {"sun": {"time": "2024-03-20T12:00:00Z", "latitude_deg": 89}},
    ("dsd", "gamma"): {"dsd": {"effective_radius_um": 2}},
    ("dsd", "n0_per_cm3"): {"dsd": {"effective_radius_um": 5}},
    ("dsd", "effective_radius_um"): {"dsd": {"n0_per_cm3": 10}},
    ("ground", "albedo"): {"ground": {"type": "lambert"}},
    ("output", "layers"): {"output": {"format": "exr"}},
    ("camera", "position_m"): {"clouds": {"type": "none"}},
}
# On these bounds another rule speaks: the sun below the horizon, the range of the effective radius.
ELSEWHERE = {("sun", "latitude_deg"), ("sun", "longitude_deg"), ("dsd", "characteristic_radius_um")}

identifiers = [f"{section}.{name}" for section, name, _ in MEMBERS]
each_member = pytest.mark.parametrize("section, name, schema", MEMBERS, ids=identifiers)


def scene_with(section, name, value):
    scene = json.loads(json.dumps(BESIDE.get((section, name), {})))
    scene.setdefault(section, {})[name] = value
    return scene


def bad_pointers(daemon, section, name, value):
    """The pointers that a scene with this value is refused for; validation alone, by HEAD, then GET for the pointers."""
    target = "/v1/render?" + query_of(scene_with(section, name, value))
    if daemon.head(target).status == 200:
        return set()
    return daemon.get(target).pointers


def step(schema, bound):
    return 1 if schema["type"] == "integer" else max(abs(bound) * 1e-9, 1e-9)


def ranges(name, schema):
    """(values on the bounds, values just outside with the pointer's tail)."""
    if schema.get("type") in ("number", "integer") and "minimum" in schema:
        low, high = schema["minimum"], schema["maximum"]
        return [low, high], [(low - step(schema, low), ""), (high + step(schema, high), "")]
    if schema.get("type") == "array" and schema["items" if "items" in schema else "prefixItems"] and "minItems" in schema:
        items = schema.get("prefixItems") or [schema["items"]] * schema["minItems"]
        if items[0].get("type") != "number":
            return [], []
        inside = [[item["minimum"] for item in items], [item["maximum"] for item in items]]
        outside = []
        for i, item in enumerate(items):
            for bad in (item["minimum"] - step(item, item["minimum"]), item["maximum"] + step(item, item["maximum"])):
                outside.append((inside[0][:i] + [bad] + inside[0][i + 1 :], f"/{i}"))
        return inside, outside
    return [], []


@each_member
def test_range(daemon, section, name, schema):
    inside, outside = ranges(name, schema)
    if (section, name) in ELSEWHERE:
        inside = []
    for value in inside:
        assert bad_pointers(daemon, section, name, value) == set(), value
    for value, tail in outside:
        assert bad_pointers(daemon, section, name, value) == {f"/{section}/{name}{tail}"}, value


@each_member
def test_choices(daemon, section, name, schema):
    choices = schema.get("enum") or schema.get("items", {}).get("enum")
    if not choices:
        return
    as_list = schema["type"] == "array"
    for value in choices:
        assert bad_pointers(daemon, section, name, [value] if as_list else value) == set(), value
    other = 1000 if schema["type"] == "integer" else "other"
    tail = "/0" if as_list else ""
    assert bad_pointers(daemon, section, name, [other] if as_list else other) == {f"/{section}/{name}{tail}"}


@each_member
def test_type(daemon, section, name, schema):
    wrong = {"number": "1", "integer": 1.5, "boolean": "true", "string": 1, "array": "x"}.get(schema.get("type"), True)
    answer = daemon.render(scene_with(section, name, wrong))
    assert answer.status == 422
    assert answer.pointers == {f"/{section}/{name}"}


@each_member
def test_default(daemon, section, name, schema):
    """A default that is said changes nothing: the entity tag is the same."""
    if "default" not in schema:
        return
    beside = {"ground": {"type": "lambert"}} if (section, name) == ("ground", "albedo") else {}
    said = json.loads(json.dumps(beside))
    said.setdefault(section, {})[name] = schema["default"]
    plain = daemon.head("/v1/render?" + query_of(beside))
    assert plain.status == 200
    assert daemon.head("/v1/render?" + query_of(said)).headers["ETag"] == plain.headers["ETag"]


def test_canonical_scene_has_the_members_of_the_contract(daemon, read_image):
    scene = {"ground": {"type": "lambert"}, "output": {"width": 16, "height": 16}}
    embedded = json.loads(read_image(daemon.render(scene).body)[1].getattribute("stratus:scene"))
    for section, inner in SECTIONS.items():
        with_default = {name for name, schema in inner["properties"].items() if "default" in schema}
        assert set(embedded[section]) == with_default
    assert set(embedded) == set(SECTIONS)


EXAMPLES = {
    "/v1/sun": "/v1/sun?time=2024-06-21T12:00:00Z&latitude_deg=48&longitude_deg=11",
    "/v1/render": "/v1/render?output.width=16&output.height=16",
}


@pytest.mark.parametrize("path, method", [(path, method) for path, item in CONTRACT["paths"].items() for method in item])
def test_every_call_answers(daemon, path, method):
    described = CONTRACT["paths"][path][method]["responses"]
    target = EXAMPLES.get(path, path)
    if method == "post":
        answer = daemon.render({"output": {"width": 16, "height": 16}})
    else:
        answer = daemon.request(method.upper(), target)
    assert answer.status == 200
    if method == "head":
        return
    response = described["200"]
    if "$ref" in response:
        response = CONTRACT["components"]["responses"][response["$ref"].rsplit("/", 1)[1]]
    assert answer.headers["Content-Type"].split(";")[0] in response["content"]
    for header in response.get("headers", {}):
        assert answer.headers[header], header
    schema = response["content"][answer.headers["Content-Type"].split(";")[0]].get("schema", {})
    if "$ref" in schema:
        schema = CONTRACT["components"]["schemas"][schema["$ref"].rsplit("/", 1)[1]]
    for required in schema.get("required", []):
        assert required in answer.json


def test_served_contract_is_the_file(daemon):
    assert daemon.get("/openapi.yaml").body == (ROOT / "openapi.yaml").read_bytes()


def test_problems_match_their_schema(daemon):
    schema = CONTRACT["components"]["schemas"]["Problem"]
    for answer in (daemon.render("{"), daemon.render('{"x":1}'), daemon.get("/nothing")):
        assert set(schema["required"]) <= set(answer.json) <= set(schema["properties"])
