"""One line a request, as text or JSON."""
import json
import re
import socket

import pytest

from conftest import Daemon, wait_for

SMALL = {"output": {"width": 32, "height": 24}}
MEMBERS = {"time", "level", "event", "id", "method", "path", "status", "duration_ms", "bytes", "stages_ms", "reused"}


def parse_text(line):
    """The members of a line of text, in the types of the JSON form."""
    stamp, level, event, *rest = re.findall(r'(?:[^\s"]|"(?:[^"\\]|\\.)*")+', line)
    record = {"time": stamp, "level": level, "event": event, "stages_ms": {}, "reused": []}
    for pair in rest:
        name, value = pair.split("=", 1)
        stage = re.fullmatch(r"([a-z]+)_ms", name)
        if stage and stage[1] != "duration":
            milliseconds, _, reused = value.partition(",")
            record["stages_ms"][stage[1]] = float(milliseconds)
            record["reused"] += [stage[1]] if reused else []
        elif name in ("status", "bytes", "duration_ms"):
            record[name] = json.loads(value)
        else:
            record[name] = json.loads(value) if value.startswith('"') else value
    return record


def records(daemon, form):
    if form == "json":
        return [json.loads(line) for line in daemon.lines]
    return [parse_text(line) for line in daemon.lines if " request id=" in line]


def requests_of(daemon, form):
    return [record for record in records(daemon, form) if record.get("event") == "request"]


def wait_for_requests(daemon, form, count):
    assert wait_for(lambda: len(requests_of(daemon, form)) >= count)
    return requests_of(daemon, form)


@pytest.fixture(scope="module", params=["json", "text"])
def talkative(request, tmp_path_factory):
    """(daemon, form of its lines): it logs whatever there is."""
    daemon = Daemon(tmp_path_factory.mktemp("talkative"), "--log-format", request.param, "--log-level", "debug")
    yield daemon, request.param
    assert daemon.stop() == 0
    daemon.assert_clean()


def test_exactly_one_line_a_request(talkative):
    """Whatever the answer is: its line has the status and the bytes that the client saw."""
    daemon, form = talkative
    calls = [
        ("POST", "/v1/render", json.dumps(SMALL), {"Content-Type": "application/json"}),
        ("POST", "/v1/render", "{", {"Content-Type": "application/json"}),
        ("POST", "/v1/render", b" " * (2 << 20), {"Content-Type": "application/json"}),
        ("GET", "/v1/render?output.width=32&output.height=24", None, {}),
        ("GET", "/v1/render?output.width=32&output.height=24", None, {"If-None-Match": "*"}),
        ("HEAD", "/v1/render?output.width=32&output.height=24", None, {}),
        ("GET", "/v1/optics", None, {}),
        ("GET", "/v1/slab?optical_thickness=8&sun_zenith_deg=60", None, {}),
        ("GET", "/v1/sky?view_zenith_deg=0&azimuth_deg=0", None, {}),
        ("GET", "/v1/sun", None, {}),
        ("GET", "/v1/presets", None, {}),
        ("GET", "/v1/assets", None, {}),
        ("GET", "/", None, {}),
        ("HEAD", "/openapi.yaml", None, {}),
        ("GET", '/no"thing%20here', None, {}),
        ("DELETE", "/v1/render", None, {}),
        ("GET", "/healthz", None, {}),
        ("GET", "/readyz", None, {}),
        ("GET", "/metrics", None, {}),
    ]
    answers = {}
    for i, (method, target, body, headers) in enumerate(calls):
        answers[f"call-{i}"] = daemon.request(method, target, body, {**headers, "X-Request-Id": f"call-{i}"})

    def of_calls():
        return [record for record in requests_of(daemon, form) if record["id"].startswith("call-")]

    assert wait_for(lambda: len(of_calls()) >= len(calls))
    daemon.settle()
    found = of_calls()
    assert sorted(record["id"] for record in found) == sorted(answers)
    for i, (method, target, _, _) in enumerate(calls):
        (record,) = [r for r in found if r["id"] == f"call-{i}"]
        answer = answers[record["id"]]
        assert set(record) - {"scene", "problem"} == MEMBERS
        assert ("problem" in record) == (record["status"] >= 400)
        if record["status"] >= 400 and method != "HEAD":
            assert answer.json["type"] == "urn:stratus:problem:" + record["problem"]
        assert record["method"] == method and record["path"] == target.split("?")[0]
        assert record["status"] == answer.status
        assert record["bytes"] == len(answer.body), target
        assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z", record["time"])
        assert record["level"] == ("debug" if target in ("/healthz", "/readyz", "/metrics") else "info")
        assert record["duration_ms"] >= 0


