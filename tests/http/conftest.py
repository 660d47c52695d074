"""Starts the daemon of $STRATUS_BUILD (build) on a free port, with a state directory of its own.

What the daemon writes on standard error goes to a file; a sanitizer's report in it fails the session.
"""
import contextlib
import http.client
import itertools
import json
import os
import pathlib
import re
import signal
import socket
import subprocess
import time
import urllib.parse

import numpy
import OpenImageIO as oiio
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
# LeakSanitizer's own crash at the end of a process, seen once in some hundred of them, while it stops the driver's threads. It says nothing of
# the daemon, which had ended in order; the other daemons' ends are checked for leaks.
LEAK_CHECK_CRASHED = re.compile(r"Tracer caught signal .*\n==\d+==LeakSanitizer has encountered a fatal error\.\n(?:==\d+==HINT: .*\n?)*")
BUILD = (ROOT / os.environ.get("STRATUS_BUILD", "build")).resolve()
KERNEL = ROOT / "build" / "mie.kernel"
SANITIZED = "san-" in str(BUILD) or bool(os.environ.get("SAN"))
ANSWER_SECONDS = 300
# As scripts/test.sh has it for programs: what measures light, by code that other tests run as well.
measures = pytest.mark.skipif(SANITIZED, reason="the plain programs show it, and sanitizers find nothing that they do not find elsewhere")


class Answer:
    def __init__(self, response):
        self.status = response.status
        self.headers = response.headers
        self.body = response.read()

    @property
    def json(self):
        return json.loads(self.body)

    @property
    def pointers(self):
        return {error["pointer"] for error in self.json["errors"]}

    @property
    def timing(self):
        """Server-Timing as {name: {parameter: text}}."""
        stages = {}
        for name, parameters in re.findall(r'([a-z]+)((?:;[a-z]+=(?:"[^"]*"|[^;,]*))*)(?:, |$)', self.headers["Server-Timing"]):
            stages[name] = dict(re.findall(r';([a-z]+)=("[^"]*"|[^;,]*)', parameters))
        return stages


