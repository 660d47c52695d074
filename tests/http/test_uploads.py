"""Files of strangers against the daemon itself: names that would leave the folder, what others put into it, decoders that fail, and death at any moment."""
import concurrent.futures
import contextlib
import http.client
import json
import os
import pathlib
import random
import re
import signal
import socket
import subprocess
import threading
import time

import numpy
import pytest

from conftest import BUILD, ROOT, SANITIZED, Daemon, in_some_try, wait_for
from test_assets import SMALL, names_of, png_by_hand
from test_service import assert_problem

GREY = png_by_hand(2, 2, b"\0\x80\x80" * 2)


# --- names and the folder ----------------------------------------------------------------------------------------------------------

OUTSIDE = [
    b"..", b"../x", b"..%2fx", b"%2e%2e%2fx", b"%2e%2e/x", b"..%252fx", b"..%5cx", b"..\\x", b"/etc/passwd", b"%2fetc%2fpasswd", b"//etc/passwd",
    b"a/../../x", b"a%2f..%2f..%2fx", b"./x", b"%2e", b".", b".hidden", b"a%00", b"a%00.png", b"%00", b"a\x01b", b"a%0ab", b"a%0d%0aX: y", b"a%7f",
    b"%c0%ae%c0%ae%c0%afx", b"%ef%bc%8e%ef%bc%8e/x", b"\xc0\xae\xc0\xae\xc0\xafx", b"files/a", b"../files/outside", b"%", b"%2", b"%zz", b"~", b"a;b", b"a b", b"x" * 64,
]  # fmt: skip


def raw(daemon, method, target, body=b""):
    """The status of a request whose target no library has tidied up."""
    with socket.create_connection(("127.0.0.1", daemon.port), timeout=180) as client:
        client.sendall(method + b" " + target + b" HTTP/1.1\r\nHost: x\r\nConnection: close\r\nContent-Length: %d\r\n\r\n" % len(body) + body)
        answer = b""
        with contextlib.suppress(ConnectionError):
            while more := client.recv(65536):
                answer += more
    return int(answer.split(b" ", 2)[1]) if answer else 0


def files_below(folder):
    """But for droplet tables, which come in their own time."""
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if "droplets" not in path.parts}


def test_no_name_leaves_the_folder(daemon):
    state = daemon.log.parent
    (state / "outside").write_bytes(GREY)
    assert daemon.request("PUT", "/v1/assets/inside", GREY).status in (201, 204)
    before = files_below(state)
    for name in OUTSIDE:
        for prefix in (b"/v1/assets/", b"http://127.0.0.1/v1/assets/"):
            target = prefix + name
            # 404 also where the address is another than that of an asset; 400 by the library where it is none at all.
            assert raw(daemon, b"PUT", target, GREY) in (400, 404, 405), name
            assert raw(daemon, b"GET", target) in (400, 404, 505), name
            assert raw(daemon, b"DELETE", target) in (400, 404, 405, 505), name
    assert wait_for(lambda: files_below(state) == before)
    for name in ("../outside", "/etc/passwd", "..", "inside/"):
        answer = daemon.render({"clouds": {"map": name}, "output": SMALL})
        assert_problem(answer, 422, "invalid-scene")
    assert_problem(daemon.render({"clouds": {"map": "inside\0"}, "output": SMALL}), 400, "not-json")
    daemon.request("DELETE", "/v1/assets/inside")
    (state / "outside").unlink()


