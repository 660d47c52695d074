"""Overload, shutdown, settings: daemons of their own."""
import concurrent.futures
import http.client
import json
import os
import signal
import socket
import subprocess
import time

import pytest

from conftest import BUILD, in_some_try, send, wait_for

SMALL = {"width": 64, "height": 48}


def test_full_queue(start_faulty):
    daemon = start_faulty("--queue-length", "2")  # one that is rendered has a place as well
    scenes = [{"clouds": {"seed": i}, "output": SMALL} for i in range(8)]
    with concurrent.futures.ThreadPoolExecutor(len(scenes)) as pool:
        with daemon.busy():
            running = [pool.submit(daemon.render, scene) for scene in scenes]
            assert wait_for(lambda: sum(r.done() for r in running) == 7)
            assert daemon.metric("stratus_queue_depth") == 1
        answers = [r.result() for r in running]
    assert sorted(a.status for a in answers) == [200] + [503] * 7
    for answer in answers:
        if answer.status == 503:
            assert answer.json["type"] == "urn:stratus:problem:queue-full"
            assert int(answer.headers["Retry-After"]) >= 1
            assert answer.json["retry_after_seconds"] == int(answer.headers["Retry-After"])
            assert answer.headers["Cache-Control"] == "no-store"
    assert daemon.metric('stratus_queue_rejected_total{reason="full"}') == 7
    assert daemon.metric("stratus_queue_depth") == 0


def test_shutdown_finishes_accepted_work(start_faulty):
    daemon = start_faulty()
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        with daemon.holding():
            running = [pool.submit(daemon.render, {"clouds": {"seed": i}, "output": SMALL}) for i in range(4)]
            assert wait_for(lambda: daemon.metric("stratus_requests_in_flight") == 5)
            daemon.process.send_signal(signal.SIGTERM)
            assert wait_for(lambda: "SIGTERM: " in daemon.text)
        assert all(r.result().status == 200 for r in running)
    assert daemon.process.wait(timeout=180) == 0
    with pytest.raises(ConnectionError):
        daemon.get("/healthz")


def test_shutdown_waits_for_the_deadlines_that_were_accepted(start_faulty):
    """Not for the usual one, which is over long before the renderer goes on."""
    daemon = start_faulty("--timeout-ms", "100")
    with daemon.busy() as client:
        daemon.process.send_signal(signal.SIGTERM)
        assert wait_for(lambda: "SIGTERM: " in daemon.text)
        time.sleep(6)
    assert client.recv(12) == b"HTTP/1.1 200"
    assert daemon.process.wait(timeout=180) == 0


def answer_on(client):
    """What comes until the daemon closes the connection."""
    return b"".join(iter(lambda: client.recv(1 << 16), b""))


def test_shutdown_refuses_what_takes_too_long(start_daemon):
    """Each who waits hears why, whatever it waits for, and is logged so."""
    daemon = start_daemon("--drain-s", "1")
    long = {"model": {"name": "reference", "samples": 4096}, "output": {"width": 320, "height": 240}}  # takes minutes
    clients = [send(daemon, long, X_Request_Id="cut-own"), send(daemon, long, X_Request_Id="cut-shared")]
    clients.append(send(daemon, {"model": {**long["model"], "seed": 2}, "output": long["output"]}, X_Request_Id="cut-queued"))
    both = json.dumps({"scene": long, "variants": [{}, {"model": {"seed": 3}}]}).encode()
    clients.append(socket.create_connection(("127.0.0.1", daemon.port), timeout=180))
    clients[3].sendall(
        b"POST /v1/compare HTTP/1.1\r\nHost: x\r\nX-Timeout-Ms: 3600000\r\nX-Request-Id: cut-compared\r\n"
        b"Content-Type: application/json\r\nContent-Length: %d\r\n\r\n%s" % (len(both), both)
    )
    assert wait_for(lambda: daemon.metric("stratus_requests_in_flight") == 5)  # the scrape is one
    daemon.process.send_signal(signal.SIGTERM)
    for client in clients:
        head, body = answer_on(client).split(b"\r\n\r\n", 1)
        assert head.startswith(b"HTTP/1.1 503 ") and b"\r\nRetry-After: " in head
        assert b"application/problem+json" in head and json.loads(body)["type"] == "urn:stratus:problem:shutting-down"
        client.close()
    assert daemon.process.wait(timeout=180) == 0
    ends = [line for line in daemon.lines if " request id=cut-" in line]
    assert len(ends) == 4 and all(" status=503 " in line for line in ends), ends
    assert any("4 requests are not done after 1 s (--drain-s)" in line for line in daemon.lines)


def test_shutdown_when_idle_is_quick(start_daemon):
    """A connection that rests, which would be closed after 30 s, is not waited for."""

    def is_quick():
        daemon = start_daemon()
        idle = daemon.connect()
        idle.request("GET", "/healthz")
        idle.getresponse().read()
        begin = time.monotonic()
        daemon.process.send_signal(signal.SIGINT)
        assert daemon.process.wait(timeout=180) == 0
        idle.close()
        return time.monotonic() - begin < 25

    assert in_some_try(is_quick)


