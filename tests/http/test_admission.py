"""Who is let in, who is served when, and what a client that has gone costs."""
import concurrent.futures
import http.client
import itertools
import json
import re
import socket
import time

import pytest

from conftest import ANSWER_SECONDS, SANITIZED, FaultyDaemon, in_some_try, send, wait_for

PREVIEW = {"output": {"width": 160, "height": 120}}
JSON = {"Content-Type": "application/json"}


def picture(seed, width, height):
    return {"clouds": {"seed": seed}, "output": {"width": width, "height": height}}


def render_from(daemon, address, scene, **headers):
    """Renders from another address of this machine: another client. Returns (status, headers, body)."""
    connection = http.client.HTTPConnection("127.0.0.1", daemon.port, timeout=ANSWER_SECONDS, source_address=(address, 0))
    try:
        connection.request("POST", "/v1/render", json.dumps(scene), {**JSON, **headers})
        response = connection.getresponse()
        return response.status, response.headers, response.read()
    finally:
        connection.close()


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """A daemon whose line is long, that has rendered a few pictures."""
    daemon = FaultyDaemon(
        tmp_path_factory.mktemp("served"), "--queue-length", "1024", "--queue-mpixels", "16384", "--connections-per-address", "1024", "--memory-mb", "131072"
    )
    for seed in range(3):
        assert daemon.render(picture(seed, 640, 480)).status == 200
    assert daemon.render(PREVIEW).status == 200
    yield daemon
    assert daemon.stop() == 0
    daemon.assert_clean()


seeds = itertools.count(10000)  # no two alike, which would share one render


