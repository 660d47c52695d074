"""One render for equal requests: those in flight share it, later ones get the finished image, and nobody gets what is not theirs."""
import concurrent.futures
import itertools
import signal
import time

import numpy
import OpenImageIO as oiio
import pytest

from conftest import FaultyDaemon, in_some_try, query_of, send, wait_for

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


@pytest.fixture(scope="module")
def standing(tmp_path_factory):
    """A daemon whose renderer can be made to stand still."""
    daemon = FaultyDaemon(tmp_path_factory.mktemp("standing"))
    yield daemon
    assert daemon.stop() == 0
    daemon.assert_clean()


class Counts:
    """What is counted of a daemon from now on."""

    def __init__(self, daemon):
        daemon.settle()
        self.daemon, self.before = daemon, self.now(daemon)

    @staticmethod
    def now(daemon):
        ended = {reason: daemon.metric(f'stratus_renders_ended_total{{reason="{reason}"}}') for reason in ("abandoned", "expired")}
        return {"encoded": encoded(daemon), **ended, **{source: count(daemon, source) for source in ("miss", "shared", "bypass")}}

    def are(self, **numbers):
        """Waits until they are."""
        def reached():
            now = self.now(self.daemon)
            return all(now[name] - self.before[name] == number for name, number in numbers.items())

        return wait_for(reached)


def test_equal_requests_share_one_render(start_faulty):
    daemon = start_faulty("--queue-length", "8", "--log-format", "json")
    scene, counts = {"clouds": {"seed": 5}, "output": SMALL}, Counts(daemon)
    with concurrent.futures.ThreadPoolExecutor(24) as pool:
        with daemon.busy() as other:
            target = "/v1/render?" + query_of(scene)
            running = [pool.submit(daemon.get, target) if i % 2 else pool.submit(daemon.render, scene) for i in range(24)]
            assert counts.are(miss=2, shared=23)  # though no more than 8 may wait: they are one
            assert daemon.metric("stratus_queue_depth") == 1
        answers = [r.result() for r in running]
        assert other.recv(12) == b"HTTP/1.1 200"
    assert {a.status for a in answers} == {200} and len({a.body for a in answers}) == 1
    shared = [a for a in answers if status_of(a) == ["stratus", "fwd=miss", "collapsed"]]
    (own,) = [a for a in answers if a not in shared]
    assert status_of(own) == ["stratus", "fwd=miss", "stored"] and float(own.timing["encode"]["dur"]) > 0
    for answer in shared:
        timing = answer.timing
        assert timing["shared"]["desc"] == '"hit"' and timing["encode"] == {"desc": '"reused"', "dur": "0.000"}
        assert 0 < float(timing["shared"]["dur"]) <= float(timing["total"]["dur"])
    assert counts.are(encoded=2)
    assert wait_for(lambda: daemon.log.read_text().count('"shared":') == 23)


def test_each_keeps_its_own_deadline(standing):
    """A daemon with nothing else to do tries whatever it is asked for."""
    daemon, scene, counts = standing, {"clouds": {"seed": 42005}, "output": SMALL}, Counts(standing)
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        with daemon.holding():
            first = pool.submit(daemon.render, scene, X_Timeout_Ms="2000")
            assert wait_for(daemon.is_held)
            patient = [pool.submit(daemon.render, scene, X_Timeout_Ms="3000000") for _ in range(2)]
            hasty = pool.submit(daemon.render, scene, X_Timeout_Ms="1500")
            assert counts.are(miss=1, shared=3)
            time.sleep(2.1)
        assert first.result().status == hasty.result().status == 504
        assert [r.result().status for r in patient] == [200, 200]
    assert counts.are(expired=2)
    assert daemon.render(scene).body == patient[0].result().body


@pytest.mark.parametrize("leaver", [0, 1])
def test_the_others_get_it_when_one_leaves(standing, leaver):
    daemon, scene, counts = standing, {"clouds": {"seed": 42006 + leaver}, "output": SMALL}, Counts(standing)
    with daemon.busy():
        clients = [send(daemon, scene)]
        assert counts.are(miss=2)
        clients += [send(daemon, scene) for _ in range(2)]
        assert counts.are(miss=2, shared=2)
        clients.pop(leaver).close()
    for client in clients:
        assert client.recv(12) == b"HTTP/1.1 200"
        client.close()
    assert counts.are(abandoned=1)