def test_line_of_a_picture(talkative):
    daemon, form = talkative
    scenes = [SMALL, SMALL, {**SMALL, "clouds": {"seed": 9}}, {"output": {"height": 24, "width": 32}, "sun": {"elevation_deg": 35}}]
    answers = [daemon.render(scene) for scene in scenes]
    daemon.settle()
    written = {line["id"]: line for line in requests_of(daemon, form)}
    lines = [written[answer.headers["X-Request-Id"]] for answer in answers]  # a quick one may end before the one before it
    for line, answer in zip(lines, answers):
        timing = answer.timing
        del timing["total"]
        assert {name: float(stage["dur"]) for name, stage in timing.items()} == line["stages_ms"]
        assert [name for name, stage in timing.items() if stage.get("desc") == '"reused"'] == line["reused"]
        assert re.fullmatch(r"[0-9a-f]{32}", line["scene"])
        assert line["duration_ms"] >= sum(line["stages_ms"].values()) - 2
    hashes = [line["scene"] for line in lines]
    assert hashes[0] == hashes[1] == hashes[3] != hashes[2]


LARGE = {"clouds": {"type": "none"}, "output": {"width": 1024, "height": 1024, "format": "exr", "exr_type": "float", "exr_compression": "none"}}
READ = 100000  # bytes of its body that a client reads before it leaves
WINDOW = 65536  # bytes on their way to a client that asked for a small buffer: more than the system gives it


def test_who_leaves_in_the_middle(talkative):
    """An answer larger than all buffers between: what counts is what was delivered, and that the client left."""
    daemon, form = talkative
    body = json.dumps(LARGE).encode()
    left, sent = 'stratus_requests_total{route="/v1/render",status="499"}', 'stratus_response_bytes_total{route="/v1/render"}'
    whole = 'stratus_requests_total{route="/v1/render",status="200"}'
    before = [daemon.settled(name) for name in (left, whole, sent)]
    with socket.socket() as client:
        client.settimeout(300)
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        client.connect(("127.0.0.1", daemon.port))
        client.sendall(
            b"POST /v1/render HTTP/1.1\r\nHost: x\r\nX-Request-Id: leaver\r\nContent-Type: application/json\r\nContent-Length: %d\r\n\r\n" % len(body)
            + body
        )
        answer = b""
        while b"\r\n\r\n" not in answer:
            answer += client.recv(1)
        size = int(re.search(rb"Content-Length: (\d+)", answer)[1])
        assert answer.startswith(b"HTTP/1.1 200 ") and size > 12e6
        left_to_read = READ
        while left_to_read > 0:
            left_to_read -= len(client.recv(left_to_read))
    assert wait_for(lambda: any(r["id"] == "leaver" for r in requests_of(daemon, form)))
    (line,) = [r for r in requests_of(daemon, form) if r["id"] == "leaver"]
    assert line["status"] == 499 and int(line["cut"]) == 200
    assert READ - WINDOW <= line["bytes"] <= READ + WINDOW
    assert wait_for(lambda: [daemon.metric(name) for name in (left, whole, sent)] == [before[0] + 1, before[1], before[2] + line["bytes"]])


def test_every_line_is_an_object(start_daemon):
    """From the first to the last, of requests that cannot be read and of clients that leave too."""
    daemon = start_daemon("--log-format=json", "--log-level=debug")
    with socket.create_connection(("127.0.0.1", daemon.port), timeout=180) as client:
        client.sendall(b"GET /some\xff\xc3\xa9\"where HTTP/1.1\r\nHos")
    wait_for_requests(daemon, "json", 1)
    daemon.render({**SMALL, "ground": {"map": "none\n\"x"}})
    assert daemon.stop() == 0
    found = records(daemon, "json")
    for record in found:
        assert record["level"] in ("error", "warning", "info", "debug")
        assert ("message" in record) != ("event" in record)
    (line,) = [r for r in found if r.get("status") == 400]
    assert line["path"] == '/some\ufffdé"where' and line["method"] == "" and line["problem"] == "bad-request"
    assert any(record.get("message", "").startswith("SIGTERM") for record in found)


def test_lines_are_cut_and_not_forged(start_daemon):
    """And probes are quiet."""
    daemon = start_daemon()
    for target in ("/healthz", "/readyz", "/metrics"):
        daemon.get(target)
    daemon.get("/" + "x" * 3000)
    daemon.get("/a%0a2026-01-01T00:00:00.000Z%20info%20forged", X_Request_Id="evil\tid=1")
    wait_for_requests(daemon, "text", 2)
    daemon.settle()
    found = requests_of(daemon, "text")
    assert len(found) == 2
    forged, cut = sorted(found, key=lambda record: len(record["path"]))  # of two threads either may write first
    assert cut["path"] == "/" + "x" * 199
    assert forged["path"].startswith("/a%0a2026")
    assert re.fullmatch(r"[0-9a-f]{32}", forged["id"])