def queued(daemon, count, width=4096):
    """So many large pictures in line, all of the one client: their sockets. The renderer is to be held; none of them need ever be rendered."""
    before = daemon.metric("stratus_queue_depth")
    clients = [send(daemon, picture(next(seeds), width, width * 3 // 4)) for _ in range(count)]
    assert wait_for(lambda: daemon.metric("stratus_queue_depth") == before + count)
    return clients


def leave(clients):
    for client in clients:
        client.close()


# --- fair order --------------------------------------------------------------------------------------------------------------------


def order_of(daemon, word):
    """The ends of the ids that begin with the word, as their requests ended. Neighbours may be logged in either order."""
    return [found[1] for line in daemon.lines if (found := re.search(f" request id={word}-(\\w+) ", line))]


def test_a_batch_does_not_starve_a_preview(served):
    """The preview of another client comes after the picture that runs, not after the batch."""
    with concurrent.futures.ThreadPoolExecutor(12) as pool:
        with served.busy():
            batch = [pool.submit(render_from, served, "127.0.0.1", picture(100 + i, 320, 240), **{"X-Request-Id": f"batch-{i}"}) for i in range(10)]
            assert wait_for(lambda: served.metric("stratus_queue_depth") == 10)
            preview = pool.submit(render_from, served, "127.0.0.2", {**PREVIEW, "camera": {"azimuth_deg": 6}}, **{"X-Request-Id": "batch-preview"})
            assert wait_for(lambda: served.metric("stratus_queue_depth") == 11)
        assert preview.result()[0] == 200
        assert all(b.result()[0] == 200 for b in batch)
    assert wait_for(lambda: len(order_of(served, "batch")) == 11)
    assert order_of(served, "batch").index("preview") <= 3, "the preview waited for the batch"


def test_of_one_client_small_ones_go_first(served):
    with concurrent.futures.ThreadPoolExecutor(12) as pool:
        with served.busy():
            batch = [pool.submit(served.render, picture(200 + i, 320, 240), X_Request_Id=f"one-{i}") for i in range(8)]
            assert wait_for(lambda: served.metric("stratus_queue_depth") == 8)
            small = pool.submit(served.render, {**PREVIEW, "camera": {"azimuth_deg": 9}}, X_Request_Id="one-small")
            assert wait_for(lambda: served.metric("stratus_queue_depth") == 9)
        assert small.result().status == 200
        assert all(b.result().status == 200 for b in batch)
    assert wait_for(lambda: len(order_of(served, "one")) == 9)
    assert order_of(served, "one").index("small") <= 4


def test_what_another_asked_for_last_comes_in_ones_own_turn(served):
    """Not behind the batch of the other, which gets it then as well."""
    shared = 'stratus_image_requests_total{source="shared"}'
    with concurrent.futures.ThreadPoolExecutor(12) as pool:
        with served.busy():
            batch = [picture(next(seeds), 320, 240) for _ in range(10)]
            running = []
            for i, scene in enumerate(batch):  # one after the other, so that the last is the last
                running.append(pool.submit(render_from, served, "127.0.0.1", scene, **{"X-Request-Id": f"joined-{i}"}))
                assert wait_for(lambda: served.metric("stratus_queue_depth") == i + 1)
            before = served.metric(shared)
            joined = pool.submit(render_from, served, "127.0.0.2", batch[-1], **{"X-Request-Id": "joined-too"})
            assert wait_for(lambda: served.metric(shared) == before + 1)
            assert served.metric("stratus_queue_depth") == 10
        assert joined.result()[0] == 200
        assert {r.result()[0] for r in running} == {200}
        assert joined.result()[2] == running[-1].result()[2]
    assert wait_for(lambda: len(order_of(served, "joined")) == 11)
    order = order_of(served, "joined")
    assert order.index("too") <= 4 and order.index("9") <= 4, f"who joined waited for the batch: {order}"


# --- deadlines ---------------------------------------------------------------------------------------------------------------------


def test_what_cannot_be_done_in_time_is_refused_at_once(served):
    with served.busy():
        batch, backlog = [], 0
        while backlog < 60 and len(batch) < 1000:  # what a picture takes is the machine's affair
            batch += queued(served, 10)
            backlog = served.metric("stratus_queue_backlog_seconds")
        before = served.metric('stratus_queue_rejected_total{reason="predicted_late"}')
        # At once, since nothing else is done while the renderer is held.
        answer = served.render(picture(320, 4096, 3072), X_Timeout_Ms=str(int(500 * backlog)))
        assert answer.status == 503, "half the backlog is not enough for what comes after it"
        problem = answer.json
        assert problem["type"] == "urn:stratus:problem:predicted-late"
        assert problem["queue_depth"] >= 1
        assert problem["predicted_ms"] > 500 * backlog
        assert problem["retry_after_seconds"] == int(answer.headers["Retry-After"])
        assert 1 <= problem["retry_after_seconds"] <= 5 * backlog
        assert "X-Timeout-Ms" in problem["detail"]
        assert float(answer.timing["total"]["dur"]) < 500 * backlog
        assert served.metric('stratus_queue_rejected_total{reason="predicted_late"}') == before + 1
        # Another client has its own share of the time.
        with concurrent.futures.ThreadPoolExecutor(1) as pool:
            other = pool.submit(render_from, served, "127.0.0.3", {**PREVIEW, "camera": {"azimuth_deg": 8}}, **{"X-Timeout-Ms": str(int(500 * backlog))})
            assert wait_for(lambda: served.metric("stratus_queue_depth") == len(batch) + 1)
            served.heal("hold")
            assert other.result()[0] == 200
            served.fail("hold")
        leave(batch)
    served.settle()


def test_who_joins_too_late_a_picture_is_refused_at_once(served):
    """As who asks for another one is. With more time it is shared."""
    late, shared = 'stratus_queue_rejected_total{reason="predicted_late"}', 'stratus_image_requests_total{source="shared"}'

    def reference(samples):
        return {"model": {"name": "reference", "samples": samples, "seed": next(seeds)}, "output": {"width": 160, "height": 120}}

    def is_refused():
        for samples in (4, 8):
            assert served.render(reference(samples)).status == 200
        refused, joined, long = served.metric(late), served.metric(shared), reference(512)  # takes half a minute and more
        with send(served, long):
            assert wait_for(lambda: served.metric("stratus_queue_taken") == 1 and served.metric("stratus_queue_depth") == 0)
            deadline_ms = int(min(2000, 250 * served.metric("stratus_queue_backlog_seconds")))
            answer = served.render(long, X_Timeout_Ms=str(deadline_ms))
            with send(served, long):
                assert wait_for(lambda: served.metric(shared) >= joined + 1)
        assert wait_for(lambda: served.metric("stratus_queue_taken") == 0)
        if answer.status == 504:  # a machine so busy that what was measured has grown old
            return False
        assert (answer.status, answer.json["type"]) == (503, "urn:stratus:problem:predicted-late")
        assert answer.json["predicted_ms"] > deadline_ms and int(answer.headers["Retry-After"]) >= 1
        assert served.metric(late) == refused + 1
        return True

    assert in_some_try(is_refused)


def test_idle_nothing_is_refused_for_its_predicted_time(served):
    """What cannot be done in time is tried, and is late."""
    for _ in range(3):
        assert served.render(PREVIEW, Cache_Control="no-cache").status == 200  # comes behind whatever is given up between two passes
        assert wait_for(lambda: served.metric("stratus_queue_backlog_seconds") == 0)
        assert served.render(picture(400, 2048, 1536), X_Timeout_Ms="5").status == 504


def test_a_deadline_counts_from_the_first_byte(served):
    """Not from the end of the body, nor from that of the headers."""
    body = json.dumps(PREVIEW).encode()
    head = b"POST /v1/render HTTP/1.1\r\nHost: x\r\nX-Timeout-Ms: 500\r\nCache-Control: no-cache\r\nContent-Type: application/json\r\nContent-Length: %d\r\n\r\n" % len(body)

    def ask(pieces):
        with socket.create_connection(("127.0.0.1", served.port), timeout=180) as client:
            client.sendall(pieces[0])
            time.sleep(2.5)
            client.sendall(pieces[1])
            return client.recv(65536)

    with concurrent.futures.ThreadPoolExecutor(3) as pool:
        for answer in pool.map(ask, ((head, body), (head[:1], head[1:] + body), (head + body[:1], body[1:]))):
            assert answer.startswith(b"HTTP/1.1 504 ")


def test_predictions_are_measured(start_daemon):
    """Repeated pictures are predicted within a factor of three, on a busy machine too, unless its load changes just then."""
    daemon = start_daemon()
    text = "stratus_render_prediction_ratio_bucket"
    turns = itertools.count()

    def are_good():
        turn = next(turns)
        before = {bound: daemon.metric(f'{text}{{le="{bound}"}}') for bound in ("0.33", "3.0", "+Inf")}
        for azimuth in range(12):
            scene = {"camera": {"azimuth_deg": 10 * azimuth + turn}, "output": {"width": 320 + 20 * azimuth, "height": 240}}
            assert daemon.render(scene).status == 200
        counted = {bound: daemon.metric(f'{text}{{le="{bound}"}}') - before[bound] for bound in before}
        assert counted["+Inf"] == 12
        return counted["3.0"] - counted["0.33"] >= 8

    assert in_some_try(are_good)


# --- clients that leave ------------------------------------------------------------------------------------------------------------


def test_who_leaves_the_line_is_dropped_at_once(served):
    """While another picture runs: their places in the line are free, long before it is their turn."""
    cancelled = 'stratus_cancelled_total{at="queued"}'
    served.settle()
    before = served.metric(cancelled)
    with served.busy() as running:
        clients = queued(served, 10, 1024)
        clients.pop().shutdown(socket.SHUT_WR)  # looks the same from the other side
        leave(clients)
        assert wait_for(lambda: served.metric("stratus_queue_depth") == 0)
        assert wait_for(lambda: served.metric(cancelled) == before + 10)
    assert running.recv(12) == b"HTTP/1.1 200"


def test_places_are_for_all_that_is_accepted(start_daemon):
    """What is rendered has one too, until it is answered; who leaves gives it back."""
    daemon = start_daemon("--queue-length", "2")
    assert daemon.metric("stratus_queue_limit") == 2
    long = {"model": {"name": "reference", "samples": 4096}, "output": {"width": 320, "height": 240}}  # takes minutes
    clients = []
    for seed in range(2):
        clients.append(send(daemon, {**long, "model": {**long["model"], "seed": seed}}))
        assert wait_for(lambda: daemon.metric("stratus_queue_taken") == len(clients))
    refused = daemon.render(PREVIEW)
    assert refused.status == 503 and refused.json["type"] == "urn:stratus:problem:queue-full"
    assert "--queue-length" in refused.json["detail"] and int(refused.headers["Retry-After"]) >= 1
    clients.pop().close()
    assert wait_for(lambda: daemon.metric("stratus_queue_taken") == 1)
    assert daemon.render(PREVIEW).status == 200
    clients.pop().close()
    assert wait_for(lambda: daemon.metric("stratus_queue_taken") == 0)


def test_a_thousand_clients_that_leave(served):
    """Some running renders are stopped, the others never begin; memory and descriptors are what they were."""
    waves, each = 5, 200
    before = {at: served.settled(f'stratus_cancelled_total{{at="{at}"}}') for at in ("queued", "rendering", "encoding")}
    wasted = served.metric('stratus_wasted_render_seconds_total{reason="abandoned"}')
    files, memory = None, None
    for wave in range(waves):
        with served.holding():
            clients = [send(served, picture(1000 + wave * each + i, 2048, 1536)) for i in range(each)]
            assert wait_for(lambda: served.is_held() and served.metric("stratus_queue_depth") == each - 1)
            leave(clients)
            assert wait_for(lambda: served.metric("stratus_queue_depth") == 0)
        served.settle()
        if wave == 0:
            files, memory = served.metric("stratus_process_open_fds"), served.metric("stratus_process_resident_memory_bytes")
    assert served.render({**PREVIEW, "camera": {"azimuth_deg": 7}}).status == 200
    ended = {at: served.metric(f'stratus_cancelled_total{{at="{at}"}}') - before[at] for at in before}
    assert ended == {"queued": waves * (each - 1), "rendering": waves, "encoding": 0}
    assert served.metric('stratus_wasted_render_seconds_total{reason="abandoned"}') > wasted
    assert served.settled("stratus_picture_memory_bytes") == 0
    assert wait_for(lambda: abs(served.metric("stratus_process_open_fds") - files) <= 2)
    assert SANITIZED or served.metric("stratus_process_resident_memory_bytes") < memory + (48 << 20)
