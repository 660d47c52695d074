"""One render for equal requests: those in flight share it, later ones get the finished image, and nobody gets what is not theirs."""
import concurrent.futures
import json
import signal
import socket
import time

import numpy
import OpenImageIO as oiio
import pytest

from conftest import query_of, wait_for

SMALL = {"width": 64, "height": 48}
LARGE = {"width": 2048, "height": 1536}
STAGES = ["optics", "sky", "field", "radiosity", "view", "readback", "encode"]


def count(daemon, source):
    return daemon.metric(f'stratus_image_requests_total{{source="{source}"}}')


def encoded(daemon):
    return daemon.metric('stratus_stage_duration_seconds_count{stage="encode"}')


def status_of(answer):
    return [part.strip() for part in answer.headers["Cache-Status"].split(";")]


# --- finished images -------------------------------------------------------------------------------------------------------------


def test_the_second_is_not_rendered(daemon):
    scene = {"clouds": {"seed": 41001}, "output": SMALL}
    first = daemon.render(scene)
    assert status_of(first) == ["stratus", "fwd=miss", "stored"]
    before, hits, pictures = encoded(daemon), count(daemon, "hit"), daemon.metric("stratus_picture_pixels_count")
    again, twin = daemon.render(scene), daemon.get("/v1/render?" + query_of(scene))
    for answer in (again, twin):
        assert answer.status == 200 and answer.body == first.body
        assert status_of(answer) == ["stratus", "hit"]
        assert "Age" not in answer.headers
        for name in ("ETag", "Content-Type", "Content-Location", "X-Scene-Key", "Vary", "Cache-Control", "Content-Length"):
            assert answer.headers[name] == first.headers[name]
        assert answer.headers["X-Request-Id"] != first.headers["X-Request-Id"]
        timing = answer.timing
        assert timing["cache"]["desc"] == '"hit"'
        assert all(timing[stage] == {"desc": '"reused"', "dur": "0.000"} for stage in STAGES)
    assert encoded(daemon) == before
    assert count(daemon, "hit") == hits + 2
    assert daemon.metric("stratus_picture_pixels_count") == pictures + 2


def test_what_the_request_says_of_caches(daemon):
    scene = {"clouds": {"seed": 41002}, "output": SMALL}
    assert status_of(daemon.render(scene, Cache_Control="max-age=0, no-store")) == ["stratus", "fwd=request"]
    assert status_of(daemon.render(scene)) == ["stratus", "fwd=miss", "stored"]
    before, bypassed = encoded(daemon), count(daemon, "bypass")
    assert status_of(daemon.render(scene, Cache_Control="No-Cache")) == ["stratus", "fwd=request", "stored"]
    assert status_of(daemon.get("/v1/render?" + query_of(scene), Cache_Control="no-store")) == ["stratus", "fwd=request"]
    assert encoded(daemon) == before + 2
    assert count(daemon, "bypass") == bypassed + 2
    assert status_of(daemon.render(scene, Cache_Control="max-age=0")) == ["stratus", "hit"]


def test_format_is_part_of_the_key(daemon):
    scene = {"clouds": {"seed": 41003}, "output": SMALL}
    png, exr = daemon.render(scene), daemon.render(scene, Accept="image/x-exr")
    assert status_of(exr) == ["stratus", "fwd=miss", "stored"]
    again = daemon.render({**scene, "output": {**SMALL, "format": "exr"}}, Accept="*/*")
    assert status_of(again) == ["stratus", "hit"] and again.body == exr.body != png.body
    assert again.headers["Content-Type"] == "image/x-exr"


def test_errors_are_not_kept(daemon):
    scene = {"clouds": {"seed": 41004}, "output": LARGE}
    late = daemon.render(scene, X_Timeout_Ms="1")
    assert late.status == 504 and "Cache-Status" not in late.headers
    assert daemon.render('{"clouds": {"seed": -1}}').status == daemon.render('{"clouds": {"seed": -1}}').status == 422
    assert status_of(daemon.render({**scene, "output": SMALL})) == ["stratus", "fwd=miss", "stored"]
    answer = daemon.render(scene)
    assert answer.status == 200 and status_of(answer) == ["stratus", "fwd=miss", "stored"]


