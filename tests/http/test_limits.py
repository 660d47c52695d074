"""Limits: each is met, its answer names it, and whoever keeps to it is served meanwhile. And requests that are none."""
import concurrent.futures
import json
import re
import socket
import time

import pytest

from conftest import FaultyDaemon, in_some_try, send, wait_for

READ_SECONDS = 3
FLAGS = {
    "--queue-length": 8, "--queue-mpixels": 4, "--picture-mpixels": 4, "--memory-mb": 64, "--connections": 24, "--connections-per-address": 10,
    "--header-max-kb": 4, "--body-max-kb": 2, "--read-timeout-s": READ_SECONDS,
}
HOST = b"Host: x\r\n"
POST = b"POST /v1/render HTTP/1.1\r\n" + HOST + b"Content-Type: application/json\r\n"


@pytest.fixture(scope="module")
def strict(tmp_path_factory):
    flags = [str(part) for flag in FLAGS.items() for part in flag]
    daemon = FaultyDaemon(tmp_path_factory.mktemp("strict"), *flags)
    yield daemon
    assert daemon.stop() == 0
    daemon.assert_clean()


def connect(daemon, address="127.0.0.1"):
    return socket.create_connection(("127.0.0.1", daemon.port), timeout=180, source_address=(address, 0))


def read_all(client):
    answer = b""
    try:
        while piece := client.recv(65536):
            answer += piece
    except ConnectionError:
        pass
    return answer


def ask(daemon, data, address="127.0.0.1"):
    """Sends bytes and reads until the daemon closes the connection, which it must."""
    with connect(daemon, address) as client:
        try:
            client.sendall(data)
        except ConnectionError:
            pass
        return read_all(client)


def status_of(answer):
    return int(answer.split(b" ", 2)[1]) if answer.startswith(b"HTTP/1.1 ") else None


def problem_of(answer):
    return json.loads(answer[answer.index(b"\r\n\r\n") + 4 :])


# --- sizes -------------------------------------------------------------------------------------------------------------------------


def test_body(strict):
    answer = strict.render(" " * 2049)
    assert answer.status == 413 and "--body-max-kb" in answer.json["detail"]
    assert strict.render("{" + " " * 2047).status == 400


def test_headers(strict):
    for request in (b"GET /healthz HTTP/1.1\r\nX-A: %s\r\n", b"GET /healthz?%s HTTP/1.1\r\n"):
        answer = ask(strict, request % (b"a" * 4200) + HOST + b"Connection: close\r\n\r\n")
        assert status_of(answer) == 431
        assert problem_of(answer)["type"] == "urn:stratus:problem:headers-too-large" and "--header-max-kb" in problem_of(answer)["detail"]
        assert status_of(ask(strict, request % (b"a" * 3900) + HOST + b"Connection: close\r\n\r\n")) == 200
    # What does not even fit into the memory of a connection.
    assert status_of(ask(strict, b"GET /healthz HTTP/1.1\r\n" + b"X-A: a\r\n" * 20000 + b"\r\n")) == 431
    assert status_of(ask(strict, b"GET /" + b"a" * 200000 + b" HTTP/1.1\r\n" + HOST + b"\r\n")) == 414


def test_pixels_of_a_picture(strict):
    answer = strict.render({"output": {"width": 2048, "height": 2064}})
    assert answer.status == 422 and answer.pointers == {"/output"}
    assert "4194304" in answer.json["errors"][0]["detail"] and "--picture-mpixels" in answer.json["errors"][0]["detail"]
    assert strict.head("/v1/render?output.width=2048&output.height=2048").status == 200
    layers = strict.render({"output": {"width": 1024, "height": 1024, "format": "exr", "layers": ["color", "sky", "ground", "air", "distance"]}})
    assert layers.status == 422 and layers.pointers == {"/output"}


def test_memory_of_one_picture(strict):
    """As EXR the allowed pixels take more than there is."""
    scene = {"output": {"width": 2048, "height": 2048, "format": "exr"}}
    answer = strict.render(scene)
    assert answer.status == 422 and answer.pointers == {"/output"} and "--memory-mb" in answer.json["errors"][0]["detail"]
    variants = {"scene": {"output": {"width": 2048, "height": 2048}}, "variants": [{"name": "a"}, {"name": "b", "model": {"shading": "paper"}}]}
    assert strict.request("POST", "/v1/compare", json.dumps(variants), {"Content-Type": "application/json"}).status == 422


