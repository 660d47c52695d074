"""What strangers' programs send: what is no HTTP at all is answered as everything else is, clients that write first and read then hear why they are
refused, and no refusal costs more than it must."""
import http.client
import json
import re
import socket
import ssl
import time

import pytest

from conftest import ROOT, SANITIZED, Daemon, wait_for
from test_access import bearer, make_certificate, new_key
from test_contract import PNG
from test_limits import HOST, POST, ask, connect, problem_of, read_all, status_of

# What would tell a stranger how the daemon is made.
INSIDES = re.compile(rb"libmicrohttpd|MHD|jansson|JSON_[A-Z]|\.[ch]:\d|/work|/tmp|/usr|0x[0-9a-f]{6}|html", re.I)
PICTURES = ROOT / "tests" / "fuzz" / "seeds" / "picture"
LARGE = 24 << 20  # more than the sockets of both ends hold


@pytest.fixture(scope="module")
def narrow(tmp_path_factory):
    """Uploads are small there, and some of them need a key; TLS makes no difference."""
    folder = tmp_path_factory.mktemp("narrow")
    key, line = new_key("alice")
    (folder / "keys").touch(mode=0o600)
    (folder / "keys").write_text(line + "\n")
    daemon = Daemon(folder, "--asset-max-mb=1", "--assets-disk-mb=1", "--keys", str(folder / "keys"), "--open-metrics")
    daemon.shown = bearer(key)
    yield daemon
    status = daemon.stop()
    daemon.assert_clean()
    assert status == 0


def headers_of(answer):
    lines = answer[: answer.index(b"\r\n\r\n")].decode().split("\r\n")[1:]
    return {name.lower(): value for name, value in (line.split(": ", 1) for line in lines)}


def check_refusal(answer, status):
    """One answer, whole, a problem that says what is wrong and nothing of the inside."""
    assert status_of(answer) == status, answer
    assert len(re.findall(rb"HTTP/1\.1 \d", answer)) == 1
    headers, problem = headers_of(answer), problem_of(answer)
    assert headers["content-type"] == "application/problem+json" and headers["cache-control"] == "no-store"
    assert headers["connection"] == "close" and headers["date"].endswith(" GMT")
    assert len(answer) == answer.index(b"\r\n\r\n") + 4 + int(headers["content-length"])
    assert problem["type"].startswith("urn:stratus:problem:") and problem["title"] and problem["status"] == status and problem["detail"]
    assert problem.get("request_id") == headers.get("x-request-id")
    assert not INSIDES.search(answer), answer
    return problem


# --- what the library that speaks HTTP does not understand ----------------------------------------------------------------------------

