"""Who is let in, who is served when, and what a client that has gone costs."""
import concurrent.futures
import http.client
import json
import socket
import time

import pytest

from conftest import ANSWER_SECONDS, SANITIZED, wait_for

PREVIEW = {"output": {"width": 160, "height": 120}}
JSON = {"Content-Type": "application/json"}


def picture(seed, width, height):
    return {"clouds": {"seed": seed}, "output": {"width": width, "height": height}}


def render_from(daemon, address, scene, **headers):
    """Renders from another address of this machine: another client. Returns (status, headers, body, seconds)."""
    connection = http.client.HTTPConnection("127.0.0.1", daemon.port, timeout=ANSWER_SECONDS, source_address=(address, 0))
    began = time.monotonic()
    try:
        connection.request("POST", "/v1/render", json.dumps(scene), {**JSON, **headers})
        response = connection.getresponse()
        return response.status, response.headers, response.read(), time.monotonic() - began
    finally:
        connection.close()


def send(daemon, scene):
    """Asks for a picture and leaves the answer where it is. There is time: none is refused for being late."""
    body = json.dumps(scene).encode()
    client = socket.create_connection(("127.0.0.1", daemon.port), timeout=ANSWER_SECONDS)
    head = b"POST /v1/render HTTP/1.1\r\nHost: x\r\nX-Timeout-Ms: 3600000\r\nContent-Type: application/json\r\n"
    client.sendall(head + b"Content-Length: %d\r\n\r\n" % len(body) + body)
    return client


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """A daemon whose line is long, that has rendered a few pictures."""
    from conftest import Daemon

    daemon = Daemon(
        tmp_path_factory.mktemp("served"), "--queue-length", "1024", "--queue-mpixels", "4096", "--connections-per-address", "1024", "--memory-mb", "65536"
    )
    for seed in range(3):
        assert daemon.render(picture(seed, 640, 480)).status == 200
    assert daemon.render(PREVIEW).status == 200
    yield daemon
    assert daemon.stop() == 0
    daemon.assert_clean()


# --- fair order --------------------------------------------------------------------------------------------------------------------


def test_a_batch_does_not_starve_a_preview(served):
    """The preview of another client comes after the picture that runs, not after the batch."""
    with concurrent.futures.ThreadPoolExecutor(12) as pool:
        batch = [pool.submit(render_from, served, "127.0.0.1", picture(100 + i, 1280, 960)) for i in range(10)]
        assert wait_for(lambda: served.metric("stratus_queue_depth") >= 8)
        status, _, _, _ = render_from(served, "127.0.0.2", PREVIEW)
        waiting = served.metric("stratus_queue_depth")
        assert status == 200
        assert waiting >= 5, "the preview waited for the batch"
        assert all(b.result()[0] == 200 for b in batch)


def test_of_one_client_small_ones_go_first(served):
    with concurrent.futures.ThreadPoolExecutor(12) as pool:
        batch = [pool.submit(served.render, picture(200 + i, 1280, 960)) for i in range(8)]
        assert wait_for(lambda: served.metric("stratus_queue_depth") >= 6)
        assert served.render(PREVIEW).status == 200
        assert served.metric("stratus_queue_depth") >= 3
        assert all(b.result().status == 200 for b in batch)


# --- deadlines ---------------------------------------------------------------------------------------------------------------------


def test_what_cannot_be_done_in_time_is_refused_at_once(served):
    alone = float(served.render(picture(300, 1280, 960)).timing["total"]["dur"])
    with concurrent.futures.ThreadPoolExecutor(12) as pool:
        batch = [pool.submit(served.render, picture(301 + i, 1280, 960)) for i in range(10)]
        assert wait_for(lambda: served.metric("stratus_queue_depth") >= 9)
        backlog = served.metric("stratus_queue_backlog_seconds")
        assert backlog > 2e-3 * alone
        before = served.metric('stratus_queue_rejected_total{reason="predicted_late"}')
        answer = served.render(picture(320, 1280, 960), X_Timeout_Ms=str(int(500 * backlog)))
        assert answer.status == 503, "half the backlog is not enough for what comes after it"
        problem = answer.json
        assert problem["type"] == "urn:stratus:problem:predicted-late"
        assert problem["queue_depth"] >= 1
        assert problem["predicted_ms"] > 500 * backlog
        assert problem["retry_after_seconds"] == int(answer.headers["Retry-After"])
        assert 1 <= problem["retry_after_seconds"] <= max(4, 5 * backlog)
        assert "X-Timeout-Ms" in problem["detail"]
        assert float(answer.timing["total"]["dur"]) < 1000
        assert served.metric('stratus_queue_rejected_total{reason="predicted_late"}') == before + 1
        # Another client has its own share of the time.
        assert render_from(served, "127.0.0.3", PREVIEW, **{"X-Timeout-Ms": str(max(3000, int(500 * backlog)))})[0] == 200
        assert all(b.result().status == 200 for b in batch)


