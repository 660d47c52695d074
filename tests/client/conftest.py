"""A service of our own for commands that ask many times, and the real daemon; `stratus` runs the client against either."""
import http.server
import importlib.util
import json
import os
import pathlib
import subprocess
import threading

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = ROOT / os.environ.get("STRATUS_BUILD", "build")
PICTURE = b"\x89PNG of sorts" * 100


class Answerer(http.server.BaseHTTPRequestHandler):
    def log_message(self, *_):
        pass

    def answer(self, status, kind, body, headers=()):
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        for name, value in headers:
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)


class Handler(Answerer):
    protocol_version = "HTTP/1.1"

    def picture(self):
        self.answer(200, "image/png", PICTURE, [("Server-Timing", "view;dur=2.5, total;dur=4")])

    def problem(self, status, headers=(), **members):
        self.answer(status, "application/problem+json", json.dumps({"status": status, **members}).encode(), headers)

    def take(self, body):
        with self.server.lock:
            number = len(self.server.asked)
            self.server.asked.append((self.path, body))
        self.server.reply(self, number, body)

    def do_GET(self):
        self.take(None)

    def do_POST(self):
        self.take(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))


class Service(http.server.ThreadingHTTPServer):
    daemon_threads = True
    request_queue_size = 128

    def __init__(self):
        super().__init__(("127.0.0.1", 0), Handler)
        self.lock = threading.Lock()
        self.asked = []  # (path, JSON or None), in the order of arrival
        self.reply = lambda handler, number, body: handler.picture()
        self.url = f"http://127.0.0.1:{self.server_port}"
        self.bodies = lambda: [body for _, body in self.asked]

    def handle_error(self, *_):
        """Clients that go away are the rule here."""


@pytest.fixture
def service():
    server = Service()
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    yield server
    server.shutdown()
    server.server_close()
    thread.join()


@pytest.fixture
def stratus():
    """stratus(server, ...): runs the client against something with a `url`."""

    def run(server, *arguments, timeout=300, **keywords):
        environment = {**os.environ, "STRATUS_SERVER": server.url if server else "http://127.0.0.1:9"}
        environment.update(keywords.pop("env", {}))
        return subprocess.run([BUILD / "stratus", *map(str, arguments)], env=environment, capture_output=True, text=True, timeout=timeout, **keywords)

    return run


@pytest.fixture(scope="session")
def real_daemon(tmp_path_factory):
    spec = importlib.util.spec_from_file_location("daemon_of_tests", ROOT / "tests" / "http" / "conftest.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    daemon = module.Daemon(tmp_path_factory.mktemp("daemon"))
    daemon.url = f"http://127.0.0.1:{daemon.port}"
    yield daemon
    status = daemon.stop()
    daemon.assert_clean()
    assert status == 0