@pytest.mark.parametrize("model", [{"time_budget_ms": 100, "samples": 65536}, {"partial": True, "samples": 4}])
def test_what_depends_on_time_is_not_kept(daemon, model):
    scene = {"model": {"name": "reference", **model}, "output": {"width": 16, "height": 16}}
    images = daemon.metric("stratus_image_cache_images")
    for _ in range(2):
        answer = daemon.render(scene)
        assert answer.status == 200 and status_of(answer) == ["stratus", "fwd=bypass"]
    assert daemon.metric("stratus_image_cache_images") == images


def test_a_reference_keeps_its_samples(daemon):
    scene = {"model": {"name": "reference", "samples": 3, "seed": 41005}, "output": {"width": 16, "height": 16}}
    first, again = daemon.render(scene), daemon.render(scene)
    assert status_of(again) == ["stratus", "hit"] and again.body == first.body
    assert first.headers["Stratus-Samples"] == again.headers["Stratus-Samples"] == "3"


def test_another_content_is_another_image(daemon, tmp_path):
    scene = {"clouds": {"map": "sharing"}, "camera": {"elevation_deg": 60}, "output": SMALL}
    target, tags = "/v1/render?" + query_of(scene), []

    def picture(value):
        path = tmp_path / "map.png"
        out = oiio.ImageOutput.create(str(path))
        out.open(str(path), oiio.ImageSpec(64, 64, 1, "uint8"))
        out.write_image(numpy.full((64, 64), value, "uint8"))
        out.close()
        return path.read_bytes()

    thin, thick = picture(40), picture(200)
    for content, expected in ((thin, "fwd=miss"), (thick, "fwd=miss"), (thin, "hit")):
        assert daemon.request("PUT", "/v1/assets/sharing", content).status in (201, 204)
        answer = daemon.get(target)
        assert answer.status == 200 and status_of(answer)[1] == expected
        tags.append((answer.headers["ETag"], answer.body))
    daemon.request("DELETE", "/v1/assets/sharing")
    assert tags[0] == tags[2] and tags[0][0] != tags[1][0] and tags[0][1] != tags[1][1]
    assert daemon.get(target).status == 422


def test_memory_is_bounded(start_daemon):
    daemon = start_daemon("--images-mb", "1")
    limit = 1 << 20
    scenes = [{"camera": {"azimuth_deg": 10 * i}, "output": {"width": 320, "height": 240}} for i in range(20)]
    sizes = [len(daemon.render(scene).body) for scene in scenes]
    assert sum(sizes) > limit > 5 * max(sizes)
    assert daemon.metric("stratus_image_cache_limit_bytes") == limit
    assert limit / 2 < daemon.metric("stratus_image_cache_bytes") <= limit
    kept = daemon.metric("stratus_image_cache_images")
    assert daemon.metric("stratus_image_cache_evictions_total") == 20 - kept
    assert status_of(daemon.render(scenes[0])) == ["stratus", "fwd=miss", "stored"]
    assert status_of(daemon.render(scenes[-1])) == ["stratus", "hit"]
    large = {"output": {"width": 2048, "height": 1536}}
    assert len(daemon.render(large).body) > limit
    assert status_of(daemon.render(large)) == ["stratus", "fwd=miss"]


def test_none_are_kept(start_daemon):
    daemon = start_daemon("--images-mb", "0")
    first, again = daemon.render({"output": SMALL}), daemon.render({"output": SMALL})
    assert status_of(first) == status_of(again) == ["stratus", "fwd=miss"]
    assert first.body == again.body
    assert daemon.metric("stratus_image_cache_bytes") == 0


# --- in flight -------------------------------------------------------------------------------------------------------------------


def send(daemon, scene, **headers):
    """A request whose answer is not awaited: the connection."""
    body = json.dumps(scene).encode()
    client = socket.create_connection(("127.0.0.1", daemon.port), timeout=300)
    lines = ["POST /v1/render HTTP/1.1", "Host: x", "Content-Type: application/json", f"Content-Length: {len(body)}"]
    lines += [f"{name.replace('_', '-')}: {value}" for name, value in headers.items()]
    client.sendall("\r\n".join(lines).encode() + b"\r\n\r\n" + body)
    return client


