"""The command line client against a server of our own, so that every kind of answer can be had."""

import http.server
import json
import os
import re
import stat
import subprocess
import threading

import pytest

from conftest import BUILD, Answerer

IMAGE = b"\x89PNG not really" * 1000
PRESETS = [
    {"name": "noon", "title": "High sun", "description": "", "scene": {"sun": {"elevation_deg": 60}}},
    {"name": "dusk", "title": "Low sun", "description": "", "scene": {"sun": {"elevation_deg": 2}}},
]
PROBLEM = {
    "type": "about:blank",
    "title": "The scene is refused",
    "status": 422,
    "detail": "2 members are wrong\x1b[31m",
    "errors": [{"pointer": "/sun/elevation_deg", "detail": "above 90"}, {"pointer": "/moon", "detail": "unknown"}],
}


class Handler(Answerer):
    def do_GET(self):
        self.server.seen.append(self)
        if self.path.startswith("/v1/assets"):
            self.server.reply(self)
        elif self.path == "/v1/presets":
            self.answer(200, "application/json", json.dumps({"presets": PRESETS}).encode())
        else:
            self.answer(self.server.health, "text/plain", b"words\n")

    def do_POST(self):
        self.body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        self.server.seen.append(self)
        self.server.reply(self)

    def do_PUT(self):
        if "Content-Length" in self.headers:
            self.body = self.rfile.read(int(self.headers["Content-Length"]))
        else:
            self.body = b""
            while size := int(self.rfile.readline(), 16):
                self.body += self.rfile.read(size)
                self.rfile.readline()
            self.rfile.readline()
        self.server.seen.append(self)
        self.server.reply(self)

    def do_DELETE(self):
        self.server.seen.append(self)
        self.server.reply(self)


def image(handler):
    timing = 'queue;dur=0.41, optics;desc="reused";dur=0.1,view;dur=12.5;other=7, total;dur=20.25'
    handler.answer(200, "image/png", IMAGE, [("Server-Timing", timing), ("Server-Timing", "late;dur=1")])


def problem(handler):
    handler.answer(422, "application/problem+json", json.dumps(PROBLEM).encode())


@pytest.fixture
def server():
    daemon = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    daemon.seen, daemon.health, daemon.reply = [], 200, image
    thread = threading.Thread(target=daemon.serve_forever, args=(0.01,))
    thread.start()
    yield daemon
    daemon.shutdown()
    daemon.server_close()
    thread.join()


def stratus(server, *arguments, **keywords):
    url = f"http://127.0.0.1:{server.server_port}" if server else "http://127.0.0.1:9"
    environment = {**os.environ, "STRATUS_SERVER": url}
    return subprocess.run([BUILD / "stratus", *map(str, arguments)], env=environment, capture_output=True, timeout=180, **keywords)


def test_empty_scene(server, tmp_path):
    done = stratus(server, "render", "-o", tmp_path / "sky.PNG")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "sky.PNG").read_bytes() == IMAGE
    assert server.seen[0].path == "/v1/render"
    assert server.seen[0].body == {"output": {"format": "png"}}
    assert os.listdir(tmp_path) == ["sky.PNG"]


def test_timing_table(server, tmp_path):
    lines = stratus(server, "render", "-o", tmp_path / "a.png").stderr.decode().splitlines()
    rows = [line.split() for line in lines]
    assert rows[0] == ["stage", "ms"]
    assert rows[1:6] == [["queue", "0.41"], ["optics", "0.10", "reused"], ["view", "12.50"], ["total", "20.25"], ["late", "1.00"]]
    assert rows[6][0] == "client" and rows[6][2:] == [str(len(IMAGE)), "bytes"]


def test_quiet(server, tmp_path):
    done = stratus(server, "render", "-q", "-o", tmp_path / "a.png")
    assert (done.stdout, done.stderr) == (b"", b"")


