"""Every line beside the renderer's is shared by clients: one that asks for all it may get leaves a place to the next."""
import concurrent.futures
import contextlib
import itertools
import select
import socket
import threading

import pytest

from conftest import ANSWER_SECONDS, send, wait_for
from test_assets import png_by_hand
from test_slab import LONG, target

HOG, OTHER = "127.0.0.9", "127.0.0.2"
SMALL = {"width": 32, "height": 24}
REJECTED = 'stratus_queue_rejected_total{reason="full"}'


def ask(daemon, address, target, method="GET", body=b""):
    """Sends a request from an address and leaves its answer where it is. There is time."""
    client = socket.create_connection(("127.0.0.1", daemon.port), timeout=ANSWER_SECONDS, source_address=(address, 0))
    head = f"{method} {target} HTTP/1.1\r\nHost: x\r\nConnection: close\r\nX-Timeout-Ms: 3600000\r\nContent-Length: {len(body)}\r\n\r\n"
    client.sendall(head.encode() + body)
    return client


def status_of(client):
    with client:
        answer = b"".join(iter(lambda: client.recv(65536), b""))
    return int(answer.split(b" ", 2)[1])


def answered(clients):
    return select.select(clients, [], [], 0)[0]


@pytest.mark.parametrize("call", ["/v1/optics?dsd.gamma={gamma}", "/v1/slab?optical_thickness=3&dsd.gamma={gamma}"], ids=["optics", "slab"])
def test_computers(start_daemon, call):
    """One asks for droplet after droplet on 12 connections, where four calls may wait: another is never refused."""
    daemon = start_daemon("--queue-length", "4")
    numbers, stop = itertools.count(), threading.Event()

    def ask_on():
        seen = set()
        while not stop.is_set():
            seen.add(status_of(ask(daemon, HOG, call.format(gamma=3 + next(numbers) * 1e-6))))
            stop.wait(0.05 if 503 in seen else 0)
        return seen

    with concurrent.futures.ThreadPoolExecutor(12) as pool:
        hogs = [pool.submit(ask_on) for _ in range(12)]
        try:
            assert wait_for(lambda: daemon.metric(REJECTED) > 0)
            statuses = [status_of(ask(daemon, OTHER, call.format(gamma=2 + i / 100))) for i in range(6)]
        finally:
            stop.set()
        assert set().union(*(hog.result() for hog in hogs)) == {200, 503}
    assert statuses == [200] * 6


def test_tracings(start_daemon):
    """Four of one client wait behind one that runs, and no more of it may; another's waits as well, and is the next."""
    daemon = start_daemon()
    long = lambda seed: target(seed=seed, **LONG)
    waiting = lambda: daemon.metric("stratus_tracings_waiting")
    with contextlib.ExitStack() as stack:
        running = stack.enter_context(ask(daemon, HOG, long(0)))
        # More than once: the request for the metrics before may count as well, and the first tracing has to be ahead of the next.
        assert wait_for(lambda: all(daemon.metric("stratus_requests_in_flight") == 2 and waiting() == 0 for _ in range(5)))
        hogs = []
        for seed in range(1, 5):
            hogs.append(stack.enter_context(ask(daemon, HOG, long(seed))))
            assert wait_for(lambda: waiting() == seed), seed
        assert status_of(ask(daemon, HOG, long(5))) == 503
        other = ask(daemon, OTHER, "/v1/slab?optical_thickness=1&shading=montecarlo&photons=1000")
        assert wait_for(lambda: waiting() == 5)
        running.close()
        assert status_of(other) == 200
        assert not answered(hogs)


def test_droplets(start_faulty):
    """Where the renderer is held, and with it the memory for droplets, those who wait for theirs stand in line."""
    daemon = start_faulty("--queue-length", "16", "--droplets-mb", "16")
    scene = lambda gamma: {"dsd": {"gamma": gamma}, "output": SMALL}
    assert daemon.render(scene(7)).status == 200
    with daemon.busy():
        hogs = [send(daemon, scene(8 + i / 16), HOG) for i in range(15)]
        # All but the one that is prepared: its thread waits for memory.
        assert wait_for(lambda: daemon.metric("stratus_queue_depth") + len(answered(hogs)) == 14)
        refused = daemon.metric(REJECTED)
        other = send(daemon, scene(6), OTHER)
        assert not wait_for(lambda: answered([other]), 1)
        for client in hogs:
            client.close()
    assert other.recv(12) == b"HTTP/1.1 200"
    other.close()
    assert refused >= 7  # four of them stood in line, and some have their droplets


def test_uploads(start_daemon):
    """Sixteen may come in; of one client that never ends its own only half of them."""
    daemon = start_daemon("--read-timeout-s", "3600")
    png = png_by_hand(2, 2, b"\0\x80\x80" * 2)
    hogs = []
    for i in range(16):
        hogs.append(socket.create_connection(("127.0.0.1", daemon.port), timeout=ANSWER_SECONDS, source_address=(HOG, 0)))
        hogs[-1].sendall(b"PUT /v1/assets/hog%d HTTP/1.1\r\nHost: x\r\nContent-Length: 60000\r\n\r\n" % i + png)
    assert wait_for(lambda: len(answered(hogs)) == 8)
    for client in answered(hogs):
        assert client.recv(12) == b"HTTP/1.1 503"
    assert status_of(ask(daemon, OTHER, "/v1/assets/mine", "PUT", png)) == 201
    assert status_of(ask(daemon, HOG, "/v1/assets/hog", "PUT", png)) == 503
    for client in hogs:
        client.close()
    assert wait_for(lambda: status_of(ask(daemon, HOG, "/v1/assets/hog", "PUT", png)) in (201, 204))