def test_what_others_put_into_the_folder(daemon, tmp_path):
    """Links, pipes, folders and plain files are no assets: they are neither read nor listed, and nothing waits for them."""
    folder = daemon.log.parent / "state" / "assets" / "files"
    assert daemon.request("PUT", "/v1/assets/real", GREY).status in (201, 204)
    secret = tmp_path / "secret"
    secret.write_bytes((folder / "real").read_bytes())
    (folder / "link").symlink_to(secret)
    (folder / "hop").symlink_to("real")
    (folder / "loop").symlink_to("loop")
    (folder / "device").symlink_to("/dev/zero")
    (folder / "folder").mkdir()
    (folder / "plain").write_bytes(GREY)
    os.mkfifo(folder / "pipe")
    odd = ["link", "hop", "loop", "device", "folder", "plain", "pipe"]
    listed = names_of(daemon)
    assert "real" in listed and not set(listed) & set(odd)
    for name in odd:
        assert_problem(daemon.get(f"/v1/assets/{name}"), 404, "not-found")
        assert daemon.render({"clouds": {"map": name}, "output": SMALL}).pointers == {"/clouds/map"}
    # A name is taken, not what it points at.
    for name in ("link", "hop", "loop", "device", "plain", "pipe"):
        assert daemon.request("PUT", f"/v1/assets/{name}", GREY).status == 201
        assert daemon.get(f"/v1/assets/{name}").body == GREY and not (folder / name).is_symlink()
        assert daemon.request("DELETE", f"/v1/assets/{name}").status == 204
    assert secret.exists() and daemon.get("/v1/assets/real").body == GREY
    (folder / "link").symlink_to(secret)
    assert daemon.request("DELETE", "/v1/assets/link").status == 204
    assert secret.exists()
    assert daemon.request("PUT", "/v1/assets/folder", GREY).status == 500
    (folder / "folder").rmdir()
    daemon.request("DELETE", "/v1/assets/real")


def is_swept(daemon):
    """Nothing of uploads that failed is left: it goes a moment after their answer."""
    return wait_for(lambda: not any((daemon.log.parent / "state" / "assets" / "incoming").iterdir()))


def begin_upload(daemon, first, headers=b"Content-Length: 60000000", address="127.0.0.1"):
    """Sends the headers and the first bytes of a body, and nothing more."""
    client = socket.create_connection(("127.0.0.1", daemon.port), timeout=180, source_address=(address, 0))
    client.sendall(b"PUT /v1/assets/begun HTTP/1.1\r\nHost: x\r\n" + headers + b"\r\n\r\n" + first)
    return client


def read_all(client):
    with client:
        return b"".join(iter(lambda: client.recv(65536), b""))


CHUNKED = b"Transfer-Encoding: chunked"