@pytest.mark.parametrize("name, format", [("a.exr", "exr"), ("a.EXR", "exr"), ("a.png", "png"), ("a.dat", None)])
def test_format_follows_extension(server, tmp_path, name, format):
    stratus(server, "render", "-o", tmp_path / name)
    assert server.seen[0].body == ({"output": {"format": format}} if format else {})


@pytest.mark.parametrize("name, format", [("a.exr", "exr"), ("a.png", "png"), ("a.dat", "png"), ("-", "png")])
def test_extension_decides_over_the_scene(server, tmp_path, name, format):
    """A picture's scene names the format that it had: `info --scene a.png | render - -o again.exr` is an EXR all the same."""
    scene = '{"output": {"format": "%s", "width": 64}}'
    for said in ("png", "exr") if name.startswith("a.") and name != "a.dat" else ("png",):
        assert stratus(server, "render", "-", "-o", name if name == "-" else tmp_path / name, input=(scene % said).encode()).returncode == 0
    assert [seen.body for seen in server.seen] == [{"output": {"format": format, "width": 64}}] * len(server.seen)


@pytest.mark.parametrize("name", ["a.jpg", "a.JPEG", "a.tif", "a.webp", "a.gif", "a.hdr", "a.bmp", "a.mp4"])
def test_no_other_type_under_a_wrong_name(server, tmp_path, name):
    done = stratus(server, "render", "-o", tmp_path / name)
    assert done.returncode == 2 and b".png and .exr" in done.stderr
    assert not server.seen and os.listdir(tmp_path) == []


def test_standard_input_and_output(server):
    done = stratus(server, "render", "-", "-o", "-", input=b'{"sun": {"elevation_deg": 5}}')
    assert done.stdout == IMAGE
    assert server.seen[0].body == {"sun": {"elevation_deg": 5}}


def test_set(server, tmp_path):
    sets = ["sun.elevation_deg=10", "camera.position_m=[0, 0, 3000]", "ground.type=snow", "radiosity.enabled=false", "sun.elevation_deg=11"]
    arguments = [part for one in sets for part in ("--set", one)]
    assert stratus(server, "render", *arguments, "-o", tmp_path / "a").returncode == 0
    assert server.seen[0].body == {
        "sun": {"elevation_deg": 11},
        "camera": {"position_m": [0, 0, 3000]},
        "ground": {"type": "snow"},
        "radiosity": {"enabled": False},
    }


@pytest.mark.parametrize("text", ["sun", "=1", "sun.=1", ".sun=1"])
def test_set_wants_an_assignment(server, tmp_path, text):
    done = stratus(server, "render", "--set", text, "-o", tmp_path / "a.png")
    assert done.returncode == 2 and b"member=value" in done.stderr
    assert not server.seen


def test_set_through_a_value(server, tmp_path):
    done = stratus(server, "render", "--set", "sun=1", "--set", "sun.elevation_deg=1", "-o", tmp_path / "a.png")
    assert done.returncode == 2 and b"in the way" in done.stderr


def test_preset(server, tmp_path):
    done = stratus(server, "render", "--preset", "dusk", "--set", "sun.azimuth_deg=9", "-o", tmp_path / "a.png")
    assert done.returncode == 0
    assert server.seen[1].body == {"sun": {"elevation_deg": 2, "azimuth_deg": 9}, "output": {"format": "png"}}


def test_unknown_preset(server, tmp_path):
    done = stratus(server, "render", "--preset", "night", "-o", tmp_path / "a.png")
    assert done.returncode == 2 and b"night" in done.stderr


def test_presets(server):
    assert [line.split(maxsplit=1) for line in stratus(server, "presets").stdout.decode().splitlines()] == [
        ["noon", "High sun"],
        ["dusk", "Low sun"],
    ]
    assert stratus(server, "presets", "-q").stdout == b"noon\ndusk\n"
    assert json.loads(stratus(server, "presets", "noon").stdout) == PRESETS[0]["scene"]
    assert stratus(server, "presets", "night").returncode == 2


