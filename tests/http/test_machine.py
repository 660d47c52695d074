"""What a machine may lack: a GPU, descriptors, room on the disk; and signals that come early."""
import os
import resource
import signal
import socket
import subprocess

import pytest

from conftest import BUILD, KERNEL, SANITIZED, wait_for
from test_limits import HOST, read_all, status_of
from test_uploads import noise

SMALL = {"output": {"width": 32, "height": 24}}
BESIDE = 320  # descriptors that are not for connections, of which each may need two


def start(folder, *flags, **options):
    command = [BUILD / "stratusd", "--listen=127.0.0.1:0", "--state-dir", folder / "state", "--kernel", KERNEL, *flags]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)


def test_software_rendering_is_said_and_can_be_refused(daemon, tmp_path):
    """Never in silence: in the log, at /readyz, in metrics; and --require-gpu is for those who would rather have none."""
    ready = daemon.get("/readyz").json
    info = [line for line in daemon.get("/metrics").body.decode().splitlines() if line.startswith("stratus_gl_info{")]
    assert len(info) == 1 and f'software="{int(ready["software"])}"' in info[0]
    assert ("warning gl: no GPU in use, rendering on the processor" in daemon.log.read_text()) == ready["software"]
    picky = start(tmp_path, "--require-gpu")
    if not ready["software"]:
        assert picky.stdout.readline().startswith("stratusd listening")
        picky.send_signal(signal.SIGTERM)
    out, error = picky.communicate(timeout=300)
    assert picky.returncode == (1 if ready["software"] else 0)
    if ready["software"]:
        assert out == "" and "--require-gpu refuses" in error


def test_a_device_that_is_not_there(tmp_path):
    absent = start(tmp_path, "--device", "99")
    out, error = absent.communicate(timeout=300)
    assert absent.returncode == 1 and out == "" and "99" in error


def with_descriptors(number):
    return lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (number, number))


def test_few_descriptors_are_few_connections(tmp_path):
    """So many as there are descriptors for: full of them the daemon still says how it is, and asks no system for more."""
    process = start(tmp_path, "--connections-per-address=500", preexec_fn=with_descriptors(BESIDE + 2 * 20))
    held = []
    try:
        line = process.stdout.readline()
        assert line.startswith("stratusd listening"), process.stderr.read()
        address = ("127.0.0.1", int(line.rsplit(":", 1)[1]))

        def ask(path):
            with socket.create_connection(address, timeout=60) as client:
                client.sendall(b"GET " + path + b" HTTP/1.1\r\n" + HOST + b"Connection: close\r\n\r\n")
                return read_all(client)

        assert b"\nstratus_connections_limit 20\n" in ask(b"/metrics")
        held = [socket.create_connection(address, timeout=60) for _ in range(20)]
        assert wait_for(lambda: b"\nstratus_connections 21\n" in ask(b"/metrics"))
        assert status_of(ask(b"/healthz")) == 200
        refused = ask(b"/v1/presets")
        assert status_of(refused) == 503 and b"At most 20 connections" in refused
    finally:
        for client in held:
            client.close()
        process.send_signal(signal.SIGTERM)
        _, error = process.communicate(timeout=300)
    assert process.returncode == 0
    assert f"the process may open {BESIDE + 2 * 20} files only, so 20 connections are served" in error


def test_too_few_descriptors_for_any(tmp_path):
    process = start(tmp_path, preexec_fn=with_descriptors(BESIDE))
    out, error = process.communicate(timeout=300)
    assert process.returncode == 1 and out == "" and f"may open {BESIDE} files only" in error


@pytest.mark.skipif(SANITIZED, reason="a sanitizer's report is a file too")
def test_no_room_on_the_disk(tmp_path):
    """A limit on the size of files stands for it: the upload is refused, said once, and leaves nothing."""
    process = start(tmp_path, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 17, 1 << 17)))
    try:
        address = ("127.0.0.1", int(process.stdout.readline().rsplit(":", 1)[1]))

        def put(name, data):
            with socket.create_connection(address, timeout=60) as client:
                head = b"PUT /v1/assets/" + name + b" HTTP/1.1\r\n" + HOST + b"Connection: close\r\nContent-Length: %d\r\n\r\n"
                client.sendall(head % len(data) + data)
                return status_of(read_all(client))

        large = noise(1) + bytes(4 << 20)
        assert put(b"large", large) == 507
        assert put(b"small", noise(1)) == 201
        assert os.listdir(tmp_path / "state" / "assets" / "incoming") == []
    finally:
        process.send_signal(signal.SIGTERM)
        _, error = process.communicate(timeout=300)
    assert process.returncode == 0
    assert error.count("cannot be written") == 1


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_signals_while_it_starts(tmp_path, number):
    """From the first line of the log on a signal ends it in order, and one to reload waits until there is something to be reloaded."""
    with open(tmp_path / "log", "wb") as log:
        command = [BUILD / "stratusd", "--listen=127.0.0.1:0", "--state-dir", tmp_path / "state", "--kernel", KERNEL]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True)
    assert wait_for(lambda: (tmp_path / "log").read_text() or process.poll() is not None)
    process.send_signal(number)
    if number == signal.SIGHUP:
        assert process.stdout.readline().startswith("stratusd listening")
        assert wait_for(lambda: "SIGHUP: reading keys and certificate again" in (tmp_path / "log").read_text())
        process.send_signal(signal.SIGTERM)
    process.communicate(timeout=300)
    assert process.returncode == 0
