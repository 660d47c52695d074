"""openapi.yaml against the running service: paths, methods, and every member's type, range and default."""
import json
import pathlib

import pytest
import yaml

from conftest import query_of

ROOT = pathlib.Path(__file__).resolve().parents[2]
# 2 x 1 pixels, black and white.
PNG = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000002000000010800000000d14920560000000b49444154789c6360f80f000102010042bebc680000000049454e44ae426082"
)
CONTRACT = yaml.safe_load((ROOT / "openapi.yaml").read_text())
SECTIONS = CONTRACT["components"]["schemas"]["Scene"]["properties"]
MEMBERS = [(section, name, schema) for section, inner in SECTIONS.items() for name, schema in inner["properties"].items()]

OF_THE_REFERENCE = {"samples", "time_budget_ms", "seed", "partial"}

# What a probe needs beside it so that only the member itself can be wrong.
BESIDE = {
    ("sun", "time"): {"sun": {"latitude_deg": 40, "longitude_deg": 0}},
    ("sun", "latitude_deg"): {"sun": {"time": "2024-03-20T12:00:00Z", "longitude_deg": 0}},
    ("sun", "longitude_deg"): {"sun": {"time": "2024-03-20T12:00:00Z", "latitude_deg": 89}},
    ("dsd", "gamma"): {"dsd": {"effective_radius_um": 2}},
    ("dsd", "n0_per_cm3"): {"dsd": {"effective_radius_um": 5}},
    ("dsd", "effective_radius_um"): {"dsd": {"n0_per_cm3": 10}},
    ("ground", "albedo"): {"ground": {"type": "lambert"}},
    ("output", "layers"): {"output": {"format": "exr"}, "model": {"name": "reference"}},
    ("camera", "position_m"): {"clouds": {"type": "none"}},
    ("camera", "face"): {"camera": {"projection": "cubemap"}},
    **{("model", name): {"model": {"name": "reference"}, "output": {"width": 16, "height": 16}} for name in OF_THE_REFERENCE},
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
    if section == "model" and name in OF_THE_REFERENCE:
        beside = {"model": {"name": "reference"}}
    said = json.loads(json.dumps(beside))
    said.setdefault(section, {})[name] = schema["default"]
    plain = daemon.head("/v1/render?" + query_of(beside))
    assert plain.status == 200
    assert daemon.head("/v1/render?" + query_of(said)).headers["ETag"] == plain.headers["ETag"]


def test_canonical_scene_has_the_members_of_the_contract(daemon, read_image):
    scene = {"ground": {"type": "lambert"}, "output": {"width": 16, "height": 16}}
    embedded = json.loads(read_image(daemon.render(scene).body)[1].getattribute("stratus:scene"))
    for section, inner in SECTIONS.items():
        with_default = {name for name, schema in inner["properties"].items() if "default" in schema} - (OF_THE_REFERENCE if section == "model" else set())
        assert set(embedded[section]) == with_default
    assert set(embedded) == set(SECTIONS)


def resolve(schema):
    while "$ref" in schema:
        beside = {name: value for name, value in schema.items() if name != "$ref"}
        schema = {**CONTRACT["components"]["schemas"][schema["$ref"].rsplit("/", 1)[1]], **beside}
    return schema


TYPES = {"object": dict, "array": list, "string": str, "boolean": bool, "integer": int, "number": (int, float)}


def assert_conforms(value, schema, place=""):
    """As much of JSON Schema as the contract uses."""
    schema = resolve(schema)
    for part in schema.get("allOf", []):
        assert_conforms(value, part, place)
    if "type" in schema:
        assert isinstance(value, TYPES[schema["type"]]), place
        assert schema["type"] == "boolean" or not isinstance(value, bool), place
    assert value in schema.get("enum", [value]), place
    assert value == schema.get("const", value), place
    assert set(schema.get("required", [])) <= set(value) if isinstance(value, dict) else True, place
    for name, inner in schema.get("properties", {}).items():
        if name in value:
            assert_conforms(value[name], inner, f"{place}/{name}")
    if isinstance(value, list):
        assert schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", len(value)), place
        for i, element in enumerate(value):
            assert_conforms(element, schema.get("items", {}), f"{place}/{i}")
    if isinstance(value, (int, float)):
        assert schema.get("minimum", value) <= value <= schema.get("maximum", value), place


EXAMPLES = {
    "/web/{file}": "/web/app.js",
    "/v1/assets/{name}": "/v1/assets/example",
    "/v1/slab": "/v1/slab?optical_thickness=8&sun_zenith_deg=60",
    "/v1/sun": "/v1/sun?time=2024-06-21T12:00:00Z&latitude_deg=48&longitude_deg=11",
    "/v1/render": "/v1/render?output.width=16&output.height=16",
}


BODIES = {"/v1/compare": {"scene": {"output": {"width": 32, "height": 24}}, "variants": [{}, {"model": {"shading": "paper"}}]}}


METHODS = ("get", "head", "post", "put", "delete")


@pytest.fixture
def example_asset(daemon):
    assert daemon.request("PUT", "/v1/assets/example", PNG).status in (201, 204)
    yield
    daemon.request("DELETE", "/v1/assets/example")


@pytest.mark.parametrize("path, method", [(path, method) for path, item in CONTRACT["paths"].items() for method in item if method in METHODS])
def test_every_call_answers(daemon, example_asset, path, method):
    described = CONTRACT["paths"][path][method]["responses"]
    target = EXAMPLES.get(path, path)
    if method in ("put", "delete"):
        answer = daemon.request(method.upper(), target, PNG if method == "put" else None)
        assert answer.status == 204
        assert all(answer.headers[header] for header in described["204"].get("headers", {}))
        return
    if method == "post":
        body = BODIES.get(path, {"output": {"width": 16, "height": 16}})
        answer = daemon.request("POST", path, json.dumps(body), {"Content-Type": "application/json"})
    else:
        answer = daemon.request(method.upper(), target)
    assert answer.status == 200
    if method == "head":
        return
    response = described["200"]
    if "$ref" in response:
        response = CONTRACT["components"]["responses"][response["$ref"].rsplit("/", 1)[1]]
    assert answer.headers["Content-Type"].split(";")[0] in response["content"]
    for header, about in response.get("headers", {}).items():
        assert answer.headers[header] or about.get("required") is False, header
    schema = response["content"][answer.headers["Content-Type"].split(";")[0]].get("schema")
    if schema:
        assert_conforms(answer.json, schema)


@pytest.mark.parametrize("path", CONTRACT["paths"])
def test_methods(daemon, path):
    """The contract lists the methods that an address takes, no more and no fewer."""
    allowed = daemon.request("PATCH", EXAMPLES.get(path, path)).headers["Allow"]
    assert set(allowed.split(", ")) == {method.upper() for method in CONTRACT["paths"][path] if method in METHODS}


@pytest.mark.parametrize("path", CONTRACT["paths"])
def test_unknown_query(daemon, example_asset, path):
    """Members that a call does not know are refused, whatever the method; what is no call leaves its query unread."""
    target = EXAMPLES.get(path, path)
    target += ("&" if "?" in target else "?") + "x=1"
    for method in [name for name in ("GET", "HEAD", "DELETE") if name.lower() in CONTRACT["paths"][path]]:
        answer = daemon.request(method, target)
        assert answer.status == (422 if path.startswith("/v1/") else 200), method
        if method != "HEAD" and answer.status == 422:
            assert answer.pointers == {"/x"}
    if "put" in CONTRACT["paths"][path]:
        assert daemon.request("PUT", target, PNG).pointers == {"/x"}


def names_of(value):
    return {name: names_of(inner) for name, inner in value.items()} if isinstance(value, dict) else None


def names_in(schema):
    schema = resolve(schema)
    properties = dict(schema.get("properties", {}))
    for part in schema.get("allOf", []):
        properties.update(resolve(part).get("properties", {}))
    return {name: names_in(inner) for name, inner in properties.items()} if properties else None


@pytest.mark.parametrize("shading", ["solved", "paper", "montecarlo"])
def test_slab_answers_conform(daemon, shading):
    """Every answer holds what the contract describes and nothing else; that of photons holds all of it."""
    answer = daemon.get(f"/v1/slab?thickness_m=100&shading={shading}" + ("&photons=1000" if shading == "montecarlo" else "")).json
    schema = {"$ref": "#/components/schemas/Slab"}
    assert_conforms(answer, schema)
    described, found = names_in(schema), names_of(answer)
    if shading != "montecarlo":
        for name in ("photons", "seed", "standard_error"):
            del described[name]
    assert found == described


def slab_parameters():
    for reference in CONTRACT["paths"]["/v1/slab"]["get"]["parameters"]:
        parameter = CONTRACT["components"]["parameters"][reference["$ref"].rsplit("/", 1)[1]]
        if parameter["in"] == "query" and parameter["name"] != "members":
            yield pytest.param(parameter["name"], parameter["schema"], id=parameter["name"])


@pytest.mark.parametrize("name, schema", slab_parameters())
def test_slab_parameters(daemon, name, schema):
    """Ranges, choices, lengths and defaults as described."""
    needed = {} if name in ("optical_thickness", "thickness_m") else {"optical_thickness": 2}
    if name in ("photons", "seed"):
        needed["shading"] = "montecarlo"

    def check(value):
        text = ",".join(map(str, value)) if isinstance(value, list) else value
        answer = daemon.head("/v1/slab?" + "&".join(f"{n}={v}" for n, v in {**needed, name: text}.items()))
        return answer.status, answer.headers["ETag"]

    item = schema.get("items", schema)
    wrap = (lambda value: [value]) if "items" in schema else (lambda value: value)
    for choice in schema.get("enum", []):
        assert check(choice)[0] == 200
    assert check("other")[0] == 422
    if "maximum" in item:
        low, high = item.get("minimum", item.get("exclusiveMinimum")), item["maximum"]
        assert check(wrap(high))[0] == 200
        assert check(wrap(low))[0] == (200 if "minimum" in item else 422)
        assert check(wrap(high + step(item, high)))[0] == check(wrap(low - step(item, low)))[0] == 422
    if "maxItems" in schema:
        assert check([0] * schema["maxItems"])[0] == 200 and check([0] * (schema["maxItems"] + 1))[0] == 422
    if "default" in schema:
        plain = daemon.head("/v1/slab?" + "&".join(f"{n}={v}" for n, v in needed.items())).headers["ETag"]
        assert check(schema["default"]) == (200, plain)


def test_sky_answer_conforms(daemon):
    answer = daemon.get("/v1/sky").json
    assert_conforms(answer, {"$ref": "#/components/schemas/Sky"})
    assert names_of(answer) == names_in({"$ref": "#/components/schemas/Sky"})


@pytest.mark.parametrize("name", ["SkyViewZeniths", "SkyAzimuths"])
def test_sky_parameters(daemon, name):
    """Ranges, lengths and defaults as described."""
    parameter = CONTRACT["components"]["parameters"][name]
    schema, item = parameter["schema"], parameter["schema"]["items"]

    def check(values):
        answer = daemon.head(f"/v1/sky?{parameter['name']}={','.join(map(str, values))}")
        return answer.status, answer.headers["ETag"]

    assert check([item["minimum"], item["maximum"]])[0] == 200
    assert check([item["maximum"] + 1e-6])[0] == check([item["minimum"] - 1e-6])[0] == 422
    assert check([0] * schema["maxItems"])[0] == 200 and check([0] * (schema["maxItems"] + 1))[0] == 422
    assert check(schema["default"]) == (200, daemon.head("/v1/sky").headers["ETag"])


def test_served_contract_is_the_file(daemon):
    assert daemon.get("/openapi.yaml").body == (ROOT / "openapi.yaml").read_bytes()


def test_problems_match_their_schema(daemon):
    schema = CONTRACT["components"]["schemas"]["Problem"]
    for answer in (daemon.render("{"), daemon.render('{"x":1}'), daemon.get("/nothing")):
        assert set(schema["required"]) <= set(answer.json) <= set(schema["properties"])