def test_clients_that_leave(start_faulty):
    """Their renders are dropped, and the daemon goes on. Meanwhile probes do not wait for the renderer, which stands still."""
    daemon = start_faulty("--queue-length", "32")
    with daemon.busy():
        for client in [send(daemon, {"clouds": {"seed": i}, "output": SMALL}) for i in range(12)]:
            client.close()
        for _ in range(20):
            assert daemon.get("/healthz").status == 200
            assert daemon.get("/readyz").status == 200
    assert wait_for(lambda: daemon.metric('stratus_renders_ended_total{reason="abandoned"}') == 12)
    daemon.settle()
    assert daemon.render({"output": {"width": 32, "height": 32}}).status == 200


def run(*flags, **environment):
    return subprocess.run(
        [str(BUILD / "stratusd"), *flags], env={**os.environ, **environment}, capture_output=True, text=True, timeout=300
    )


@pytest.mark.parametrize(
    "flags",
    [
        ["--nonsense"],
        ["--listen"],
        ["--queue-length", "0"],
        ["--queue-length", "many"],
        ["--pass", "quick"],
        ["--log-level=loud"],
        ["--log-format=xml"],
        ["--device", "1e3"],
        ["--workers=-1"],
        ["--droplets-mb", "0"],
        ["--droplets-disk-mb=-1"],
        ["--asset-max-mb", "0"],
        ["--asset-count=-1"],
        ["--assets-disk-mb=all"],
        ["--assets-mb", "0"],
        ["--queue-mpixels", "0"],
        ["--memory-mb", "1"],
        ["--picture-mpixels", "65"],
        ["--connections", "0"],
        ["--connections-per-address=-1"],
        ["--header-max-kb", "2048"],
        ["--body-max-kb=all"],
        ["--read-timeout-s", "0.5"],
        ["--recycle-mb=-1"],
        ["--golden-s=often"],
        ["--hang-ms", "0"],
        ["--drain-s=-1"],
        ["--images-mb", "-1"],
        ["--images-mb", "1.5"],
        ["--images-mb=2000000"],
        ["stray"],
    ],
)
def test_bad_flags(flags):
    result = run(*flags)
    assert result.returncode == 2
    assert result.stdout == ""
    assert flags[0].split("=")[0] in result.stderr


def test_bad_environment():
    result = run(STRATUS_QUEUE_LENGTH="x")
    assert result.returncode == 2
    assert "STRATUS_QUEUE_LENGTH" in result.stderr


def test_settings_are_printed():
    result = run("--print-config", "--queue-length=7", "--images-mb=3", STRATUS_QUEUE_LENGTH="5", STRATUS_WORKERS="3", XDG_STATE_HOME="/tmp/x")
    settings = dict(line.split("=", 1) for line in result.stdout.splitlines())
    assert result.returncode == 0
    assert settings["STRATUS_QUEUE_LENGTH"] == "7"
    assert settings["STRATUS_WORKERS"] == "3"
    assert settings["STRATUS_IMAGES_MB"] == "3"
    assert settings["STRATUS_STATE_DIR"] == "/tmp/x/stratus"


def test_help_and_version():
    text = run("--help").stdout
    for flag in "listen state-dir kernel device require-gpu pass shader-dir image-module queue-length workers timeout-ms drain-s cache-mb recycle-mb golden-s hang-ms images-mb droplets-mb droplets-disk-mb asset-max-mb asset-count assets-disk-mb assets-mb log-level log-format".split():
        assert "--" + flag in text and "STRATUS_" + flag.upper().replace("-", "_") in text
    assert run("--version").stdout.startswith("stratus ")


def test_address_in_use(daemon, tmp_path):
    result = run("--listen", f"127.0.0.1:{daemon.port}", "--state-dir", str(tmp_path), STRATUS_KERNEL=str(BUILD / "mie.kernel"))
    assert result.returncode == 1
    assert "--listen" in result.stderr


def test_bad_address(tmp_path):
    for listen in ("nowhere", "127.0.0.1:", "1.2.3.4.5:80", "::1:80", "127.0.0.1:65536", "127.0.0.1:99999", "127.0.0.1: 80"):
        assert run("--listen", listen, "--state-dir", str(tmp_path)).returncode == 1


def test_state_directory_is_tried_before_the_table_is_computed(tmp_path):
    state = tmp_path / "state"
    state.write_text("a file")
    result = run("--listen", "127.0.0.1:0", "--state-dir", str(state), "--kernel", str(tmp_path / "none"))
    assert result.returncode == 1
    assert f"state directory {state}" in result.stderr
    assert "computing" not in result.stderr


def test_log_of_a_request_that_cannot_be_read(start_daemon):
    daemon = start_daemon()
    with socket.create_connection(("127.0.0.1", daemon.port), timeout=180) as client:
        client.sendall(b"GET /somewhere HTTP/1.1\r\nHos")
    assert wait_for(lambda: " method=- path=/somewhere status=400 " in daemon.log.read_text())


def test_ipv6(tmp_path):
    if not socket.has_ipv6:
        pytest.skip("no IPv6 here")
    try:
        socket.create_server(("::1", 0), family=socket.AF_INET6).close()
    except OSError:
        pytest.skip("no IPv6 here")
    from conftest import KERNEL

    process = subprocess.Popen(
        [str(BUILD / "stratusd"), "--listen", "[::1]:0", "--state-dir", str(tmp_path), "--kernel", str(KERNEL)],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    line = process.stdout.readline()
    assert line.startswith("stratusd listening on http://[::1]:")
    connection = http.client.HTTPConnection("::1", int(line.rsplit(":", 1)[1]), timeout=180)
    connection.request("GET", "/healthz")
    assert connection.getresponse().status == 200
    connection.close()
    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=180) == 0
    process.stdout.close()