class Busy:
    """Keeps the renderer away from other work until it is left: a picture, each daemon its own, and one behind it."""

    number = 0

    def __init__(self, daemon):
        self.daemon = daemon

    def __enter__(self):
        Busy.number += 1
        self.clients = [send(self.daemon, {"clouds": {"seed": 42000 + 10 * Busy.number + i}, "output": LARGE}) for i in range(4)]
        assert wait_for(lambda: self.daemon.metric("stratus_queue_depth") >= 2)
        return self

    def __exit__(self, *_):
        for client in self.clients:
            client.close()


def waits(daemon, miss, shared):
    """Waits until so many have joined; afterwards all of them wait."""
    assert wait_for(lambda: count(daemon, "shared") == shared)
    assert count(daemon, "miss") == miss


def test_equal_requests_share_one_render(start_daemon):
    daemon = start_daemon("--queue-length", "8", "--log-format", "json")
    scene = {"clouds": {"seed": 5}, "output": SMALL}
    before = encoded(daemon)
    with concurrent.futures.ThreadPoolExecutor(24) as pool:
        with Busy(daemon):
            target = "/v1/render?" + query_of(scene)
            running = [pool.submit(daemon.get, target) if i % 2 else pool.submit(daemon.render, scene) for i in range(24)]
            waits(daemon, 5, 23)  # though no more than 8 may wait: they are one
            assert daemon.metric("stratus_queue_depth") <= 4
        answers = [r.result() for r in running]
    assert {a.status for a in answers} == {200} and len({a.body for a in answers}) == 1
    shared = [a for a in answers if status_of(a) == ["stratus", "fwd=miss", "collapsed"]]
    (own,) = [a for a in answers if a not in shared]
    assert status_of(own) == ["stratus", "fwd=miss", "stored"] and float(own.timing["encode"]["dur"]) > 0
    for answer in shared:
        timing = answer.timing
        assert timing["shared"]["desc"] == '"hit"' and timing["encode"] == {"desc": '"reused"', "dur": "0.000"}
        assert 0 < float(timing["shared"]["dur"]) <= float(timing["total"]["dur"])
    assert encoded(daemon) == before + 1
    assert wait_for(lambda: daemon.log.read_text().count('"shared":') == 23)


def test_each_keeps_its_own_deadline(start_daemon):
    """A daemon with nothing else to do tries whatever it is asked for."""
    daemon = start_daemon()
    scene = {"clouds": {"seed": 5}, "output": {"width": 6144, "height": 4608}}
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        first = pool.submit(daemon.render, scene, X_Timeout_Ms="2000")
        assert wait_for(lambda: count(daemon, "miss") == 1)
        patient = [pool.submit(daemon.render, scene, X_Timeout_Ms="200000") for _ in range(2)]
        hasty = pool.submit(daemon.render, scene, X_Timeout_Ms="1500")
        waits(daemon, 1, 3)
        assert first.result().status == hasty.result().status == 504
        assert not any(r.done() for r in patient)
        assert [r.result().status for r in patient] == [200, 200]
    assert daemon.metric('stratus_renders_ended_total{reason="expired"}') == 2
    assert daemon.render(scene).body == patient[0].result().body


@pytest.mark.parametrize("leaver", [0, 1])
def test_the_others_get_it_when_one_leaves(start_daemon, leaver):
    daemon = start_daemon()
    scene = {"clouds": {"seed": 5}, "output": SMALL}
    with Busy(daemon):
        clients = [send(daemon, scene, X_Timeout_Ms="200000")]
        assert wait_for(lambda: count(daemon, "miss") == 5)
        clients += [send(daemon, scene, X_Timeout_Ms="200000") for _ in range(2)]
        waits(daemon, 5, 2)
        clients.pop(leaver).close()
    for client in clients:
        assert client.recv(12) == b"HTTP/1.1 200"
        client.close()
    assert wait_for(lambda: daemon.metric("stratus_requests_in_flight") == 1)
    assert daemon.metric('stratus_renders_ended_total{reason="abandoned"}') >= 1