def test_refusal_names_every_member_and_writes_nothing(server, tmp_path):
    server.reply = problem
    (tmp_path / "a.png").write_bytes(b"old")
    done = stratus(server, "render", "-o", tmp_path / "a.png")
    text = done.stderr.decode()
    assert done.returncode == 1
    assert "422 The scene is refused" in text and "2 members are wrong" in text
    assert "  /sun/elevation_deg: above 90\n" in text and "  /moon: unknown\n" in text
    assert "\x1b" not in text
    assert (tmp_path / "a.png").read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["a.png"]


def test_failure_without_words(server, tmp_path):
    server.reply = lambda handler: handler.answer(502, "text/html", b"<html>", [("X-Request-Id", "abc")])
    done = stratus(server, "render", "-o", tmp_path / "a.png")
    assert done.returncode == 1 and b"502" in done.stderr and b"abc" in done.stderr


def test_answer_that_is_no_image(server, tmp_path):
    server.reply = lambda handler: handler.answer(200, "text/html", b"<html>")
    done = stratus(server, "render", "-o", tmp_path / "a.png")
    assert done.returncode == 1 and b"text/html" in done.stderr
    assert not os.listdir(tmp_path)


def test_broken_answer(server, tmp_path):
    def cut(handler):
        handler.send_response(200)
        handler.send_header("Content-Type", "image/png")
        handler.send_header("Content-Length", "1000")
        handler.end_headers()
        handler.wfile.write(b"half")

    server.reply = cut
    done = stratus(server, "render", "-o", tmp_path / "a.png")
    assert done.returncode == 3
    assert not os.listdir(tmp_path)


def test_no_server(tmp_path):
    done = stratus(None, "render", "-o", tmp_path / "a.png")
    assert done.returncode == 3 and b"127.0.0.1:9" in done.stderr


@pytest.mark.parametrize("place", ["before", "after"])
def test_server_option_wins(server, tmp_path, place):
    option = ["--server", f"http://127.0.0.1:{server.server_port}/"]
    command = ["render", "-o", str(tmp_path / "a.png")]
    assert stratus(None, *(option + command if place == "before" else command + option)).returncode == 0


def test_timeout_is_passed_on(server, tmp_path):
    stratus(server, "render", "--timeout", "2.5", "-o", tmp_path / "a.png")
    assert server.seen[0].headers["X-Timeout-Ms"] == "2500"
    for bad in ("soon", "0", "3601"):  # the daemon takes an hour at most
        assert stratus(server, "render", "--timeout", bad, "-o", tmp_path / "a.png").returncode == 2


def test_unwritable(server, tmp_path):
    done = stratus(server, "render", "-o", tmp_path / "nowhere" / "a.png")
    assert done.returncode == 4 and b"nowhere" in done.stderr
    assert stratus(server, "render", "-o", "/dev/full").returncode == 4
    assert stat.S_ISCHR(os.stat("/dev/full").st_mode)


def test_replaces_a_file_through_its_link(server, tmp_path):
    (tmp_path / "real.png").write_bytes(b"old")
    os.chmod(tmp_path / "real.png", 0o640)
    (tmp_path / "link.png").symlink_to("real.png")
    assert stratus(server, "render", "-o", tmp_path / "link.png").returncode == 0
    assert (tmp_path / "link.png").is_symlink()
    assert (tmp_path / "real.png").read_bytes() == IMAGE
    assert stat.S_IMODE(os.stat(tmp_path / "real.png").st_mode) == 0o640


def test_new_file_obeys_umask(server, tmp_path):
    stratus(server, "render", "-o", tmp_path / "a.png", preexec_fn=lambda: os.umask(0o027))
    assert stat.S_IMODE(os.stat(tmp_path / "a.png").st_mode) == 0o640