def test_memory_and_pixels_of_all(strict):
    """A picture of 2.4 megapixels as EXR takes 54 MiB for a while: a second one is refused, what is small is not."""
    large = {"output": {"width": 1536, "height": 1536, "format": "exr"}, "clouds": {"type": "none"}, "camera": {"elevation_deg": 90}}
    small = {"output": {"width": 64, "height": 48}}
    rejected = strict.metric('stratus_queue_rejected_total{reason="memory"}')
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        with strict.holding():
            running = pool.submit(strict.render, large)
            assert wait_for(lambda: strict.metric("stratus_picture_memory_bytes") > 50e6)
            refused = strict.render({**large, "camera": {"elevation_deg": 80}})
            assert refused.status == 503 and refused.json["type"] == "urn:stratus:problem:memory-limit"
            assert "--memory-mb" in refused.json["detail"] and int(refused.headers["Retry-After"]) >= 1
            waiting = pool.submit(strict.render, small)
            assert wait_for(lambda: strict.metric("stratus_requests_in_flight") == 3)
        assert running.result().status == waiting.result().status == 200
    assert strict.render(small).status == 200
    assert wait_for(lambda: strict.metric("stratus_picture_memory_bytes") == 0)
    assert strict.metric('stratus_queue_rejected_total{reason="memory"}') == rejected + 1


def test_megapixels_that_wait(strict):
    """One runs, three of 1.2 megapixels wait, the fourth of them is one too many, though a small one may wait still."""
    scenes = [{"clouds": {"seed": 10 + i}, "output": {"width": 1280, "height": 960}} for i in range(4)]
    rejected = strict.metric('stratus_queue_rejected_total{reason="pixels"}')
    with concurrent.futures.ThreadPoolExecutor(1) as pool:
        with strict.busy():
            waiting = [send(strict, scene) for scene in scenes[:3]]
            assert wait_for(lambda: strict.metric("stratus_queue_depth") == 3)
            refused = strict.render(scenes[3])
            assert refused.status == 503 and refused.json["type"] == "urn:stratus:problem:queue-full"
            assert "--queue-mpixels" in refused.json["detail"] and refused.json["queue_depth"] == 3
            assert strict.metric('stratus_queue_rejected_total{reason="pixels"}') == rejected + 1
            small = pool.submit(strict.render, {"output": {"width": 64, "height": 48}, "clouds": {"seed": 14}})
            assert wait_for(lambda: strict.metric("stratus_queue_depth") == 4)
            for client in waiting:  # nothing of theirs need be rendered for this
                client.close()
            assert wait_for(lambda: strict.metric("stratus_queue_depth") == 1)
        assert small.result().status == 200


# --- connections -------------------------------------------------------------------------------------------------------------------


def test_connections_of_an_address(strict):
    """Beyond the limit of one address probes are answered, others are not harmed, and what is too much is closed at once."""
    assert wait_for(lambda: strict.metric("stratus_connections") == 1)
    held = [connect(strict, "127.0.0.5") for _ in range(10)]
    try:
        answer = ask(strict, b"GET /v1/presets HTTP/1.1\r\n" + HOST + b"\r\n", "127.0.0.5")
        assert status_of(answer) == 503 and problem_of(answer)["type"] == "urn:stratus:problem:connection-limit"
        assert "--connections-per-address" in problem_of(answer)["detail"] and b"Retry-After: " in answer and b"Connection: close" in answer
        for path in (b"/healthz", b"/readyz", b"/metrics"):
            assert status_of(ask(strict, b"GET " + path + b" HTTP/1.1\r\n" + HOST + b"\r\n", "127.0.0.5")) == 200
        assert strict.get("/v1/presets").status == 200
        # Idle ones among the surplus are closed soon, so that there is room for the next probe.
        began = time.monotonic()
        with connect(strict, "127.0.0.5") as idle:
            assert idle.recv(1) == b""
        assert time.monotonic() - began < 20

        def is_refused():
            """With eight more, before they are closed; as soon as all of them are counted, which takes a moment."""
            surplus = [connect(strict, "127.0.0.5") for _ in range(8)]
            closed = ask(strict, b"GET /healthz HTTP/1.1\r\n" + HOST + b"\r\n", "127.0.0.5") == b""
            for client in surplus:
                client.close()
            return closed

        assert wait_for(is_refused)
        assert strict.metric('stratus_connections_dropped_total{reason="refused"}') >= 1
    finally:
        for client in held:
            client.close()
    assert wait_for(lambda: strict.metric("stratus_connections") == 1)
    assert status_of(ask(strict, b"GET /v1/presets HTTP/1.1\r\n" + HOST + b"Connection: close\r\n\r\n", "127.0.0.5")) == 200