@pytest.mark.parametrize("headers, first", [(b"Content-Length: 60000000", b"GIF89a__"), (CHUNKED, b"20\r\nGIF89a" + bytes(26) + b"\r\n")], ids=["sized", "chunked"])
def test_no_pictures_are_known_by_their_first_bytes(start_daemon, headers, first):
    """While the rest is still to come, which is waited for much longer than this test."""
    daemon = start_daemon("--read-timeout-s", "3600", "--log-format", "json")
    refused = 'stratus_problems_total{type="unsupported-media-type"}'
    assert daemon.metric(refused) == 0
    answer = read_all(begin_upload(daemon, first, headers))
    head, body = answer.split(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 415 ") and b"Connection: close" in head
    assert json.loads(body)["type"] == "urn:stratus:problem:unsupported-media-type"
    logged = lambda: [line for line in map(json.loads, daemon.lines) if line.get("path") == "/v1/assets/begun"]
    assert wait_for(logged)
    assert [line["status"] for line in logged()] == [415] and daemon.metric(refused) == 1
    assert is_swept(daemon)


def test_a_whole_body_that_is_no_picture_leaves_its_connection(daemon):
    connection = daemon.connect()
    for _ in range(3):
        connection.request("PUT", "/v1/assets/bad", b"GIF89a" + bytes(30))
        answer = connection.getresponse()
        assert answer.status == 415 and answer.getheader("Connection") != "close" and answer.read()
        assert connection.sock
    connection.close()


def test_no_room_is_known_in_mid_body(start_daemon):
    daemon = start_daemon("--read-timeout-s", "3600", "--assets-disk-mb", "1")
    piece = b"\x89PNG\r\n\x1a\n" + bytes((1 << 20) - 8)
    client = begin_upload(daemon, b"%x\r\n%b\r\n" % (len(piece), piece), CHUNKED)
    client.sendall(b"10\r\n" + bytes(16) + b"\r\n")
    assert read_all(client).startswith(b"HTTP/1.1 507 ")
    assert is_swept(daemon)


def test_bad_pictures_are_known_by_their_header(daemon):
    """However much is said to follow: nothing is decoded and nothing is kept."""
    wide = png_by_hand(100000, 4, b"\0" * 100)
    assert_problem(daemon.request("PUT", "/v1/assets/bad", wide), 422, "invalid-asset")
    assert is_swept(daemon)


# --- decoders that fail --------------------------------------------------------------------------------------------------------------

FAULTY_MODULE = """
#include "renderer/image/image.h"
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

static const struct image_api *real;

/* The image module, but for pictures of some widths. */
static bool decode(int fd, const struct picture_file *file, image_rows_taker *take, void *context, char *error, size_t size)
{
	if (file->width == 13)
		abort();
	while (file->width == 17)
		__asm__ volatile("");
	return real->decode(fd, file, take, context, error, size);
}

/* Pictures 19 wide are never written to their end. */
static bool encode(const struct frame *frame, const struct scene *scene, const struct image_metadata *metadata, const struct image_watch *watch,
		   struct image_buffer *buffer, char *error, size_t size)
{
	if (frame->width != 19)
		return real->encode(frame, scene, metadata, watch, buffer, error, size);
	fputs("a picture 19 wide is being written\\n", stderr);
	while (!watch->is_over(watch->context))
		usleep(1000);
	snprintf(error, size, "stopped");
	*buffer = (struct image_buffer){0};
	return false;
}

const struct image_api *stratus_image_api(void);
const struct image_api *stratus_image_api(void)
{
	static struct image_api faulty;
	void *module = dlopen(REAL, RTLD_NOW | RTLD_LOCAL);
	const struct image_api *(*entry)(void);
	if (!module)
		return NULL;
	*(void **)&entry = dlsym(module, "stratus_image_api");
	real = entry();
	faulty = *real;
	faulty.decode = decode;
	faulty.encode = encode;
	return &faulty;
}
"""


@pytest.fixture(scope="module")
def faulty(tmp_path_factory):
    """A daemon whose library fails on pictures 13, 17 and 19 wide; one 13 wide was stored before it began to fail."""
    folder = tmp_path_factory.mktemp("faulty")
    source, module = folder / "faulty.c", folder / "faulty.so"
    source.write_text(FAULTY_MODULE.replace("REAL", f'"{BUILD / "stratus-image.so"}"'))
    subprocess.run(["gcc", "-std=c17", "-D_GNU_SOURCE", "-shared", "-fPIC", f"-I{ROOT}", source, "-o", module, "-ldl"], check=True, timeout=300)
    earlier = Daemon(folder)
    assert earlier.request("PUT", "/v1/assets/earlier", strip(13)).status == 201
    earlier.stop()
    earlier.assert_clean()
    daemon = Daemon(folder, "--image-module", str(module))
    yield daemon
    status = daemon.stop()
    daemon.assert_clean()
    assert status == 0


def strip(width):
    return png_by_hand(width, 1, b"\0" + b"\x80" * width)


def decoder_of(daemon):
    """The id of its process; 0: there is none."""
    for pid in children_of(daemon.process.pid):
        with contextlib.suppress(OSError):
            if b"--decoder-process" in pathlib.Path(f"/proc/{pid}/cmdline").read_bytes():
                return pid
    return 0


def children_of(process):
    """Their ids; none of a process that is gone."""
    found = []
    for path in pathlib.Path(f"/proc/{process}/task").glob("*/children"):
        with contextlib.suppress(OSError):
            found += map(int, path.read_text().split())
    return found


def test_failing_decoder_costs_one_upload(faulty):
    assert faulty.request("PUT", "/v1/assets/good", strip(4)).status == 201
    process = decoder_of(faulty)
    for _ in range(3):
        crashed = faulty.request("PUT", "/v1/assets/bad", strip(13))
        assert_problem(crashed, 422, "invalid-asset")
        assert crashed.json["detail"] == "The picture makes its decoder fail."
    assert faulty.request("PUT", "/v1/assets/good", strip(5)).status == 204
    assert decoder_of(faulty) == process != 0  # the copy that had the picture has died, nothing else
    assert_problem(faulty.get("/v1/assets/bad"), 404, "not-found")
    assert is_swept(faulty)
    assert faulty.log.read_text().count("warning decoder: ") == 3
    assert faulty.render({"clouds": {"map": "good"}, "output": SMALL}).status == 200


def test_hanging_decoder_ends_with_the_deadline(faulty):

    def is_soon():
        began = time.monotonic()
        late = faulty.request("PUT", "/v1/assets/bad", strip(17), {"X-Timeout-Ms": "1000"})
        assert_problem(late, 504, "deadline-passed")
        return time.monotonic() - began < 30

    assert in_some_try(is_soon)
    # It is over, and not only given up.
    assert wait_for(lambda: not children_of(decoder_of(faulty)))
    assert faulty.request("PUT", "/v1/assets/good", strip(4)).status in (201, 204)


def test_renders_go_on_beside_it(faulty):
    with concurrent.futures.ThreadPoolExecutor(1) as pool:
        hanging = pool.submit(faulty.request, "PUT", "/v1/assets/bad", strip(17), {"X-Timeout-Ms": "3000"})
        assert wait_for(lambda: faulty.metric("stratus_requests_in_flight") > 1)
        assert faulty.render({"output": SMALL, "sun": {"elevation_deg": 21}}).status == 200
        assert hanging.result().status == 504


def copies_of(process):
    return [int(pid) for pid in pathlib.Path(f"/proc/{process}/task/{process}/children").read_text().split()]


def test_who_leaves_the_line_before_the_decoder_is_dropped_at_once(faulty):
    """While a picture is being looked through, and whatever that takes; who stays is served when it is over."""
    queued = 'stratus_cancelled_total{at="queued"}'
    assert faulty.request("PUT", "/v1/assets/good", strip(4)).status in (201, 204)
    before = faulty.metric(queued)
    render = b"GET /v1/render?clouds.map=good&clouds.resolution=%d&output.width=32&output.height=24 HTTP/1.1\r\nHost: x\r\nX-Timeout-Ms: 3600000\r\n\r\n"
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        hanging = pool.submit(faulty.request, "PUT", "/v1/assets/bad", strip(17), {"X-Timeout-Ms": "3600000"})
        assert wait_for(lambda: copies_of(decoder_of(faulty)))
        leaving, staying = (socket.create_connection(("127.0.0.1", faulty.port), timeout=300) for _ in range(2))
        leaving.sendall(render % 128)
        staying.sendall(render % 256)
        assert wait_for(lambda: faulty.metric("stratus_queue_taken") == 2)
        leaving.close()
        assert wait_for(lambda: faulty.metric("stratus_queue_taken") == 1)
        assert faulty.metric(queued) == before + 1
        assert not hanging.done()
        (copy,) = copies_of(decoder_of(faulty))
        os.kill(copy, signal.SIGKILL)
        assert hanging.result().status == 422
    assert staying.recv(12) == b"HTTP/1.1 200"
    staying.close()


def test_writing_a_picture_stops_when_nobody_waits(faulty):
    """Asked between rows: when the deadline passes, and when the client leaves. Neither is a failure of the encoder."""
    ended = {reason: f'stratus_renders_ended_total{{reason="{reason}"}}' for reason in ("expired", "abandoned", "failed")}
    before = {reason: faulty.metric(name) for reason, name in ended.items()}
    begun = lambda: faulty.log.read_text().count("a picture 19 wide is being written")
    encoding, wasted = 'stratus_cancelled_total{at="encoding"}', 'stratus_wasted_render_seconds_total{reason="abandoned"}'
    late = faulty.render({"output": {"width": 19, "height": 16}}, X_Timeout_Ms="2000")
    assert_problem(late, 504, "deadline-passed")
    assert wait_for(lambda: faulty.metric("stratus_queue_taken") == 0)
    cancelled, seconds, earlier = faulty.metric(encoding), faulty.metric(wasted), begun()
    with socket.create_connection(("127.0.0.1", faulty.port), timeout=60) as client:
        client.sendall(b"GET /v1/render?output.width=19&output.height=17 HTTP/1.1\r\nHost: x\r\nX-Timeout-Ms: 3600000\r\n\r\n")
        assert wait_for(lambda: begun() == earlier + 1)
        time.sleep(0.2)
    assert wait_for(lambda: faulty.metric("stratus_queue_taken") == 0)
    assert {reason: faulty.metric(name) - before[reason] for reason, name in ended.items()} == {"expired": 1, "abandoned": 1, "failed": 0}
    assert faulty.metric(encoding) == cancelled + 1
    assert faulty.metric(wasted) >= seconds + 0.2
    assert "encoding failed" not in faulty.log.read_text()


def test_stored_picture_that_cannot_be_read_any_more(faulty):
    answer = faulty.render({"clouds": {"map": "earlier"}, "output": SMALL})
    assert answer.status == 500 and "decoder" not in answer.body.decode()
    assert faulty.render({"output": SMALL}).status == 200


def test_decoder_has_nothing_of_the_daemon(faulty):
    """Neither its descriptors nor its environment, and no way to more rights."""
    assert faulty.request("PUT", "/v1/assets/good", strip(4)).status in (201, 204)
    process = pathlib.Path(f"/proc/{decoder_of(faulty)}")
    assert {int(path.name) for path in (process / "fd").iterdir()} <= {0, 1, 2, 3}
    names = {variable.split(b"=")[0].decode() for variable in (process / "environ").read_bytes().split(b"\0") if variable}
    assert all(re.match("LD_|[A-Z]*SAN_", name) for name in names)
    status = (process / "status").read_text()
    assert re.search(r"^NoNewPrivs:\s1$", status, re.M)
    # Killed while it waits, it is replaced and nobody notices.
    os.kill(int(process.name), signal.SIGKILL)

    def is_dead():
        with contextlib.suppress(OSError):
            return "zombie" in (process / "status").read_text()
        return True

    assert wait_for(is_dead)
    assert faulty.request("PUT", "/v1/assets/good", strip(5)).status == 204
    assert decoder_of(faulty) not in (0, int(process.name))


# --- death at any moment -------------------------------------------------------------------------------------------------------------

# More of them, such as 50, for a proof rather than a test.
KILLS = int(os.environ.get("STRATUS_KILLS", "2" if SANITIZED else "3"))


def noise(seed):
    rows = numpy.random.default_rng(seed).integers(0, 256, (150, 151), dtype=numpy.uint8)
    rows[:, 0] = 0  # the filter
    return png_by_hand(150, 150, rows.tobytes())


def test_killed_again_and_again(tmp_path):
    """Under every name is one of the pictures that were sent for it, whole, or none; what was answered is there; nothing is left beside."""
    names = ["one", "two", "three"]
    versions = [noise(seed) for seed in range(5)]
    source = random.Random(1)
    kept = {}  # what each name must hold at least: the last that was answered, or what was under way behind it
    interrupted = 0
    decoder = 0
    for _ in range(KILLS):
        daemon = Daemon(tmp_path)
        try:
            assert not decoder or wait_for(lambda: not pathlib.Path(f"/proc/{decoder}").exists())
            incoming = tmp_path / "state" / "assets" / "incoming"
            assert not incoming.exists() or not any(incoming.iterdir())
            listed = {asset["name"]: asset for asset in daemon.get("/v1/assets").json["assets"]}
            assert set(listed) <= set(names)
            for name in names:
                got = daemon.get(f"/v1/assets/{name}")
                body = got.body if got.status == 200 else None
                assert body in kept.get(name, [None]), name
                assert (body is None) == (name not in listed)
            stop = threading.Event()
            under_way = {}

            def change(name, seed):
                own = random.Random(seed)
                while not stop.is_set():
                    version = own.choice(versions + [None])
                    under_way[name] = version
                    with contextlib.suppress(OSError, http.client.HTTPException):
                        answer = daemon.request("DELETE", f"/v1/assets/{name}") if version is None else daemon.request("PUT", f"/v1/assets/{name}", version)
                        assert answer.status in (201, 204, 404)
                        kept[name] = [version]
                        under_way.pop(name)

            for name in names:
                kept[name] = kept.get(name, [None])
            with concurrent.futures.ThreadPoolExecutor(len(names)) as pool:
                running = [pool.submit(change, name, source.random()) for name in names]
                wait_for(lambda: decoder_of(daemon))
                time.sleep(0.2 + 0.3 * source.random())
                decoder = decoder_of(daemon)
                daemon.process.send_signal(signal.SIGKILL)
                stop.set()
                for done in running:
                    done.result()
            for name, version in under_way.items():
                kept[name] = kept[name] + [version]
            interrupted += len(under_way)
        finally:
            daemon.process.kill()
            daemon.stop()
            daemon.assert_clean()
    assert interrupted > 0
    assert wait_for(lambda: not pathlib.Path(f"/proc/{decoder}").exists())