@pytest.mark.parametrize(
    "arguments",
    [[], ["paint"], ["render"], ["render", "a.json", "b.json", "-o", "c.png"], ["render", "--what"], ["render", "/nonexistent.json", "-o", "c.png"],
     ["render", "a.json", "--preset", "noon", "-o", "c.png"], ["presets", "a", "b"], ["asset"], ["asset", "paint"], ["asset", "put"], ["asset", "put", "a"],
     ["asset", "put", "a", "/nonexistent.png"], ["asset", "put", "a", "/"], ["asset", "put", "a/b", "/dev/null"], ["asset", "get", "a"],
     ["asset", "get", "../a", "-o", "b"], ["asset", "delete"], ["asset", "delete", "a", "b"], ["asset", "delete", ".a"], ["asset", "list", "a"],
     ["asset", "put", "a" * 64, "/dev/null"], ["asset", "delete", "a", "-o", "b"], ["asset", "get", "a", "-o", "b", "--new"]],
)  # fmt: skip
def test_bad_usage(server, arguments):
    done = stratus(server, *arguments)
    assert done.returncode == 2 and done.stderr
    assert not server.seen


@pytest.mark.parametrize("text", ["{", "[]", '{"a": 1, "a": 2}', "{'a': 1}"])
def test_bad_scene_file(server, tmp_path, text):
    (tmp_path / "scene.json").write_text(text)
    done = stratus(server, "render", tmp_path / "scene.json", "-o", tmp_path / "a.png")
    assert done.returncode == 2 and b"scene.json" in done.stderr


def test_help_and_version(server):
    assert b"render" in stratus(server, "--help").stdout
    assert b"--preset" in stratus(server, "render", "--help").stdout
    assert stratus(server, "--version").stdout.startswith(b"stratus ")


def test_health(server):
    done = stratus(server, "health")
    assert done.returncode == 0 and done.stdout == b"/healthz 200\n"
    server.health = 503
    done = stratus(server, "health", "--ready", "-q")
    assert done.returncode == 1 and done.stdout == b"" and server.seen[-1].path == "/readyz"
    assert stratus(None, "health").returncode == 3


ASSETS = [
    {"name": "hills.png", "content_type": "image/png", "bytes": 1234, "width": 30, "height": 20},
    {"name": "sea", "content_type": "image/x-exr", "bytes": 99, "width": 8192, "height": 1},
]


def test_asset_put(server, tmp_path):
    data = bytes(range(256)) * 9000  # more than one buffer, and enough for an expectation of 100
    (tmp_path / "map").write_bytes(data)
    server.reply = lambda handler: handler.answer(201, "text/plain", b"")
    done = stratus(server, "asset", "put", "hills.png", tmp_path / "map")
    assert done.returncode == 0 and done.stdout == b"", done.stderr
    assert b"hills.png" in done.stderr
    assert server.seen[0].command == "PUT" and server.seen[0].path == "/v1/assets/hills.png"
    assert server.seen[0].body == data and "If-None-Match" not in server.seen[0].headers
    done = stratus(server, "asset", "put", "-q", "--new", "a-b_C.9", "-", input=b"abc")
    assert (done.returncode, done.stdout, done.stderr) == (0, b"", b"")
    assert server.seen[1].path == "/v1/assets/a-b_C.9" and server.seen[1].body == b"abc"
    assert server.seen[1].headers["If-None-Match"] == "*"


def test_asset_put_refused(server, tmp_path):
    (tmp_path / "map").write_bytes(b"abc")
    server.reply = problem
    done = stratus(server, "asset", "put", "a", tmp_path / "map")
    assert done.returncode == 1 and b"422 The scene is refused" in done.stderr
    assert stratus(None, "asset", "put", "a", tmp_path / "map").returncode == 3


def test_asset_list(server):
    server.reply = lambda handler: handler.answer(200, "application/json", json.dumps({"assets": ASSETS}).encode())
    lines = [line.split() for line in stratus(server, "asset", "list").stdout.decode().splitlines()]
    assert lines == [["hills.png", "image/png", "30", "x", "20", "1234"], ["sea", "image/x-exr", "8192", "x", "1", "99"]]
    assert stratus(server, "asset", "list", "-q").stdout == b"hills.png\nsea\n"
    server.reply = lambda handler: handler.answer(200, "application/json", b"[]")
    assert stratus(server, "asset", "list").returncode == 1