def test_memory_is_the_works_and_not_of_who_began_it(start_daemon):
    """It is promised as long as anybody waits, and given back then."""
    daemon = start_daemon()
    scene = {"model": {"name": "reference", "samples": 4096}, "output": {"width": 320, "height": 240}}  # takes minutes
    promised = lambda: daemon.metric("stratus_picture_memory_bytes")
    clients = [send(daemon, scene, X_Timeout_Ms="3600000")]
    assert wait_for(lambda: count(daemon, "miss") == 1)
    clients.append(send(daemon, scene, X_Timeout_Ms="3600000"))
    waits(daemon, 1, 1)
    before = promised()
    assert before >= 320 * 240 * 3
    clients[0].close()
    assert wait_for(lambda: daemon.metric('stratus_renders_ended_total{reason="abandoned"}') == 1)
    assert wait_for(lambda: daemon.metric("stratus_requests_in_flight") == 2)  # the scrape is one
    assert promised() == before and daemon.metric("stratus_queue_taken") == 1
    clients[1].close()
    assert wait_for(lambda: promised() == 0 and daemon.metric("stratus_queue_taken") == 0)


def test_nothing_is_rendered_for_nobody(start_daemon):
    daemon = start_daemon()
    scene = {"clouds": {"seed": 5}, "output": SMALL}
    with Busy(daemon):
        clients = [send(daemon, scene) for _ in range(6)]
        waits(daemon, 5, 5)
        for client in clients:
            client.close()
    assert wait_for(lambda: daemon.metric("stratus_requests_in_flight") == 1)
    assert daemon.metric('stratus_renders_ended_total{reason="abandoned"}') >= 6
    assert status_of(daemon.render(scene)) == ["stratus", "fwd=miss", "stored"]


def test_who_wants_it_new_shares_nothing(start_daemon):
    daemon = start_daemon()
    scene, before = {"clouds": {"seed": 5}, "output": SMALL}, encoded(daemon)
    with concurrent.futures.ThreadPoolExecutor(3) as pool:
        with Busy(daemon):
            running = [pool.submit(daemon.render, scene, Cache_Control=value) for value in ("no-cache", "no-store", "x=1")]
            assert wait_for(lambda: count(daemon, "miss") + count(daemon, "bypass") == 7)
        assert {r.result().status for r in running} == {200}
    assert encoded(daemon) == before + 3


def test_shutdown_with_sharers(start_daemon):
    daemon = start_daemon()
    scene = {"clouds": {"seed": 5}, "output": SMALL}
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        with Busy(daemon):
            running = [pool.submit(daemon.render, scene) for _ in range(4)]
            waits(daemon, 5, 3)
            daemon.process.send_signal(signal.SIGTERM)
        assert {r.result().status for r in running} == {200}
    assert daemon.stop() == 0


# --- overlap ---------------------------------------------------------------------------------------------------------------------


def test_pictures_are_encoded_while_others_are_rendered(start_daemon):
    """The stages of all together take longer than the whole, which they could not if one came after the other."""
    daemon = start_daemon("--workers", "1")
    scenes = [
        {"clouds": {"seed": 50 + i}, "output": {"width": 1024, "height": 768, "png_compression": "small"}} for i in range(3)
    ]
    with concurrent.futures.ThreadPoolExecutor(3) as pool:
        begin = time.monotonic()
        answers = list(pool.map(daemon.render, scenes))
        wall = 1000 * (time.monotonic() - begin)
    assert {a.status for a in answers} == {200}
    spent = sum(float(a.timing[stage]["dur"]) for a in answers for stage in STAGES)
    assert wall < spent, f"{wall:.0f} ms, of which {spent:.0f} ms were spent in stages"


def test_what_needs_no_renderer_does_not_wait_for_it(start_daemon):
    """On connections of their own, while a reference of minutes is rendered: from the connection to the last byte."""
    daemon = start_daemon()
    known = "/v1/render?output.width=64&output.height=48"
    assert daemon.get(known).status == 200
    long = {"model": {"name": "reference", "samples": 4096}, "output": {"width": 320, "height": 240}}
    client = send(daemon, long, X_Timeout_Ms="120000")
    assert wait_for(lambda: daemon.metric("stratus_requests_in_flight") >= 2)
    time.sleep(1)
    took = []
    for target in ["/healthz", "/readyz", "/metrics", known, known + "&clouds.seed=3"] * 20:
        tags = {"If_None_Match": "*"} if "seed" in target else {}
        begin = time.monotonic()
        assert daemon.get(target, **tags).status == (304 if tags else 200)
        took.append(1000 * (time.monotonic() - begin))
    assert daemon.metric("stratus_requests_in_flight") >= 2, "the render ended too soon to show anything"
    client.close()
    took.sort()
    # Nine of ten: a processor shared with others may leave any thread alone for a while.
    assert took[89] < 50, took[80:]