def test_idle_nothing_is_refused_for_its_predicted_time(served):
    """What cannot be done in time is tried, and is late."""
    for _ in range(3):
        assert wait_for(lambda: served.metric("stratus_queue_backlog_seconds") == 0)
        time.sleep(0.2)  # what was too late is given up between two passes
        assert served.render(picture(400, 2048, 1536), X_Timeout_Ms="5").status == 504


def test_a_deadline_counts_from_the_first_byte(served):
    """Not from the end of the body, nor from that of the headers."""
    body = json.dumps(PREVIEW).encode()
    head = b"POST /v1/render HTTP/1.1\r\nHost: x\r\nX-Timeout-Ms: 600\r\nCache-Control: no-cache\r\nContent-Type: application/json\r\nContent-Length: %d\r\n\r\n" % len(body)
    for pieces in ((head, body), (head[:1], head[1:] + body), (head + body[:1], body[1:])):
        with socket.create_connection(("127.0.0.1", served.port), timeout=60) as client:
            client.sendall(pieces[0])
            time.sleep(0.9)
            client.sendall(pieces[1])
            assert client.recv(65536).startswith(b"HTTP/1.1 504 "), pieces


def test_predictions_are_measured(served):
    """Repeated pictures are predicted within a factor of three, on a busy machine too."""
    text = "stratus_render_prediction_ratio_bucket"
    before = {bound: served.metric(f'{text}{{le="{bound}"}}') for bound in ("0.33", "3.0", "+Inf")}
    for azimuth in range(12):
        scene = {"camera": {"azimuth_deg": 10 * azimuth}, "output": {"width": 320 + 20 * azimuth, "height": 240}}
        assert served.render(scene).status == 200
    counted = {bound: served.metric(f'{text}{{le="{bound}"}}') - before[bound] for bound in before}
    assert counted["+Inf"] == 12
    assert counted["3.0"] - counted["0.33"] >= 8


# --- clients that leave ------------------------------------------------------------------------------------------------------------


def test_who_leaves_the_line_is_dropped_at_once(served):
    """While another picture runs that takes long: their places in the line are free, long before it is their turn."""
    before = served.metric('stratus_cancelled_total{at="queued"}')
    with concurrent.futures.ThreadPoolExecutor(1) as pool:
        long = pool.submit(served.render, picture(500, 4096, 3072))
        assert wait_for(lambda: served.metric("stratus_requests_in_flight") == 2)
        clients = [send(served, picture(501 + i, 1024, 768)) for i in range(10)]
        assert wait_for(lambda: served.metric("stratus_queue_depth") >= 10 or long.done())
        assert not long.done()
        clients.pop().shutdown(socket.SHUT_WR)  # looks the same from the other side
        for client in clients:
            client.close()
        assert wait_for(lambda: served.metric("stratus_queue_depth") == 0)
        dropped_before_the_end = not long.done()
        assert long.result().status == 200
    assert dropped_before_the_end
    assert wait_for(lambda: served.metric('stratus_cancelled_total{at="queued"}') == before + 10)


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
    """Ten running renders are stopped, the others never begin; memory and descriptors are what they were."""
    waves, each = 5, 200
    before = {at: served.metric(f'stratus_cancelled_total{{at="{at}"}}') for at in ("queued", "rendering", "encoding")}
    wasted = served.metric('stratus_wasted_render_seconds_total{reason="abandoned"}')
    files, memory = None, None
    for wave in range(waves):
        clients = [send(served, picture(wave * each + i, 2048, 1536)) for i in range(each)]
        assert wait_for(lambda: served.metric("stratus_queue_depth") >= each - 10)
        for client in clients:
            client.close()
        assert wait_for(lambda: served.metric("stratus_requests_in_flight") == 1)
        if wave == 0:
            files, memory = served.metric("stratus_process_open_fds"), served.metric("stratus_process_resident_memory_bytes")
    began = time.monotonic()
    assert served.render(PREVIEW).status == 200
    assert SANITIZED or time.monotonic() - began < 5
    ended = {at: served.metric(f'stratus_cancelled_total{{at="{at}"}}') - before[at] for at in before}
    # A picture or two may be ready before its client leaves.
    assert waves * each - 30 <= sum(ended.values()) <= waves * each
    assert ended["queued"] >= 0.9 * waves * each
    assert ended["rendering"] >= 1
    assert served.metric('stratus_wasted_render_seconds_total{reason="abandoned"}') > wasted
    assert served.metric("stratus_picture_memory_bytes") == 0
    assert wait_for(lambda: abs(served.metric("stratus_process_open_fds") - files) <= 2)
    assert SANITIZED or served.metric("stratus_process_resident_memory_bytes") < memory + (48 << 20)