def test_asset_get(server, tmp_path):
    server.reply = image
    assert stratus(server, "asset", "get", "a", "-o", tmp_path / "a.png").returncode == 0
    assert (tmp_path / "a.png").read_bytes() == IMAGE
    assert stratus(server, "asset", "get", "a", "-o", "-").stdout == IMAGE
    assert stratus(server, "asset", "get", "a", "-o", "/dev/full").returncode == 4
    server.reply = problem
    assert stratus(server, "asset", "get", "a", "-o", tmp_path / "b.png").returncode == 1
    assert os.listdir(tmp_path) == ["a.png"]


def test_asset_delete(server):
    server.reply = lambda handler: handler.answer(204, "text/plain", b"")
    assert stratus(server, "asset", "delete", "a").returncode == 0
    assert (server.seen[0].command, server.seen[0].path) == ("DELETE", "/v1/assets/a")
    server.reply = problem
    assert stratus(server, "asset", "delete", "a").returncode == 1
    assert b"put NAME FILE" in stratus(server, "asset", "--help").stdout


def test_watch_renders_again_when_the_scene_is_saved(server, tmp_path):
    scene, image_path = tmp_path / "scene.json", tmp_path / "a.png"
    scene.write_text('{"sun": {"elevation_deg": 1}}')
    environment = {**os.environ, "STRATUS_SERVER": f"http://127.0.0.1:{server.server_port}"}
    command = [BUILD / "stratus", "render", "--watch", scene, "-o", image_path]
    process = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
    guard = threading.Timer(120, process.kill)  # so that what it does not say is a failure
    guard.start()
    try:

        def save(text):  # as editors do: at once
            (tmp_path / "new").write_text(text)
            os.replace(tmp_path / "new", scene)

        def await_line(words):
            for line in process.stderr:
                if words in line:
                    return
            raise AssertionError(f"it ended before it said {words}")

        await_line("waiting")
        assert image_path.read_bytes() == IMAGE
        save("{")
        await_line("scene.json: line 1")
        await_line("waiting")
        save('{"sun": {"elevation_deg": 2}}')
        await_line("waiting")
        assert [request.body["sun"]["elevation_deg"] for request in server.seen] == [1, 2]
        server.reply = problem
        save('{"sun": {"elevation_deg": 300}}')
        await_line("422")
        await_line("waiting")
        assert process.poll() is None
    finally:
        guard.cancel()
        process.terminate()
        process.wait(60)
        process.stderr.close()


@pytest.mark.parametrize("arguments", [["-o", "a.png"], ["-", "-o", "a.png"], ["s.json", "-o", "-"]])
def test_watch_wants_files(server, tmp_path, arguments):
    assert stratus(server, "render", "--watch", *arguments, cwd=tmp_path).returncode == 2
    assert not server.seen


def test_a_long_render_says_how_long_on_a_terminal(server, tmp_path):
    held = threading.Event()

    def late(handler):
        held.wait(60)
        image(handler)

    server.reply = late
    ours, theirs = os.openpty()
    environment = {**os.environ, "STRATUS_SERVER": f"http://127.0.0.1:{server.server_port}"}
    command = [BUILD / "stratus", "render", "-o", tmp_path / "a.png", "--timeout", "600"]
    process = subprocess.Popen(command, env=environment, stderr=theirs)
    os.close(theirs)
    guard = threading.Timer(120, process.kill)
    guard.start()
    text = b""
    while not re.search(rb"rendering, \d+ s of at most 600 s", text):
        text += os.read(ours, 4096)
    held.set()
    assert process.wait(60) == 0
    guard.cancel()
    while True:
        try:
            text += os.read(ours, 4096)
        except OSError:  # how a terminal ends
            break
    os.close(ours)
    assert b"\r\x1b[Kstage" in text