def test_memory_is_the_works_and_not_of_who_began_it(start_daemon):
    """It is promised as long as anybody waits, and given back then."""
    daemon = start_daemon()
    scene = {"model": {"name": "reference", "samples": 4096}, "output": {"width": 320, "height": 240}}  # takes minutes
    promised, counts = lambda: daemon.metric("stratus_picture_memory_bytes"), Counts(daemon)
    clients = [send(daemon, scene, X_Timeout_Ms="3600000")]
    assert counts.are(miss=1)
    clients.append(send(daemon, scene, X_Timeout_Ms="3600000"))
    assert counts.are(miss=1, shared=1)
    before = promised()
    assert before >= 320 * 240 * 3
    clients[0].close()
    assert counts.are(abandoned=1)
    assert wait_for(lambda: daemon.metric("stratus_requests_in_flight") == 2)  # the scrape is one
    assert promised() == before and daemon.metric("stratus_queue_taken") == 1
    clients[1].close()
    assert wait_for(lambda: promised() == 0 and daemon.metric("stratus_queue_taken") == 0)


def test_nothing_is_rendered_for_nobody(standing):
    daemon, scene, counts = standing, {"clouds": {"seed": 42008}, "output": SMALL}, Counts(standing)
    with daemon.busy():
        clients = [send(daemon, scene) for _ in range(6)]
        assert counts.are(miss=2, shared=5)
        for client in clients:
            client.close()
        assert counts.are(abandoned=6)
    daemon.settle()
    assert status_of(daemon.render(scene)) == ["stratus", "fwd=miss", "stored"]


def test_who_wants_it_new_shares_nothing(standing):
    daemon, scene, counts = standing, {"clouds": {"seed": 42009}, "output": SMALL}, Counts(standing)
    with concurrent.futures.ThreadPoolExecutor(3) as pool:
        with daemon.busy() as other:
            running = [pool.submit(daemon.render, scene, Cache_Control=value) for value in ("no-cache", "no-store", "x=1")]
            assert counts.are(miss=2, bypass=2)
        assert {r.result().status for r in running} == {200}
        assert other.recv(12) == b"HTTP/1.1 200"
    assert counts.are(encoded=4)


def test_shutdown_with_sharers(start_faulty):
    daemon = start_faulty()
    scene, counts = {"clouds": {"seed": 5}, "output": SMALL}, Counts(daemon)
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        with daemon.busy():
            running = [pool.submit(daemon.render, scene) for _ in range(4)]
            assert counts.are(miss=2, shared=3)
            daemon.process.send_signal(signal.SIGTERM)
            assert wait_for(lambda: "SIGTERM: " in daemon.text)
        assert {r.result().status for r in running} == {200}
    assert daemon.process.wait(timeout=180) == 0  # stop() would be a second signal


# --- overlap ---------------------------------------------------------------------------------------------------------------------


def test_pictures_are_encoded_while_others_are_rendered(start_daemon):
    """The stages of all together take longer than the whole, which they could not if one came after the other."""
    daemon = start_daemon("--workers", "1")
    seeds = itertools.count(50)

    def they_overlap():
        scenes = [{"clouds": {"seed": next(seeds)}, "output": {"width": 1024, "height": 768, "png_compression": "small"}} for _ in range(3)]
        with concurrent.futures.ThreadPoolExecutor(3) as pool:
            begin = time.monotonic()
            answers = list(pool.map(daemon.render, scenes))
            wall = 1000 * (time.monotonic() - begin)
        assert {a.status for a in answers} == {200}
        spent = sum(float(a.timing[stage]["dur"]) for a in answers for stage in STAGES)
        print(f"{wall:.0f} ms, of which {spent:.0f} ms were spent in stages")
        return wall < spent

    assert in_some_try(they_overlap)


def test_what_needs_no_renderer_does_not_wait_for_it(standing):
    """On connections of their own, while the renderer stands still, and while it has a reference of minutes: from the connection to the last byte."""
    daemon = standing
    known = "/v1/render?output.width=64&output.height=48"
    assert daemon.get(known).status == 200
    targets = ["/healthz", "/readyz", "/metrics", known, known + "&clouds.seed=3"]
    took = {target: [] for target in targets}

    def ask_for_all():
        for target in targets:
            tags = {"If_None_Match": "*"} if "seed" in target else {}
            begin = time.monotonic()
            assert daemon.get(target, **tags).status == (304 if tags else 200)
            took[target].append(1000 * (time.monotonic() - begin))

    with daemon.busy():
        ask_for_all()
    with send(daemon, {"model": {"name": "reference", "samples": 4096}, "output": {"width": 320, "height": 240}}):
        assert wait_for(lambda: daemon.metric("stratus_requests_in_flight") == 2 and daemon.metric("stratus_queue_depth") == 0)
        for _ in range(20):
            ask_for_all()
        assert wait_for(lambda: daemon.metric("stratus_requests_in_flight") == 2), "the render ended too soon to show anything"
    # The quickest of each: whoever waits for a renderer that is busy throughout waits each time, whoever shares a processor now and then.
    assert all(min(times) < 50 for times in took.values()), took
