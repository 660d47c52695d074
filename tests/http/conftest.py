"""Starts the daemon of $STRATUS_BUILD (build) on a free port, with a state directory of its own.

What the daemon writes on standard error goes to a file; a sanitizer's report in it fails the session.
"""
import http.client
import json
import os
import pathlib
import re
import signal
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
START_SECONDS = 180
ANSWER_SECONDS = 300


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

    def start(*flags):
        folder = tmp_path / str(len(started))
        folder.mkdir()
        started.append(Daemon(folder, *flags))
        return started[-1]

    yield start
    for daemon in started:
        daemon.stop()
        daemon.assert_clean()


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


def wait_for(condition, seconds=60):
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if condition():
            return True
        time.sleep(0.02)
    return False