def test_connections_of_all(strict):
    """Full of idle clients from everywhere, the daemon still says how it is."""
    held = [connect(strict, f"127.0.1.{1 + i // 8}") for i in range(24)]
    try:
        assert wait_for(lambda: strict.metric("stratus_connections") == 25)
        assert strict.get("/healthz").status == 200
        assert strict.get("/readyz").status == 200
        answer = strict.render({"output": {"width": 32, "height": 24}})
        assert answer.status == 503 and answer.json["type"] == "urn:stratus:problem:connection-limit"
    finally:
        for client in held:
            client.close()
    assert wait_for(lambda: strict.metric("stratus_connections") == 1)
    assert strict.render({"output": {"width": 32, "height": 24}}).status == 200


# --- slowness ----------------------------------------------------------------------------------------------------------------------


def trickle(daemon, begin, piece):
    """Sends a byte every 0.2 s for as long as it is listened to. Returns (answer, seconds)."""
    began = time.monotonic()
    with connect(daemon) as client:
        client.sendall(begin)
        client.settimeout(0.2)
        while time.monotonic() - began < 180:
            try:
                answer = client.recv(65536)
                client.settimeout(180)
                return answer + (read_all(client) if answer else b""), time.monotonic() - began
            except socket.timeout:
                pass
            except ConnectionError:
                break
            try:
                client.sendall(piece)
            except ConnectionError:
                pass
    return b"", time.monotonic() - began


def test_slow_requests_are_closed(strict):
    """Header, body, upload and nothing at all after the first byte; a healthy client is served beside them."""
    dropped, rendered = 'stratus_connections_dropped_total{reason="slow"}', 'stratus_requests_total{route="/v1/render",status="408"}'
    before = strict.settled(dropped), strict.settled(rendered)
    openings = [
        (b"GET /healthz HTTP/1.1\r\n" + HOST, b"X: 1\r\n"),
        (b"GET /he", b"a"),
        (POST + b"Content-Length: 1000\r\n\r\n{", b" "),
        (POST + b"Transfer-Encoding: chunked\r\n\r\n", b"1\r\n \r\n"),
        (b"PUT /v1/assets/slow HTTP/1.1\r\n" + HOST + b"Content-Type: image/png\r\nContent-Length: 1000\r\n\r\n\x89PNG\r\n\x1a\n", b"x"),
    ]
    with concurrent.futures.ThreadPoolExecutor(len(openings)) as pool:
        ends = [pool.submit(trickle, strict, *opening) for opening in openings]
        assert strict.get("/v1/presets").status == 200
        for opening, end in zip(openings, ends):
            answer, seconds = end.result()
            assert status_of(answer) == 408, (opening, answer)
            assert problem_of(answer)["type"] == "urn:stratus:problem:request-timeout"
            assert READ_SECONDS - 0.1 <= seconds, opening
    assert wait_for(lambda: (strict.metric(dropped), strict.metric(rendered)) == (before[0] + len(openings), before[1] + 2))
    assert strict.get("/v1/assets/slow").status == 404


def test_a_slow_but_steady_body_is_read(strict):
    """More than there is for either: within the time for the headers and the body each, since time counts for them apart."""
    body = b"{x}"

    def is_read():
        with connect(strict) as client:
            client.sendall(POST)
            time.sleep(0.6 * READ_SECONDS)
            client.sendall(b"Connection: close\r\nContent-Length: %d\r\n\r\n" % len(body))
            time.sleep(0.6 * READ_SECONDS)
            client.sendall(body)
            return status_of(read_all(client)) == 400

    assert in_some_try(is_read)