CHUNKED = POST + b"Transfer-Encoding: chunked\r\n\r\n"
# (what is sent, status, type, a word of the detail, whether it had an address, which the log names)
UNREADABLE = {
    # No request begins like these: some of them would be waited for until the time for a request is over.
    "one word": (b"hello\r\n\r\n", 400, "bad-request", "method", False),
    "one word, unfinished": (b"hello\r", 400, "bad-request", "method", False),
    "a method alone": (b"GET\r\n\r\n", 400, "bad-request", "method", False),
    "a blank before it": (b" GET /sunny HTTP/1.1\r\n" + HOST + b"\r\n", 400, "bad-request", "method", False),
    "zeros": (bytes(3), 400, "bad-request", "method", False),
    "zeros behind empty lines": (b"\r\n\n\0\1\2\r\n\r\n", 400, "bad-request", "method", False),
    "a method that is no token": (b"G(T /sunny HTTP/1.1\r\n" + HOST + b"\r\n", 400, "bad-request", "method", False),
    "a zero in the address": (b"GET /healthz\0sunny HTTP/1.1\r\n" + HOST + b"\r\n", 400, "bad-request", "control", False),
    "TLS": (bytes.fromhex("16030100c8010000c40303"), 400, "bad-request", "TLS", False),
    "TLS with ends of lines": (bytes.fromhex("16030100c8010000c40303") + bytes(200) + b"\r\n\r\n", 400, "bad-request", "TLS", False),
    "no version": (b"GET /sunny\r\n\r\n", 400, "bad-request", "request line", False),
    "version 9": (b"GET /sunny HTTP/9.9\r\n" + HOST + b"\r\n", 505, "http-version-not-supported", "HTTP/1.1", False),
    "version 2": (b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", 505, "http-version-not-supported", "HTTP/1.1", False),
    "no colon": (b"GET /sunny HTTP/1.1\r\n" + HOST + b"nonsense\r\n\r\n", 400, "bad-request", "header", True),
    "length is a word": (POST + b"Content-Length: two\r\n\r\n{}", 400, "bad-request", "Content-Length", True),
    "length below 0": (POST + b"Content-Length: -2\r\n\r\n{}", 400, "bad-request", "Content-Length", True),
    "length beyond numbers": (POST + b"Content-Length: " + b"9" * 40 + b"\r\n\r\n{}", 413, "body-too-large", "length of the body", True),
    "chunk is a word": (CHUNKED + b"zz\r\n{}\r\n0\r\n\r\n", 400, "bad-request", "chunks", True),
    "chunk below 0": (CHUNKED + b"-1\r\n{}\r\n0\r\n\r\n", 400, "bad-request", "chunks", True),
    "chunk beyond numbers": (CHUNKED + b"f" * 40 + b"\r\n{}", 413, "body-too-large", "length of a chunk", True),
    "chunk without its end": (CHUNKED + b"1\r\n{}{}{}\r\n0\r\n\r\n", 400, "bad-request", "chunks", True),
    "chunk with a long line": (CHUNKED + b"1;" + b"a" * 500000 + b"\r\n{\r\n0\r\n\r\n", 400, "bad-request", "chunks", True),
    "many headers": (b"GET /sunny HTTP/1.1\r\n" + HOST + b"X-A: a\r\n" * 50000 + b"\r\n", 431, "headers-too-large", "--header-max-kb", True),
    "a long header": (b"GET /sunny HTTP/1.1\r\n" + HOST + b"X-A: " + b"a" * 500000 + b"\r\n\r\n", 431, "headers-too-large", "--header-max-kb", True),
    "a long address": (b"GET /" + b"a" * 500000 + b" HTTP/1.1\r\n" + HOST + b"\r\n", 414, "uri-too-long", "--header-max-kb", False),
    "many cookies": (b"GET /sunny HTTP/1.1\r\n" + HOST + b"Cookie: " + b"a;" * 8000 + b"\r\n\r\n", 431, "headers-too-large", "--header-max-kb", True),
    # These are understood, and meant by nobody who keeps to RFC 9112.
    "no host": (b"GET /sunny HTTP/1.1\r\n\r\n", 400, "bad-request", "Host", True),
    "two hosts": (b"GET /sunny HTTP/1.1\r\n" + HOST + b"host: y\r\n\r\n", 400, "bad-request", "Host", True),
    "a bare end of line": (b"GET /sunny HTTP/1.1\r\n" + HOST + b"X: a\rY: b\r\n\r\n", 400, "bad-request", "end of a line", True),
    "chunks in 1.0": (CHUNKED.replace(b"/1.1", b"/1.0") + b"0\r\n\r\n", 400, "bad-request", "HTTP/1.0", True),
}


@pytest.mark.parametrize("sent, status, kind, word, has_address", UNREADABLE.values(), ids=UNREADABLE.keys())
def test_what_cannot_be_read(daemon, sent, status, kind, word, has_address):
    problem = check_refusal(ask(daemon, sent), status)
    assert problem["type"] == f"urn:stratus:problem:{kind}" and word in problem["detail"]
    line = f" id={problem['request_id']} "
    assert wait_for(lambda: any(line in found for found in daemon.lines))
    (line,) = [found for found in daemon.lines if line in found]
    assert f" status={status} " in line and f" problem={kind}" in line
    assert (" method=- path=- " in line) == (not has_address)
    assert daemon.get("/healthz").status == 200


def test_it_is_counted(narrow):
    """Nobody else's headers are too large for this daemon."""
    for sent, status, kind in (("many cookies", 431, "headers-too-large"), ("version 9", 505, "http-version-not-supported"), ("zeros", 400, "bad-request")):
        names = f'stratus_requests_total{{route="other",status="{status}"}}', f'stratus_problems_total{{type="{kind}"}}'
        before = [narrow.settled(name) for name in names]
        ask(narrow, UNREADABLE[sent][0])
        assert wait_for(lambda: [narrow.metric(name) for name in names] == [count + 1 for count in before])


def answer_on(client):
    """The head of an answer and its body, of which it says the length."""
    answer = b""
    while b"\r\n\r\n" not in answer:
        answer += client.recv(1)
    size = int(headers_of(answer)["content-length"])
    while size > 0:
        answer += (piece := client.recv(size))
        size -= len(piece)
        assert piece
    return answer


@pytest.mark.parametrize("name", ["one word", "zeros", "a blank before it", "TLS"])
def test_it_is_answered_on_a_kept_connection(daemon, name):
    """Behind questions with a body and without one, and after empty lines."""
    questions = b"GET /healthz HTTP/1.1\r\n" + HOST + b"\r\n", b"\r\n" + POST + b"Content-Length: 1\r\n\r\n{"
    with connect(daemon) as client:
        for question, status in zip(questions, (200, 400)):
            client.sendall(question)
            assert status_of(answer_on(client)) == status
        sent, status, kind, word, _ = UNREADABLE[name]
        client.sendall(sent)
        assert word in check_refusal(read_all(client), status)["detail"]


def test_a_first_line_in_pieces(daemon):
    """Byte by byte it is the line that it is, and one that is none is refused at its first wrong byte."""
    with connect(daemon) as client:
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for byte in b"\r\nGET /healthz HTTP/1.1\r\n" + HOST + b"\r\n":
            client.sendall(bytes([byte]))
            daemon.await_reading(client)
        assert status_of(answer_on(client)) == 200
    with connect(daemon) as client:
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for byte in b"GET":
            client.sendall(bytes([byte]))
            daemon.await_reading(client)
        client.sendall(b"\t")
        check_refusal(read_all(client), 400)


TRUNCATED = {
    "in the request line": b"GET /heal",
    "in the headers": POST,
    "in the body": POST + b"Content-Length: 100\r\n\r\n{",
    "before the body": POST + b"Content-Length: 100\r\n\r\n",
    "in a chunk": POST + b"Transfer-Encoding: chunked\r\n\r\n5\r\n{",
    "before the last chunk": POST + b"Transfer-Encoding: chunked\r\n\r\n2\r\n{}\r\n",
    "in an upload": b"PUT /v1/assets/part HTTP/1.1\r\n" + HOST + b"Content-Length: 100\r\n\r\n\x89PNG",
}


@pytest.mark.parametrize("sent", TRUNCATED.values(), ids=TRUNCATED.keys())
def test_who_ends_in_the_middle_hears_so(daemon, sent):
    """At once, and not when the time for a request is over; whether the end comes with the last bytes or behind them."""
    for waits in (False, True) * 3:
        with connect(daemon) as client:
            client.sendall(sent)
            if waits:
                daemon.await_reading(client)
            client.shutdown(socket.SHUT_WR)
            answer = read_all(client)
        problem = check_refusal(answer, 400)
        assert problem["type"] == "urn:stratus:problem:bad-request" and "ended" in problem["detail"]
        line = f" id={problem['request_id']} "
        assert wait_for(lambda: any(line in found and " status=400 " in found for found in daemon.lines))
    assert daemon.get("/v1/assets/part").status == 404


def test_half_closed_and_whole(daemon):
    """Who asks all of it and closes the sending half then is answered where nothing need be waited for."""
    for _ in range(5):
        with connect(daemon) as client:
            client.sendall(b"GET /healthz HTTP/1.1\r\n" + HOST + b"\r\n")
            client.shutdown(socket.SHUT_WR)
            assert status_of(read_all(client)) == 200


def test_it_is_answered_behind_others(daemon):
    """What came before on the same connection has its answer first."""
    answer = ask(daemon, 2 * (b"GET /healthz HTTP/1.1\r\n" + HOST + b"\r\n") + b"GET /healthz HTTP/1.1\r\nnonsense\r\n\r\n")
    assert re.findall(rb"HTTP/1\.1 (\d+) ", answer) == [b"200", b"200", b"400"]
    assert answer.count(b"application/problem+json") == 1


def test_over_tls(tmp_path_factory):
    """The same in a TLS session; a client that is slow there hears no words in the clear."""
    folder = tmp_path_factory.mktemp("private")
    cert, key = make_certificate(folder, "own")
    daemon = Daemon(folder, "--tls-cert", cert, "--tls-key", key, "--read-timeout-s=1")
    daemon.trust = ssl.create_default_context(cafile=cert)
    daemon.trust.verify_flags &= ~getattr(ssl, "VERIFY_X509_STRICT", 0)

    def ask_in_private(data):
        with daemon.trust.wrap_socket(connect(daemon), server_hostname="127.0.0.1", suppress_ragged_eofs=True) as client:
            client.sendall(data)
            return read_all(client)

    try:
        for name in ("no colon", "length is a word", "chunk is a word", "one word", "zeros", "no version"):
            sent, status, kind, _, _ = UNREADABLE[name]
            assert check_refusal(ask_in_private(sent), status)["type"].endswith(kind)
        large = POST + b"Content-Length: %d\r\n\r\n" % LARGE + bytes(LARGE)
        assert check_refusal(ask_in_private(large), 413)["type"].endswith("body-too-large")
        with daemon.trust.wrap_socket(connect(daemon), server_hostname="127.0.0.1", suppress_ragged_eofs=True) as client:
            client.sendall(b"GET /he")
            assert client.recv(100) == b""  # and no error of TLS
    finally:
        status = daemon.stop()
        daemon.assert_clean()
    assert status == 0


# --- clients that write first and read then -------------------------------------------------------------------------------------------


def tell_all(daemon, head, body):
    """Sends all of it whatever comes back, as many clients do: an error while writing is one of the test. Returns the answer."""
    with connect(daemon) as client:
        client.sendall(head)
        for i in range(0, len(body), 1 << 20):
            client.sendall(body[i : i + (1 << 20)])
        return read_all(client)


def by_length(size):
    return b"Content-Length: %d\r\n\r\n" % size


def in_chunks(body):
    return b"%x\r\n" % len(body) + body + b"\r\n0\r\n\r\n"


UPLOAD = b"PUT /v1/assets/%s HTTP/1.1\r\n" + HOST
CODED = b"Transfer-Encoding: chunked\r\n\r\n"
JSON = b"Content-Type: application/json\r\n"
RENDER = b"POST /v1/render HTTP/1.1\r\n" + HOST
# (head, whether chunked, status); the key is shown where "KEY" is
UNWANTED = {
    "no key": (RENDER + JSON, False, 401),
    "nowhere": (b"POST /nowhere HTTP/1.1\r\n" + HOST, False, 404),
    "wrong method": (b"PUT /v1/render HTTP/1.1\r\n" + HOST + b"KEY", False, 405),
    "wrong type": (RENDER + b"KEY" + b"Content-Type: text/plain\r\n", False, 415),
    "coded": (RENDER + b"KEY" + JSON + b"Content-Encoding: gzip\r\n", False, 415),
    "too long": (RENDER + b"KEY" + JSON, False, 413),
    "too long in chunks": (RENDER + b"KEY" + JSON, True, 413),
    "with a question": (b"GET /healthz HTTP/1.1\r\n" + HOST, False, 413),
    "upload too long": (UPLOAD % b"a" + b"KEY", False, 413),
    "upload too long in chunks": (UPLOAD % b"a" + b"KEY", True, 413),
    "bad name": (UPLOAD % b".a" + b"KEY", False, 400),
    "of another state": (UPLOAD % b"a" + b"KEY" + b"If-Match: *\r\n", False, 412),
    "bad deadline": (UPLOAD % b"a" + b"KEY" + b"X-Timeout-Ms: soon\r\n", False, 400),
}


@pytest.mark.parametrize("head, chunked, status", UNWANTED.values(), ids=UNWANTED.keys())
def test_who_writes_first_hears_why(narrow, head, chunked, status):
    shown = f"Authorization: {narrow.shown['Authorization']}\r\n".encode()
    head = head.replace(b"KEY", shown) + (CODED if chunked else by_length(LARGE))
    body = PNG[:8] + bytes(LARGE - 8)  # else an upload is refused for its first bytes
    check_refusal(tell_all(narrow, head, in_chunks(body) if chunked else body), status)


def test_full_storage_is_heard_of(narrow):
    """The body fits the limit of one, and there is no room for it: the client writes it to its end."""
    assert narrow.request("PUT", "/v1/assets/first", PNG, narrow.shown).status in (201, 204)
    shown = f"Authorization: {narrow.shown['Authorization']}\r\n".encode()
    body = bytes(1 << 20)
    check_refusal(tell_all(narrow, UPLOAD % b"second" + shown + by_length(len(body)), body), 507)
    with connect(narrow) as client:
        client.sendall(UPLOAD % b"second" + shown + b"Connection: close\r\n" + CODED + in_chunks(PNG + bytes((1 << 20) - len(PNG))))
        assert status_of(read_all(client)) == 507
    assert narrow.request("DELETE", "/v1/assets/first", headers=narrow.shown).status == 204


def test_nobody_lingers_for_ever(narrow):
    """Clients that neither read nor write nor close lose their place, and those that close at once."""
    before = narrow.metric("stratus_process_open_fds")
    clients = [connect(narrow) for _ in range(4)]
    for client in clients:
        client.sendall(b"POST /nowhere HTTP/1.1\r\n" + HOST + by_length(LARGE) + b"a")
    for client in clients[:2]:
        client.close()
    assert wait_for(lambda: narrow.metric("stratus_process_open_fds") <= before)
    for client in clients[2:]:
        assert status_of(read_all(client)) == 404
        client.close()


def test_refusals_leave_the_connection(daemon):
    """What has no body to be read is refused and another question can follow; so it is behind a body that was read."""
    connection = daemon.connect()
    connection.connect()
    socket = connection.sock
    questions = [
        ("GET", "/nowhere", None, 404), ("DELETE", "/v1/render", None, 405), ("HEAD", "/nowhere", None, 404), ("OPTIONS", "/v1/sun", None, 405),
        ("GET", "/v1/sun", None, 422), ("DELETE", "/v1/assets/nothing", None, 404), ("POST", "/v1/render", "{", 400), ("GET", "/healthz", None, 200),
    ]  # fmt: skip
    for method, path, body, status in questions:
        connection.request(method, path, body, {"Content-Type": "application/json"} if body else {})
        answer = connection.getresponse()
        answer.read()
        assert answer.status == status and connection.sock is socket, (method, path)
    connection.close()


BROKEN = {
    "png cut": (PICTURES / "rgb-8.png", slice(0, -20), None),
    "png without its end": (PICTURES / "rgba-16.png", slice(0, 300), None),
    "png of another checksum": (PICTURES / "grey-8.png", slice(None), (-20, 0x41)),
    "png of another header": (PICTURES / "grey-8.png", slice(None), (31, 0x41)),
    "exr cut": (PICTURES / "zip.exr", slice(0, -100), None),
    "exr of another order": (PICTURES / "b44.exr", slice(None), (b"lineOrder\0lineOrder\0\1\0\0\0", 9)),
}


@pytest.mark.parametrize("path, part, change", BROKEN.values(), ids=BROKEN.keys())
def test_what_is_wrong_with_a_picture(daemon, path, part, change):
    """In words about the picture, not about the libraries that read it."""
    data = bytearray(path.read_bytes()[part])
    if change:
        where, value = change
        at = where if isinstance(where, int) else data.index(where) + len(where)
        data[at] = value if data[at] != value else value ^ 1
    answer = daemon.request("PUT", "/v1/assets/broken", bytes(data))
    detail = answer.json["detail"]
    assert answer.status == 422 and answer.json["type"] == "urn:stratus:problem:invalid-asset", detail
    assert detail.startswith("The picture ") and detail.endswith(".") and not detail.endswith("..") and len(detail) > 20
    assert not re.search(r"picture\.exr|exception|library|read error|[\n\"]picture", detail, re.I), detail


# --- how long it takes ----------------------------------------------------------------------------------------------------------------


def of_json(body):
    return POST + b"Connection: close\r\n" + by_length(len(body)) + body


MANY = b"{" + b",".join(b'"k%d":1' % i for i in range(60000)) + b"}"
BAD = {name: (sent, status) for name, (sent, status, *_) in UNREADABLE.items()}
BAD.update(
    {
        "nothing": (of_json(b""), 400),
        "brackets": (of_json(b"[" * 1000000), 400),
        "braces": (of_json(b'{"a":' * 200000), 400),
        "depth of a member": (of_json(b'{"sun":' + b"[" * 2000 + b"]" * 2000 + b"}"), 422),
        "a member of a million letters": (of_json(b'{"' + b"a" * 1000000 + b'":1}'), 422),
        "a string of a million letters": (of_json(b'{"clouds":{"type":"' + b"a" * 1000000 + b'"}}'), 422),
        "a number of a million digits": (of_json(b'{"clouds":{"seed":' + b"9" * 1000000 + b"}}"), 422),
        "sixty thousand members": (of_json(MANY), 422),
        "one member sixty thousand times": (of_json(b"{" + b",".join([b'"sun":{}'] * 60000) + b"}"), 422),
        "a list of half a million": (of_json(b'{"camera":{"position_m":[' + b",".join([b"0"] * 500000) + b"]}}"), 422),
        "no number": (of_json(b'{"sun":{"elevation_deg":NaN}}'), 400),
        "too large a number": (of_json(b'{"sun":{"elevation_deg":1e999}}'), 422),
        "zero in a text": (of_json(b'{"clouds":{"type":"a\\u0000"}}'), 400),
        "a zero": (of_json(b'{"sun":{}\0}'), 400),
        "no UTF-8": (of_json(b'{"clouds":{"type":"\xff"}}'), 400),
        "half a character": (of_json(b'{"clouds":{"type":"\\ud800"}}'), 400),
        "bad query": (b"GET /v1/render?sun.elevation_deg=%zz HTTP/1.1\r\n" + HOST + b"Connection: close\r\n\r\n", 400),
        "zero in a query": (b"GET /v1/render?sun.elevation_deg=1%00 HTTP/1.1\r\n" + HOST + b"Connection: close\r\n\r\n", 400),
        "long query": (b"GET /v1/render?" + b"&".join(b"a%d=1" % i for i in range(3000)) + b" HTTP/1.1\r\n" + HOST + b"Connection: close\r\n\r\n", 400),
        "slab of wishes": (b"GET /v1/slab?view_zenith_deg=" + b"1," * 9000 + b" HTTP/1.1\r\n" + HOST + b"Connection: close\r\n\r\n", 422),
        "not a picture": (UPLOAD % b"bad" + b"Connection: close\r\n" + by_length(1 << 20) + bytes(1 << 20), 415),
    }
)


def processor_seconds(daemon):
    """Of all its threads, by the clock that Linux keeps of each process."""
    return time.clock_gettime((~daemon.process.pid << 3) | 2)


@pytest.mark.parametrize("sent, status", BAD.values(), ids=BAD.keys())
def test_bad_input_costs_next_to_nothing(daemon, sent, status):
    """Answered within 50 ms of the last byte that it takes to know. Counted is the processor's time, which a busy machine makes no longer, and of some
    tries the best, since other threads of the daemon may be at work."""
    best = 1e9
    for _ in range(20):
        began = processor_seconds(daemon)
        check_refusal(ask(daemon, sent), status)
        best = min(best, processor_seconds(daemon) - began)
        if best < 0.01:
            break
    assert best < (0.5 if SANITIZED else 0.05)
