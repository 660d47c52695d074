"""Routes, errors, headers and conditional requests."""
import concurrent.futures
import gzip
import itertools
import json
import re
import socket
import urllib.parse

import pytest

from conftest import in_some_try, wait_for

SMALL = {"output": {"width": 32, "height": 24}}
SEEDS = itertools.count(700)  # of pictures that nobody else asks for
STAGES = ["queue", "optics", "sky", "field", "radiosity", "view", "readback", "encode", "total"]


def assert_problem(answer, status, kind):
    assert answer.status == status, answer.body
    assert answer.headers["Content-Type"] == "application/problem+json"
    assert answer.headers["Cache-Control"] == "no-store"
    problem = answer.json
    assert problem["status"] == status
    assert problem["type"] == "urn:stratus:problem:" + kind
    assert problem["title"] and problem["detail"]
    assert problem["request_id"] == answer.headers["X-Request-Id"]
    assert problem["instance"].endswith(problem["request_id"])


# --- images --------------------------------------------------------------------------------------------------------------------


def test_empty_scene_is_a_png(daemon):
    answer = daemon.render({})
    assert answer.status == 200
    assert answer.headers["Content-Type"] == "image/png"
    assert answer.body[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = int.from_bytes(answer.body[16:20], "big"), int.from_bytes(answer.body[20:24], "big")
    assert (width, height) == (1024, 768)


def test_headers_of_an_image(daemon):
    answer = daemon.render(SMALL)
    assert re.fullmatch(r'"[0-9a-f]{32}"', answer.headers["ETag"])
    assert answer.headers["Vary"] == "Accept"
    assert "max-age" in answer.headers["Cache-Control"]
    assert re.fullmatch(r"[0-9a-f]{32}", answer.headers["X-Scene-Key"])
    assert re.fullmatch(r"[0-9a-f]{32}", answer.headers["X-Request-Id"])
    assert answer.headers["Content-Location"] == "/v1/render?output.width=32&output.height=24"


def test_server_timing_names_every_stage(daemon):
    seeds = itertools.count(99)

    def parts_are_most_of_the_whole():
        timing = daemon.render({**SMALL, "clouds": {"seed": next(seeds)}}).timing
        assert list(timing) == STAGES
        assert all(float(stage["dur"]) >= 0 for stage in timing.values())
        assert re.fullmatch(r'"(\d+ passes, residual [0-9.e+-]+|reused)"', timing["radiosity"].get("desc", '"reused"'))
        # A scene that was never asked for: timers that do not run would say 0.
        assert all(float(timing[name]["dur"]) > 0 for name in ("field", "radiosity", "view", "readback", "encode"))
        parts = sum(float(stage["dur"]) for name, stage in timing.items() if name != "total")
        total = float(timing["total"]["dur"])
        assert parts <= total + 2
        return parts >= 0.5 * total

    assert in_some_try(parts_are_most_of_the_whole)


def test_a_stage_that_does_not_run_is_not_called_reused(daemon):
    for azimuth in (10, 11):
        timing = daemon.render({**SMALL, "clouds": {"type": "none"}, "camera": {"azimuth_deg": azimuth}}).timing
    assert "desc" not in timing["field"] and "desc" not in timing["radiosity"]
    assert timing["sky"].get("desc") == '"reused"'


def test_only_the_camera_changed_reuses_the_rest(daemon):
    daemon.render({**SMALL, "clouds": {"seed": 5}})
    timing = daemon.render({**SMALL, "clouds": {"seed": 5}, "camera": {"azimuth_deg": 10}}).timing
    assert timing["field"].get("desc") == '"reused"'
    assert timing["optics"].get("desc") == '"reused"'
    assert "desc" not in timing["view"]


def test_same_scene_same_bytes(daemon):
    scene = {**SMALL, "sun": {"elevation_deg": 22}}
    first = daemon.render(scene)
    second = daemon.render(json.dumps(scene, indent=3).replace("22", "2.20e1"), Cache_Control="no-cache")
    assert first.body == second.body
    assert first.headers["ETag"] == second.headers["ETag"]


def test_get_twin(daemon):
    scene = {
        "sun": {"elevation_deg": 12.5},
        "ground": {"type": "lambert", "albedo": [0.25, 0.5, 0.1]},
        "camera": {"position_m": [0, -100.5, 20]},
        "radiosity": {"enabled": False},
        "output": {"width": 40, "height": 30, "format": "exr", "layers": ["color", "sky"]},
    }
    posted = daemon.render(scene)
    fetched = daemon.get(posted.headers["Content-Location"], Cache_Control="no-cache")
    assert posted.status == fetched.status == 200
    assert posted.body == fetched.body
    assert posted.headers["ETag"] == fetched.headers["ETag"]
    assert fetched.headers["Content-Location"] == posted.headers["Content-Location"]


def test_twin_keeps_the_negotiated_format(daemon):
    posted = daemon.render(SMALL, Accept="image/x-exr")
    assert posted.headers["Content-Type"] == "image/x-exr"
    assert "output.format=exr" in posted.headers["Content-Location"]
    assert daemon.get(posted.headers["Content-Location"], Cache_Control="no-cache").body == posted.body


@pytest.mark.parametrize("form", ["png", "exr"])
def test_embedded_scene_is_canonical(daemon, read_image, form):
    scene = {"dsd": {"gamma": 3.25}, "clouds": {"seed": 4294967295}, "output": {"width": 32, "height": 32, "format": form}}
    first = daemon.render(scene)
    embedded = read_image(first.body)[1].getattribute("stratus:scene")
    assert json.loads(embedded)["dsd"] == {"n0_per_cm3": 300, "gamma": 3.25, "effective_radius_um": 7}
    again = daemon.render(embedded, Cache_Control="no-cache")
    assert again.body == first.body
    assert again.headers["ETag"] == first.headers["ETag"]


# --- conditional requests, HEAD -------------------------------------------------------------------------------------------------


def view_count(daemon):
    return daemon.settled('stratus_stage_duration_seconds_count{stage="view"}')


def test_not_modified_without_rendering(daemon):
    target = "/v1/render?output.width=32&output.height=24&clouds.seed=321"
    first = daemon.get(target)
    tag, count = first.headers["ETag"], view_count(daemon)
    for condition in (tag, "W/" + tag, '"other", ' + tag, "*"):
        answer = daemon.get(target, If_None_Match=condition)
        assert answer.status == 304 and answer.body == b""
        assert answer.headers["ETag"] == tag
        assert answer.headers["Vary"] == "Accept"
    assert daemon.head(target, If_None_Match=tag).status == 304
    assert view_count(daemon) == count
    assert daemon.get(target, If_None_Match='"other"').status == 200
    assert daemon.render({"output": {"width": 32, "height": 24}, "clouds": {"seed": 321}}, If_None_Match=tag).status == 200


def test_head_renders_nothing(daemon):
    target = "/v1/render?output.width=32&output.height=24&clouds.seed=322"
    count = view_count(daemon)
    answer = daemon.head(target)
    assert answer.status == 200 and answer.body == b""
    assert view_count(daemon) == count
    fetched = daemon.get(target)
    for name in ("ETag", "Content-Type", "Vary", "Content-Location", "X-Scene-Key", "Cache-Control"):
        assert answer.headers[name] == fetched.headers[name]


COMPUTED = ["/v1/render?output.width=32&output.height=24&clouds.seed=%d", "/v1/optics", "/v1/slab?optical_thickness=8&sun_zenith_deg=60", "/v1/sky"]


def read_head(client):
    head = b""
    while not head.endswith(b"\r\n\r\n"):
        head += (byte := client.recv(1))
        assert byte
    return head


@pytest.mark.parametrize("version", [b"1.1", b"1.0"])
@pytest.mark.parametrize("target", [*COMPUTED, "/v1/sun", "/v1/presets", "/", "/nothing", "/openapi.yaml"])
def test_nothing_follows_the_headers_of_a_head(daemon, target, version):
    """Byte for byte: what comes behind them would begin the next answer. Two HEADs and a GET, for as long as the connection is kept."""
    target = target.replace("%d", str(next(SEEDS))).encode()
    kept = 0
    with socket.create_connection(("127.0.0.1", daemon.port), timeout=180) as client:
        for method, asked in ((b"HEAD", target), (b"HEAD", target), (b"GET", b"/healthz")):
            client.sendall(method + b" " + asked + b" HTTP/" + version + b"\r\nHost: x\r\n\r\n")
            head = read_head(client)
            assert head.startswith(b"HTTP/1.1 ") and b"Transfer-Encoding" not in head
            if b"Connection: close" in head or version == b"1.0":
                break
            kept += 1
        if method == b"HEAD":
            assert client.recv(100) == b""
    if version == b"1.1":
        assert kept == (0 if head.startswith(b"HTTP/1.1 200 ") and method == b"HEAD" else 3)


@pytest.mark.parametrize("target", COMPUTED)
def test_a_get_behind_a_head(daemon, target):
    """As a client does it that keeps its connections where it may; and what it asks for has all of its bytes."""
    target = target.replace("%d", str(next(SEEDS)))
    connection = daemon.connect()
    tags = []
    for method in ("HEAD", "GET", "HEAD", "GET"):
        connection.request(method, target)
        answer = connection.getresponse()
        body = answer.read()
        assert answer.status == 200 and bool(body) == (method == "GET")
        assert method == "HEAD" or len(body) == int(answer.headers["Content-Length"])
        tags.append(answer.headers["ETag"])
    assert len(set(tags)) == 1
    connection.close()


def test_documents_are_conditional(daemon):
    for target in ("/openapi.yaml", "/v1/presets", "/", "/v1/optics"):
        tag = daemon.get(target).headers["ETag"]
        assert daemon.get(target, If_None_Match=tag).status == 304


# --- errors ----------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("body", ["", "{", "{'sun':1}", '{"sun": NaN}', "[1,2", b"\xff\xfe", '{"a":"\x01"}', "[" * 100000])
def test_not_json(daemon, body):
    answer = daemon.render(body)
    assert_problem(answer, 400, "not-json")
    assert re.search(r"line \d+, column \d+", answer.json["detail"])


def test_line_and_column(daemon):
    assert "line 3, column 12" in daemon.render('{\n "sun": {\n  "gamma": }}').json["detail"]


def test_every_bad_member_at_once(daemon):
    answer = daemon.render(
        '{"sun": {"elevation_deg": 91, "azimuth_deg": "north"}, "moon": {}, "dsd": {"gamma": 1e999, "n0_per_cm3": 1, "n0_per_cm3": 2},'
        '"clouds": {"type": "nimbus", "wind_mps": [1, 2, 3]}, "camera": {"position_m": [0, 0, 1e5]},'
        '"ground": {"albedo": [1, 1, 1]}, "model": {"shading": "toon"}, "output": {"layers": ["sky"], "x/y": 0}}'
    )
    assert_problem(answer, 422, "invalid-scene")
    assert answer.pointers == {
        "/sun/elevation_deg",
        "/sun/azimuth_deg",
        "/moon",
        "/dsd/gamma",
        "/dsd/n0_per_cm3",
        "/clouds/type",
        "/clouds/wind_mps",
        "/camera/position_m/2",
        "/ground/albedo",
        "/model/shading",
        "/output/x~1y",
    }


@pytest.mark.parametrize(
    "scene, pointer",
    [
        ({"sun": {"time": "2024-06-21T12:00:00Z", "latitude_deg": 48, "longitude_deg": 11, "azimuth_deg": 3}}, "/sun/azimuth_deg"),
        ({"sun": {"time": "2024-06-21T12:00:00Z", "latitude_deg": 48}}, "/sun/longitude_deg"),
        ({"sun": {"time": "2024-06-21T00:00:00Z", "latitude_deg": 0, "longitude_deg": 0}}, "/sun/time"),
        ({"dsd": {"effective_radius_um": 7, "characteristic_radius_um": 2}}, "/dsd/effective_radius_um"),
        ({"dsd": {"effective_radius_um": 30, "n0_per_cm3": 1000}}, "/dsd"),
        ({"ground": {"type": "snow", "albedo": [0, 0, 0]}}, "/ground/albedo"),
        ({"ground": {"type": "lambert", "albedo": [0.9, 0, 0], "albedo_scale": 1.2}}, "/ground/albedo_scale"),
        ({"camera": {"position_m": [0, 0, 1300]}}, "/camera/position_m/2"),
        ({"output": {"width": 8192, "height": 8192, "format": "exr", "layers": ["sky", "air"]}}, "/output"),
        ({"output": {"format": "png", "layers": ["color", "sky"]}}, "/output/layers"),
        ({"camera": {"projection": "fisheye", "azimuth_deg": 0}}, "/camera/azimuth_deg"),
        ({"camera": {"projection": "equirectangular", "face": "+X"}}, "/camera/face"),
        ({"camera": {"projection": "equirectangular"}, "output": {"width": 512, "height": 512}}, "/output/height"),
        ({"camera": {"projection": "equirectangular"}, "output": {"width": 513}}, "/output/width"),
        ({"camera": {"projection": "cubemap"}, "output": {"width": 2048}}, "/output/width"),
        ([], ""),
    ],
)
def test_rules_across_members(daemon, scene, pointer):
    answer = daemon.render(scene)
    assert_problem(answer, 422, "invalid-scene")
    assert answer.pointers == {pointer}


@pytest.mark.parametrize(
    "section, member, values",
    [
        ("model", "name", ["volume", "planar"]),
    ],
)
def test_later_members_say_so(daemon, section, member, values):
    for value in values:
        answer = daemon.render({section: {member: value}})
        assert_problem(answer, 422, "invalid-scene")
        assert any(e["pointer"] == f"/{section}/{member}" and "not available yet" in e["detail"] for e in answer.json["errors"])


@pytest.mark.parametrize("albedo", [0.6, 0.55, 0.7, 0.87])
def test_the_limit_that_an_error_names_is_taken(daemon, albedo):
    scene = {"ground": {"type": "lambert", "albedo": [albedo] * 3, "albedo_scale": 2}, "output": {"width": 32, "height": 24}}
    detail = daemon.render(scene).json["errors"][0]["detail"]
    scene["ground"]["albedo_scale"] = float(detail.split("at most ")[1].split()[0])
    assert daemon.render(scene).status == 200


def test_not_found(daemon):
    for path in ("/nothing", "/v1/render/", "/v1", "//", "/../etc/passwd", "/v1/renderx", "/v1/slabx"):
        assert_problem(daemon.get(path), 404, "not-found")
    assert_problem(daemon.request("POST", "/nothing", "{}"), 404, "not-found")


@pytest.mark.parametrize("path", ["/v1/optics", "/v1/slab", "/v1/sun", "/v1/presets", "/healthz", "/readyz", "/metrics", "/openapi.yaml", "/"])
def test_method_not_allowed(daemon, path):
    answer = daemon.request("POST", path, "{}", {"Content-Type": "application/json"})
    assert_problem(answer, 405, "method-not-allowed")
    assert answer.headers["Allow"] == "GET, HEAD"


def test_render_methods(daemon):
    for method in ("PUT", "DELETE", "PATCH", "OPTIONS"):
        answer = daemon.request(method, "/v1/render")
        assert_problem(answer, 405, "method-not-allowed")
        assert answer.headers["Allow"] == "GET, HEAD, POST"


def test_media_types(daemon):
    for kind in ("text/plain", "application/x-www-form-urlencoded", "image/png"):
        assert_problem(daemon.render(SMALL, Content_Type=kind), 415, "unsupported-media-type")
    assert daemon.render(SMALL, Content_Type="application/json; charset=utf-8").status == 200
    assert daemon.request("POST", "/v1/render", json.dumps(SMALL)).status == 200
    assert_problem(daemon.render(gzip.compress(b"{}"), Content_Encoding="gzip"), 415, "unsupported-media-type")
    assert daemon.render(SMALL, Content_Encoding="identity").status == 200


def test_accept(daemon):
    exr = {"output": {"width": 16, "height": 16, "format": "exr"}}
    for accept, scene, expected in [
        ("*/*", SMALL, "image/png"),
        ("image/*", exr, "image/x-exr"),
        ("image/png", exr, "image/png"),
        ("image/avif,image/webp,image/png,image/*;q=0.8,*/*;q=0.5", exr, "image/png"),
        ("image/png;q=0.4, image/x-exr", SMALL, "image/x-exr"),
        ("text/html, */*;q=0.1", exr, "image/x-exr"),
    ]:
        answer = daemon.render(scene, Accept=accept)
        assert (answer.status, answer.headers["Content-Type"]) == (200, expected)
    for accept in ("text/html", "image/png;q=0", "image/jpeg, */*;q=0"):
        assert_problem(daemon.render(SMALL, Accept=accept), 406, "not-acceptable")


@pytest.mark.parametrize("value", ["0", "-1", "abc", "1.5", "99999999999999999999", ""])
def test_bad_timeout(daemon, value):
    assert_problem(daemon.render(SMALL, X_Timeout_Ms=value), 400, "bad-request")


def test_deadline(daemon):
    scene = {"clouds": {"seed": 777}, "output": {"width": 2048, "height": 1536}}
    answer = daemon.render(scene, X_Timeout_Ms="1")
    assert_problem(answer, 504, "deadline-passed")
    assert daemon.metric('stratus_renders_ended_total{reason="expired"}') >= 1


def test_a_late_image_is_not_sent(daemon):
    """A deadline that ends while the image is encoded counts as well."""
    scene = {"output": {"width": 1280, "height": 1280, "png_compression": "small"}}
    timing = daemon.render(scene).timing
    allowed = int(float(timing["total"]["dur"]) - 0.7 * float(timing["encode"]["dur"]))
    azimuths = itertools.count(1)

    def is_kept():
        answer = daemon.render({**scene, "camera": {"azimuth_deg": next(azimuths)}}, X_Timeout_Ms=str(allowed))
        assert answer.status in (200, 504)
        return answer.status == 504 or float(answer.timing["total"]["dur"]) < allowed + 50

    assert in_some_try(is_kept)
    assert in_some_try(is_kept)


@pytest.mark.parametrize("query", ["a=%zz", "sun.elevation_deg=%00", "a=%ff", "&".join("a=1" for _ in range(200))])
def test_bad_query(daemon, query):
    assert_problem(daemon.get("/v1/render?" + query), 400, "bad-request")


def test_a_scene_comes_in_one_place(daemon):
    """What stands in the other is refused rather than left unheard."""
    posted = daemon.request("POST", "/v1/render?sun.elevation_deg=5", json.dumps(SMALL), {"Content-Type": "application/json"})
    assert_problem(posted, 400, "bad-request")
    target = "/v1/render?output.width=32&output.height=24"
    assert_problem(daemon.request("GET", target, json.dumps(SMALL)), 400, "bad-request")
    assert daemon.request("POST", "/v1/render?", json.dumps(SMALL), {"Content-Type": "application/json"}).status == 200


def test_query_errors_have_pointers(daemon):
    answer = daemon.get("/v1/render?sun.elevation_deg=91&sun.azimuth_deg=x&camera.position_m=0,0&output.width=16&output.width=16&q=1")
    assert_problem(answer, 422, "invalid-scene")
    assert answer.pointers == {"/sun/elevation_deg", "/sun/azimuth_deg", "/camera/position_m", "/output/width", "/q"}


# --- bodies too large ------------------------------------------------------------------------------------------------------------


def test_largest_body_is_read(daemon):
    body = json.dumps({"moon": "x" * (1048576 - 12)})
    assert len(body) == 1048576
    assert_problem(daemon.render(body), 422, "invalid-scene")


def test_announced_body_is_refused_before_it_is_sent(daemon):
    with socket.create_connection(("127.0.0.1", daemon.port), timeout=180) as client:
        client.sendall(b"POST /v1/render HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\nContent-Length: 1048577\r\n\r\n")
        assert client.recv(64).startswith(b"HTTP/1.1 413 ")


def test_chunked_body_is_refused_while_being_read(daemon):
    """No length is announced, and the body never ends: the answer must come in between."""
    with socket.create_connection(("127.0.0.1", daemon.port), timeout=180) as client:
        client.sendall(
            b"POST /v1/render HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\nTransfer-Encoding: chunked\r\n"
            b"X-Request-Id: endless\r\n\r\n"
        )
        sent, answer = 0, b""
        client.settimeout(0.01)
        chunk = b"10000\r\n" + b" " * 65536 + b"\r\n"
        while not answer and sent < 64 << 20:
            try:
                client.settimeout(180)
                client.sendall(chunk)
                sent += 65536
                client.settimeout(0.002)
                answer = client.recv(4096)
            except socket.timeout:
                continue
            except ConnectionError:
                client.settimeout(180)
                answer = client.recv(4096)
        assert answer.startswith(b"HTTP/1.1 413 "), answer
        assert b"body-too-large" in answer and b"X-Request-Id: endless" in answer and b"Server-Timing: total;dur=" in answer
        assert sent < 32 << 20  # with what fits into the buffers between
    assert daemon.get("/healthz").status == 200


def test_body_of_a_get_is_bounded_too(daemon):
    assert daemon.request("GET", "/v1/render", b" " * (2 << 20)).status == 413


def test_half_sent_request_harms_nobody(daemon):
    for piece in (b"POST /v1/render HT", b"POST /v1/render HTTP/1.1\r\nHost: x\r\nContent-Length: 100\r\n\r\n{", b"\0\0\0\r\n\r\n", b"GET / HTTP/9.9\r\n\r\n"):
        with socket.create_connection(("127.0.0.1", daemon.port), timeout=180) as client:
            client.sendall(piece)
    assert daemon.get("/healthz").status == 200


# --- request ids -----------------------------------------------------------------------------------------------------------------


def test_request_id(daemon):
    assert daemon.get("/healthz", X_Request_Id="abc-123/x:y").headers["X-Request-Id"] == "abc-123/x:y"
    for bad in ("x" * 129, 'a"b', "a b", "<script>", ""):
        answer = daemon.get("/healthz", X_Request_Id=bad)
        assert re.fullmatch(r"[0-9a-f]{32}", answer.headers["X-Request-Id"])
    assert daemon.render("{", X_Request_Id="of-an-error").json["request_id"] == "of-an-error"


# --- other calls -----------------------------------------------------------------------------------------------------------------


def test_bad_scenes_cost_no_gpu_time(daemon):
    count = view_count(daemon)
    for body in ("{", "[]", '{"x":1}', '{"sun":{"elevation_deg":95}}', '{"output":{"width":1e9}}'):
        assert daemon.render(body).status in (400, 422)
    daemon.render({}, Accept="text/html")
    assert view_count(daemon) == count
    daemon.render({**SMALL, "clouds": {"seed": 1234}})
    assert view_count(daemon) == count + 1


def test_probes(daemon):
    assert daemon.get("/healthz").json["status"] == "ok"
    answer = daemon.get("/readyz")
    ready = answer.json
    assert answer.status == 200 and answer.headers["Cache-Control"] == "no-store"
    assert ready["status"] == "ready"
    assert all(ready[name] for name in ("vendor", "renderer", "version"))
    assert isinstance(ready["software"], bool)


def test_index(daemon):
    answer = daemon.get("/")
    assert answer.headers["Content-Type"].startswith("text/html")
    for target in re.findall(r'(?:href|src)="([^"]+)"', answer.body.decode()):
        address, _ = urllib.parse.urldefrag(urllib.parse.urljoin("/", target.replace("&amp;", "&")))
        assert daemon.head(address).status == 200, target


def test_presets(daemon):
    presets = daemon.get("/v1/presets").json["presets"]
    assert {p["name"] for p in presets} >= {"noon-ground", "sunset-above", "glory-fogbow", "silver-lining", "water-sky", "snow-radiosity"}
    for preset in presets:
        assert set(preset) == {"name", "title", "description", "scene"}
        scene = dict(preset["scene"])
        scene["output"] = {**scene.get("output", {}), "width": 32}  # panoramas have a height of their own
        assert daemon.render(scene).status == 200, preset["name"]


def test_many_at_once(daemon):
    def one(i):
        return daemon.render({"output": {"width": 64, "height": 48}, "clouds": {"seed": i % 5}}), i

    with concurrent.futures.ThreadPoolExecutor(16) as pool:
        answers = list(pool.map(one, range(40)))
    bodies = {}
    for answer, i in answers:
        assert answer.status == 200
        assert bodies.setdefault(i % 5, answer.body) == answer.body


def test_keep_alive(daemon):
    connection = daemon.connect()
    for body in ("{", json.dumps(SMALL), "{}x", json.dumps(SMALL)):
        connection.request("POST", "/v1/render", body, {"Content-Type": "application/json"})
        response = connection.getresponse()
        response.read()
        assert response.status == (200 if body == json.dumps(SMALL) else 400)
    connection.close()


# --- metrics ---------------------------------------------------------------------------------------------------------------------


def parse_metrics(text):
    """{sample: value}, checking the form of OpenMetrics on the way."""
    lines = text.split("\n")
    assert lines[-2:] == ["# EOF", ""]
    families, samples = {}, {}
    for line in lines[:-2]:
        if line.startswith("# TYPE "):
            _, _, name, kind = line.split(" ")
            assert name not in families
            families[name] = kind
            continue
        if line.startswith("# HELP "):
            assert line.split(" ")[2] in families
            continue
        match = re.fullmatch(r'([a-z_]+)(\{(?:[a-z_]+="(?:[^"\\]|\\.)*",?)*\})? (\S+)', line)
        assert match, line
        name = match[1]
        assert name.startswith("stratus_")
        family = next(f for f in (name, re.sub(r"_(total|info|bucket|count|sum)$", "", name)) if f in families)
        if families[family] == "counter":
            assert name.endswith("_total")
        samples[match[1] + (match[2] or "")] = float(match[3])
    return samples


def test_metrics_form(daemon):
    answer = daemon.get("/metrics")
    assert answer.headers["Content-Type"].startswith("application/openmetrics-text")
    samples = parse_metrics(answer.body.decode())
    assert samples['stratus_build_info{version="0.4.0"}'] == 1
    assert any(name.startswith("stratus_gl_info{vendor=") for name in samples)
    assert samples["stratus_process_resident_memory_bytes"] > 1e6
    assert samples["stratus_queue_depth"] >= 0
    for stage in STAGES:
        buckets = [v for k, v in samples.items() if k.startswith(f'stratus_stage_duration_seconds_bucket{{stage="{stage}"')]
        assert buckets == sorted(buckets)
        assert buckets[-1] == samples[f'stratus_stage_duration_seconds_count{{stage="{stage}"}}']


def test_metrics_count(daemon):
    sample = 'stratus_requests_total{route="/v1/render",status="422"}'
    before = daemon.settled(sample)
    for _ in range(3):
        daemon.render('{"x":1}')
    assert wait_for(lambda: daemon.metric(sample) == before + 3)


def test_unknown_paths_share_one_label(daemon):
    for i in range(5):
        daemon.get(f"/scan/{i}")
    samples = parse_metrics(daemon.get("/metrics").body.decode())
    routes = {re.search(r'route="([^"]*)"', name)[1] for name in samples if "route=" in name}
    known = set(
        "/v1/render /v1/compare /v1/optics /v1/slab /v1/sky /v1/sun /v1/assets /v1/assets/NAME /v1/presets / /openapi.yaml /healthz /readyz /metrics other".split()
    )
    assert routes <= known