# --- what is no request ------------------------------------------------------------------------------------------------------------

MALFORMED = {
    "no version": (b"GET /healthz\r\n\r\n", 400),
    "another version": (b"GET /healthz HTTP/9.9\r\n" + HOST + b"\r\n", 505),
    "no colon": (b"GET /healthz HTTP/1.1\r\n" + HOST + b"nonsense\r\n\r\n", 400),
    "a blank in a name": (b"GET /healthz HTTP/1.1\r\n" + HOST + b"X Y: 1\r\n\r\n", 400),
    "a blank before the colon": (POST + b"Content-Length : 2\r\n\r\n{}", 400),
    "length is a word": (POST + b"Content-Length: two\r\n\r\n{}", 400),
    "length below 0": (POST + b"Content-Length: -2\r\n\r\n{}", 400),
    "length with a sign": (POST + b"Content-Length: +2\r\n\r\n{}", 400),
    "length beyond numbers": (POST + b"Content-Length: 99999999999999999999999\r\n\r\n{}", 413),
    "two lengths": (POST + b"Content-Length: 2\r\nContent-Length: 50\r\n\r\n{}", 400),
    "length and chunks": (POST + b"Content-Length: 2\r\nTransfer-Encoding: chunked\r\n\r\n2\r\n{}\r\n0\r\n\r\n", 400),
    "chunks twice": (POST + b"Transfer-Encoding: chunked\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n", 400),
    "another coding": (POST + b"Transfer-Encoding: gzip\r\n\r\n{}", 400),
    "a chunk's size is a word": (POST + b"Transfer-Encoding: chunked\r\n\r\nzz\r\n{}\r\n0\r\n\r\n", 400),
    "a chunk is longer than its size": (POST + b"Transfer-Encoding: chunked\r\n\r\n1\r\n{}{}{}\r\n0\r\n\r\n", 400),
    "a method that is none": (b"BREW /v1/render HTTP/1.1\r\n" + HOST + b"Connection: close\r\n\r\n", 405),
    "TLS": (bytes.fromhex("16030100c8010000c40303") + bytes(200) + b"\r\n\r\n", 400),
    "zeros": (bytes(3), 400),
    "one word": (b"hello\r\n\r\n", 400),
}


@pytest.mark.parametrize("request_bytes, status", MALFORMED.values(), ids=MALFORMED.keys())
def test_malformed(strict, request_bytes, status):
    """Answered for what it is and not for its slowness, and the connection is closed: what follows might be anything."""
    assert status_of(ask(strict, request_bytes)) == status
    assert strict.get("/healthz").status == 200


def test_chunked_body(strict):
    scene = json.dumps({"output": {"width": 32, "height": 24}}).encode()
    chunks = b"".join(b"%x;name=value\r\n%s\r\n" % (1, scene[i : i + 1]) for i in range(len(scene)))
    answer = ask(strict, POST + b"Transfer-Encoding: Chunked\r\nConnection: close\r\n\r\n" + chunks + b"0\r\nX-Trailer: 1\r\n\r\n")
    assert status_of(answer) == 200 and b"\x89PNG" in answer


def test_pipelined(strict):
    """Answered in their order, a picture between two documents too."""
    scene = b'{"output": {"width": 32, "height": 24}}'
    answer = ask(
        strict,
        b"GET /healthz HTTP/1.1\r\n" + HOST + b"\r\n" + POST + b"Content-Length: %d\r\n\r\n" % len(scene) + scene
        + b"GET /v1/sun HTTP/1.1\r\n" + HOST + b"\r\nGET /readyz HTTP/1.1\r\n" + HOST + b"Connection: close\r\n\r\n",
    )
    assert re.findall(rb"HTTP/1\.1 (\d+) ", answer) == [b"200", b"200", b"422", b"200"]
    assert answer.index(b'"status":"ok"') < answer.index(b"\x89PNG") < answer.index(b"invalid-scene") < answer.index(b'"ready"')