class Daemon:
    def __init__(self, folder, *flags, program=("stratusd",)):
        self.log = folder / "stderr.txt"
        self.stderr = open(self.log, "wb")
        command = [str(BUILD / program[0]), *program[1:], "--listen", "127.0.0.1:0", "--state-dir", str(folder / "state")]
        if KERNEL.exists():
            command += ["--kernel", str(KERNEL)]
        self.process = subprocess.Popen(
            command + ["--timeout-ms", str(ANSWER_SECONDS * 1000), *flags], stdout=subprocess.PIPE, stderr=self.stderr, text=True
        )
        line = self.process.stdout.readline()
        assert re.match("stratusd listening on https?://", line), self.log.read_text(errors="replace")[-4000:]
        self.port = int(line.rsplit(":", 1)[1])
        self.trust = None  # of a daemon that speaks TLS: an ssl.SSLContext

    def connect(self):
        if self.trust:
            return http.client.HTTPSConnection("127.0.0.1", self.port, timeout=ANSWER_SECONDS, context=self.trust)
        return http.client.HTTPConnection("127.0.0.1", self.port, timeout=ANSWER_SECONDS)

    def request(self, method, target, body=None, headers=None):
        connection = self.connect()
        try:
            try:
                connection.request(method, target, body, headers or {})
            except (BrokenPipeError, ConnectionResetError):
                pass  # the daemon answered before it had the whole body
            return Answer(connection.getresponse())
        finally:
            connection.close()

    def get(self, target, **headers):
        return self.request("GET", target, headers={k.replace("_", "-"): v for k, v in headers.items()})

    def head(self, target, **headers):
        return self.request("HEAD", target, headers={k.replace("_", "-"): v for k, v in headers.items()})

    def render(self, scene, **headers):
        body = scene if isinstance(scene, (str, bytes)) else json.dumps(scene)
        sent = {"Content-Type": "application/json"}
        sent.update({k.replace("_", "-"): v for k, v in headers.items()})
        return self.request("POST", "/v1/render", body, sent)

    def metric(self, sample):
        """The value of a sample by its text up to the value; 0 when it is not there."""
        for line in self.get("/metrics").body.decode().splitlines():
            if line.startswith(sample + " "):
                return float(line.rsplit(" ", 1)[1])
        return 0.0

    def settle(self):
        """Waits until every request before has been counted and logged: its client may have the answer before that."""
        assert wait_for(lambda: self.metric("stratus_requests_in_flight") == 1)

    def settled(self, sample):
        self.settle()
        return self.metric(sample)

    @property
    def lines(self):
        """Of the log, those that are whole."""
        return self.log.read_text(errors="replace").rpartition("\n")[0].splitlines()

    def await_reading(self, client):
        """Waits until the daemon has read all that came from this socket."""
        ports = f":{self.port:04X}", f":{client.getsockname()[1]:04X}"

        def unread():
            for line in pathlib.Path("/proc/net/tcp").read_text().splitlines()[1:]:
                _, own, other, _, queues, *_ = line.split()
                if (own[-5:], other[-5:]) == ports:
                    return int(queues.split(":")[1], 16)
            return None

        assert wait_for(lambda: unread() == 0)

    def stop(self):
        """Ends the daemon by its id; returns its exit status."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
        status = self.process.wait(timeout=ANSWER_SECONDS)
        self.process.stdout.close()
        self.stderr.close()
        return 0 if LEAK_CHECK_CRASHED.search(self.log.read_text(errors="replace")) else status

    def assert_clean(self):
        text = LEAK_CHECK_CRASHED.sub("", self.log.read_text(errors="replace"))
        for word in ("Sanitizer", "runtime error"):
            assert word not in text, text[max(0, text.index(word) - 500) : text.index(word) + 6000]


class FaultyDaemon(Daemon):
    """build/stratusd-faulty: the delivered one, linked with tests/faults/faults.c, which makes what it calls fail or wait when told to."""

    numbers = itertools.count(1)  # of pictures that nobody has asked for before

    def __init__(self, folder, *flags):
        self.faults = folder / "faults"
        self.faults.mkdir(exist_ok=True)
        self.waiting = []  # clients that stay until the end
        super().__init__(folder, "--golden-s", "0", "--hang-ms", "3600000", *flags, program=("stratusd-faulty", "--faults", str(self.faults)))

    def fail(self, name, number=0):
        os.symlink(str(number), self.faults / name)

    def heal(self, name):
        (self.faults / name).unlink()

    def has_failed(self, name):
        return not os.path.lexists(self.faults / name)

    def is_held(self):
        return os.path.lexists(self.faults / "held")

    @contextlib.contextmanager
    def holding(self):
        """The renderer stands still before its next pass, whichever that is, until this is left."""
        self.fail("hold")
        try:
            yield
        finally:
            self.heal("hold")
            assert wait_for(lambda: not self.is_held() or self.process.poll() is not None)

    @contextlib.contextmanager
    def busy(self, **headers):
        """The renderer stands still in the middle of a picture; gives the socket whose picture that is, which may be read afterwards."""
        with self.holding():
            client = send(self, {"clouds": {"seed": 900000 + next(self.numbers)}, "output": {"width": 32, "height": 24}}, **headers)
            self.waiting.append(client)
            assert wait_for(self.is_held)
            yield client

    def stop(self):
        if not self.has_failed("hold"):
            self.heal("hold")
        for client in self.waiting:
            client.close()
        return super().stop()

    def resets(self, reason):
        return self.metric(f'stratus_gl_context_resets_total{{reason="{reason}"}}')

    def is_ready(self):
        return self.get("/readyz").status == 200

    @property
    def text(self):
        return self.log.read_text(errors="replace")


def send(daemon, scene, address="127.0.0.1", **headers):
    """Asks for a picture and leaves the answer where it is: the socket. There is time: none is refused for being late."""
    body = json.dumps(scene).encode()
    client = socket.create_connection(("127.0.0.1", daemon.port), timeout=ANSWER_SECONDS, source_address=(address, 0))
    lines = ["POST /v1/render HTTP/1.1", "Host: x", "Content-Type: application/json", f"Content-Length: {len(body)}"]
    lines += [f"{name}: {value}" for name, value in {"X-Timeout-Ms": "3600000", **{k.replace("_", "-"): v for k, v in headers.items()}}.items()]
    client.sendall("\r\n".join(lines).encode() + b"\r\n\r\n" + body)
    return client


@pytest.fixture(scope="session")
def daemon(tmp_path_factory):
    daemon = Daemon(tmp_path_factory.mktemp("daemon"))
    yield daemon
    status = daemon.stop()
    daemon.assert_clean()
    assert status == 0


@pytest.fixture
def start_daemon(tmp_path):
    """Starts daemons with flags of their own; they end with the test."""
    started = []

    def start(*flags, kind=Daemon):
        folder = tmp_path / str(len(started))
        folder.mkdir()
        started.append(kind(folder, *flags))
        return started[-1]

    yield start
    for daemon in started:
        daemon.stop()
        daemon.assert_clean()


@pytest.fixture
def start_faulty(start_daemon):
    return lambda *flags: start_daemon(*flags, kind=FaultyDaemon)


@pytest.fixture
def read_image(tmp_path):
    """Reads PNG or EXR bytes: (pixels [height][width][channel] as floats, specification)."""

    def read(data):
        path = tmp_path / ("image.png" if data[:4] == b"\x89PNG" else "image.exr")
        path.write_bytes(data)
        source = oiio.ImageInput.open(str(path))
        assert source, oiio.geterror()
        pixels = numpy.array(source.read_image(oiio.FLOAT))
        spec = source.spec()
        source.close()
        return pixels, spec

    return read


def query_of(scene):
    """The dotted members of a scene."""

    def text(value):
        if isinstance(value, bool):
            return "true" if value else "false"
        return ",".join(map(str, value)) if isinstance(value, list) else str(value)

    members = [(f"{section}.{name}", text(value)) for section, inner in scene.items() for name, value in inner.items()]
    return urllib.parse.urlencode(members, safe=",")


def wait_for(condition, seconds=180):
    """Whether it came true: at once when it does, and so late only where it never will, on a busy machine too."""
    until = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > until:
            return False
        time.sleep(0.02)
    return True


def in_some_try(attempt, tries=6):
    """Bounds of time: a busy machine exceeds them now and then, and a daemon that does not keep them always."""
    return any(attempt() for _ in range(tries))
