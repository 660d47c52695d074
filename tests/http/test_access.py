"""Who may ask, for how much, from where: keys, their limits, TLS, pages of other origins, and what a daemon refuses to be started as."""
import http.client
import json
import os
import re
import shutil
import signal
import socket
import ssl
import subprocess
import time

import pytest

from conftest import BUILD, KERNEL, Daemon, wait_for
from test_config import check
from test_contract import PNG
from test_service import assert_problem

SMALL = {"output": {"width": 32, "height": 24}}
SUN = "/v1/sun?time=2024-06-21T12:00:00Z&latitude_deg=48&longitude_deg=11"


def new_key(name):
    """(the key, the line for the file)"""
    made = subprocess.run([BUILD / "stratusd", "--new-key", name], capture_output=True, text=True, timeout=180)
    assert made.returncode == 0
    key, line = made.stdout.splitlines()
    assert key not in line and line.startswith(f"{name} sha256:")
    return key, line


def bearer(key):
    return {"Authorization": f"Bearer {key}"}


class Keys:
    """The file, and the keys that were ever in it."""

    def __init__(self, path):
        self.path = path
        self.keys, self.lines = {}, {}
        self.path.touch(mode=0o600)

    def add(self, name, limits=""):
        self.keys[name], line = new_key(name)
        self.lines[name] = f"{line} {limits}"
        self.write()
        return self.keys[name]

    def remove(self, name):
        del self.lines[name]
        self.write()

    def write(self):
        self.path.write_text("\n".join(self.lines.values()) + "\n")


NAMED, OTHER = "https://sky.example", "http://localhost:3000"
LIMITS = {"alice": "", "bob": "", "slow": "requests_per_minute=3", "steady": "requests_per_minute=60", "layers": "megapixels_per_minute=1",
          "tiny": "megapixels_per_minute=0.0001"}  # 100 pixels: a picture of 32 x 24 is owed for minutes


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    keys = Keys(tmp_path_factory.mktemp("keys") / "keys")
    for name, limits in LIMITS.items():
        keys.add(name, limits)
    return keys


@pytest.fixture(scope="module")
def start_module_daemon(tmp_path_factory):
    """As start_daemon, for all tests of this file together."""
    started = []

    def start(*flags):
        started.append(Daemon(tmp_path_factory.mktemp("daemon"), *flags))
        return started[-1]

    yield start
    for daemon in started:
        daemon.stop()
        daemon.assert_clean()


@pytest.fixture(scope="module")
def guarded(start_module_daemon, keys):
    """Reached by others than this machine, with keys, and open to pages of two origins."""
    return start_module_daemon(
        "--keys", str(keys.path), "--listen=0.0.0.0:0", "--log-format=json", "--log-level=debug", "--cors-origins", f"{NAMED}, {OTHER}"
    )


def metric_of(daemon, keys, sample):
    for line in daemon.get("/metrics", **bearer(keys.keys["alice"])).body.decode().splitlines():
        if line.startswith(sample + " "):
            return float(line.rsplit(" ", 1)[1])
    return 0.0


def reload(daemon):
    """Tells the daemon to, and waits until it has."""
    seen = daemon.log.read_text().count("SIGHUP: ")
    daemon.process.send_signal(signal.SIGHUP)

    def done():
        parts = daemon.log.read_text().split("SIGHUP: ")
        return len(parts) > seen + 1 and re.search(r"keys: [0-9]+ from|of before stay in force|tls: ", parts[-1])

    assert wait_for(done)


# --- keys --------------------------------------------------------------------------------------------------------------------------


def test_key_is_needed(guarded, keys):
    daemon, alice = guarded, keys.keys["alice"]
    calls = [("GET", SUN), ("HEAD", SUN), ("GET", "/v1/render?output.width=16&output.height=16"), ("POST", "/v1/render"), ("GET", "/v1/presets")]
    calls += [("POST", "/v1/compare"), ("GET", "/v1/assets"), ("PUT", "/v1/assets/a"), ("DELETE", "/v1/assets/a"), ("GET", "/metrics"), ("PATCH", SUN)]
    for method, target in calls:
        body = PNG if method == "PUT" else "{}" if method == "POST" else None
        kind = {"Content-Type": "application/json"}
        for shown in ({}, {"Authorization": "Basic YWxpY2U6cHc="}, {"Authorization": "Bearer"}, {"X-Api-Key": alice}):
            answer = daemon.request(method, target, body, {**kind, **shown})
            if method != "HEAD":
                assert_problem(answer, 401, "unauthorized")
            assert answer.status == 401 and answer.headers["WWW-Authenticate"] == 'Bearer realm="stratus"', (method, target)
        for wrong in (new_key("alice")[0], alice[:-1], alice + "A", alice.upper(), "x", alice + ", " + alice, '"' + alice + '"', ""):
            answer = daemon.request(method, target, body, {**kind, **bearer(wrong)})
            assert answer.status == 401, (method, target, wrong)
            if wrong:
                assert answer.headers["WWW-Authenticate"] == 'Bearer realm="stratus", error="invalid_token"'
        assert daemon.request(method, target, body, {**kind, **bearer(alice)}).status not in (401, 403, 429), (method, target)
    assert daemon.get(SUN + "&key=" + alice).status == 401
    for scheme in ("bearer", "BEARER", "Bearer  "):
        assert daemon.get(SUN, Authorization=f"{scheme} {alice}").status == 200
    assert daemon.get("/v1/assets/a").status == 401


def test_caches_give_nothing_to_strangers(guarded, keys, daemon):
    """What may be public without keys is private with them."""
    target, shown = "/v1/render?output.width=16&output.height=16", bearer(keys.keys["alice"])
    for address in (target, "/v1/presets", "/v1/optics"):
        assert daemon.get(address).headers.get_all("Cache-Control") == ["public, max-age=3600"]
        answer = guarded.get(address, **shown)
        assert answer.headers.get_all("Cache-Control") == ["private, max-age=3600"], address
        known = guarded.get(address, If_None_Match=answer.headers["ETag"], **shown)
        assert known.status == 304 and known.headers.get_all("Cache-Control") == ["private, max-age=3600"]
    assert guarded.get("/openapi.yaml", **shown).headers["Cache-Control"] == "public, max-age=3600"


def test_what_needs_none(guarded):
    for target in ("/", "/web/app.js", "/openapi.yaml", "/healthz", "/readyz"):
        assert guarded.get(target).status == 200, target
    assert_problem(guarded.get("/nowhere"), 404, "not-found")


def test_refused_before_the_body(guarded):
    """A stranger's upload costs nothing: the answer comes before a byte of it is sent."""
    with socket.create_connection(("127.0.0.1", guarded.port), timeout=180) as client:
        client.sendall(b"PUT /v1/assets/big HTTP/1.1\r\nHost: x\r\nContent-Length: 60000000\r\nExpect: 100-continue\r\n\r\n")
        assert client.recv(4096).startswith(b"HTTP/1.1 401 ")
    incoming = guarded.log.parent / "state" / "assets" / "incoming"
    assert not incoming.exists() or not any(incoming.iterdir())


def test_log_and_metrics_know_the_name(guarded, keys):
    alice, bob = keys.keys["alice"], keys.keys["bob"]

    def lines():
        found = [json.loads(line) for line in guarded.lines]
        return [r for r in found if r.get("event") == "request" and r["id"].startswith("named-")]

    before = metric_of(guarded, keys, 'stratus_key_requests_total{key="bob"}')
    assert guarded.render(SMALL, X_Request_Id="named-0", **bearer(alice)).status == 200
    assert guarded.get(SUN, X_Request_Id="named-1", **bearer(bob)).status == 200
    assert guarded.get(SUN, X_Request_Id="named-2", **bearer(new_key("carol")[0])).status == 401
    assert wait_for(lambda: len(lines()) == 3)
    # An answer is logged after it is sent, each by the thread of its connection: in any order.
    assert {line["id"]: line.get("key") for line in lines()} == {"named-0": "alice", "named-1": "bob", "named-2": None}
    assert metric_of(guarded, keys, 'stratus_key_requests_total{key="bob"}') == before + 1
    assert metric_of(guarded, keys, 'stratus_key_pixels_total{key="alice"}') >= 32 * 24
    assert metric_of(guarded, keys, 'stratus_key_pixels_total{key="bob"}') == 0
    assert metric_of(guarded, keys, 'stratus_key_requests_total{key="anonymous"}') >= 1
    assert metric_of(guarded, keys, 'stratus_requests_total{route="/v1/sun",status="401"}') >= 1
    text = guarded.log.read_text()
    for secret in (alice, bob, alice[4:20], keys.lines["alice"].split()[1].split(":")[1]):
        assert secret not in text


def test_reload(guarded, keys):
    alice, bob = keys.keys["alice"], keys.keys["bob"]
    connection = guarded.connect()

    def status(key):
        connection.request("GET", SUN, headers=bearer(key))
        answer = connection.getresponse()
        answer.read()
        return answer.status

    before = dict(keys.lines)
    assert status(alice) == status(bob) == 200
    carol = keys.add("carol")
    assert status(carol) == 401  # not before it is told
    keys.remove("alice")
    reload(guarded)
    assert (status(alice), status(bob), status(carol)) == (401, 200, 200)
    # Whatever is wrong with the file leaves the keys as they are, and says so.
    good = keys.path.read_text()
    for bad in ("bob\n", good + "dora sha256:12\n", good.replace("bob", "../bob")):
        keys.path.write_text(bad)
        reload(guarded)
        assert (status(alice), status(bob), status(carol)) == (401, 200, 200)
    keys.path.unlink()
    reload(guarded)
    assert (status(bob), status(carol)) == (200, 200)
    assert guarded.log.read_text().count("the keys of before stay in force") == 4
    keys.path.touch(mode=0o600)
    keys.path.write_text("# nobody\n")
    reload(guarded)
    assert (status(bob), status(carol)) == (401, 401)
    connection.close()
    keys.lines = before
    keys.write()
    reload(guarded)
    assert guarded.get(SUN, **bearer(alice)).status == 200


def test_reload_without_keys_is_nothing(daemon):
    daemon.process.send_signal(signal.SIGHUP)
    assert wait_for(lambda: "SIGHUP: " in daemon.log.read_text())
    assert daemon.get(SUN).status == 200


# --- how much ----------------------------------------------------------------------------------------------------------------------


def test_requests_a_minute(guarded, keys):
    slow, bob = keys.keys["slow"], keys.keys["bob"]
    begin = time.monotonic()

    def ask_until_refused():
        """How many were served before."""
        for served in range(1000):
            answer = guarded.get(SUN, **bearer(slow))
            if answer.status != 200:
                return served, answer

    def regained():
        """Of a request each third of a minute, by now."""
        return int((time.monotonic() - begin) / 20)

    served, refused = ask_until_refused()
    assert 3 <= served <= 3 + regained()
    assert_problem(refused, 429, "allowance-used-up")
    assert 1 <= int(refused.headers["Retry-After"]) <= 20 == 60 / 3
    assert refused.json["retry_after_seconds"] == int(refused.headers["Retry-After"])
    assert "slow" in refused.json["detail"]
    assert [guarded.get(SUN, **bearer(bob)).status for _ in range(5)] == [200] * 5
    assert guarded.get("/healthz", **bearer(slow)).status == 200
    assert metric_of(guarded, keys, 'stratus_key_refused_total{key="slow",limit="requests"}') == 1
    # Reading the file again gives nothing back.
    reload(guarded)
    more, refused = ask_until_refused()
    assert refused.status == 429 and served + more <= 3 + regained()


def test_after_the_time_it_says_it_goes_on(guarded, keys):
    connection = guarded.connect()

    def ask():
        connection.request("GET", SUN, headers=bearer(keys.keys["steady"]))
        answer = connection.getresponse()
        answer.read()
        return answer

    for _ in range(1000):
        answer = ask()
        if answer.status == 429:
            break
    assert answer.status == 429
    assert int(answer.headers["Retry-After"]) == 1
    time.sleep(1)
    assert ask().status == 200
    connection.close()


def test_megapixels_a_minute(guarded, keys):
    tiny, begin = keys.keys["tiny"], time.monotonic()
    first = guarded.render({**SMALL, "sun": {"elevation_deg": 61.7}}, **bearer(tiny))  # nobody has had it rendered before
    assert first.status == 200
    refused = guarded.render({**SMALL, "sun": {"elevation_deg": 20}}, **bearer(tiny))
    assert_problem(refused, 429, "allowance-used-up")
    # 768 pixels at 100 a minute, until as many may be taken as fit into a minute; less what has passed since.
    assert 7.68 * 60 - (time.monotonic() - begin) - 1 <= int(refused.headers["Retry-After"]) <= 7.68 * 60 + 1
    # What is not rendered costs none: headers, pictures that the client has, other calls.
    location = first.headers["Content-Location"]
    assert guarded.head(location, **bearer(tiny)).status == 200
    assert guarded.get(location, If_None_Match=first.headers["ETag"], **bearer(tiny)).status == 304
    assert guarded.get(SUN, **bearer(tiny)).status == 200
    assert wait_for(lambda: metric_of(guarded, keys, 'stratus_key_pixels_total{key="tiny"}') == 768)
    assert metric_of(guarded, keys, 'stratus_key_refused_total{key="tiny",limit="megapixels"}') == 1
    compare = {"scene": SMALL, "variants": [{}, {"model": {"shading": "paper"}}]}
    answer = guarded.request("POST", "/v1/compare", json.dumps(compare), {"Content-Type": "application/json", **bearer(tiny)})
    assert_problem(answer, 429, "allowance-used-up")


def test_layers_count_apart(guarded, keys):
    layers = {**SMALL, "output": {**SMALL["output"], "format": "exr", "layers": ["color", "sky", "ground"]}}
    assert guarded.render(layers, **bearer(keys.keys["layers"])).status == 200
    assert wait_for(lambda: metric_of(guarded, keys, 'stratus_key_pixels_total{key="layers"}') == 3 * 768)


# --- what a daemon refuses to be started as ------------------------------------------------------------------------------------------


def run(*flags):
    return subprocess.run([BUILD / "stratusd", "--listen=127.0.0.1:0", *flags], capture_output=True, text=True, timeout=300)


@pytest.mark.parametrize("listen", ["0.0.0.0:0", "[::]:0", "192.0.2.1:80"])
def test_strangers_are_let_in_on_purpose_alone(listen):
    refused = run("--listen", listen)
    assert refused.returncode == 2 and "--allow-anyone" in refused.stderr and refused.stdout == ""


def test_what_is_said_aloud(keys, guarded, tmp_path):
    common = ["--state-dir", str(tmp_path), "--kernel", str(KERNEL), "--listen=0.0.0.0:0"]
    refused, warned = check(*common), check(*common, "--allow-anyone")
    assert refused.returncode == 2 and "--allow-anyone" in refused.stderr
    assert warned.returncode == 0 and re.search("warning --listen .*whoever reaches it", warned.stderr)
    assert "keys and pictures travel in the clear" in guarded.log.read_text()
    local = check("--state-dir", str(tmp_path), "--kernel", str(KERNEL), "--listen=localhost:0", "--keys", str(keys.path))
    assert local.returncode == 0 and "warning" not in local.stderr


def test_faults_of_settings(tmp_path):
    """Each stops a start, and the check names all of them in one go."""
    (tmp_path / "keys").touch(mode=0o600)
    (tmp_path / "keys").write_text("alice\n")
    (tmp_path / "empty.pem").write_text("")
    empty = str(tmp_path / "empty.pem")
    faults = [
        (["--keys", str(tmp_path / "keys")], "keys:1: "),
        (["--keys", "/nowhere/keys"], "/nowhere/keys: No such file"),
        (["--tls-cert", empty], "--tls-cert and --tls-key go together"),
        (["--tls-cert", "/nowhere.pem", "--tls-key", "/nowhere.pem"], "--tls-cert /nowhere.pem: No such file"),
        (["--tls-cert", empty, "--tls-key", empty], "empty.pem"),
    ] + [(["--cors-origins", origins], "is no origin") for origins in ("*", "null", "example.org", "https://", "https://a.example/", "https://A.example,x")]
    for flags, words in faults:
        started = run("--state-dir", str(tmp_path / "state"), *flags)
        assert started.returncode != 0 and words in started.stderr and started.stdout == "", flags
    every = [flag for flags, _ in (faults[0], faults[3], faults[5]) for flag in flags]
    checked = check("--state-dir", str(tmp_path / "state"), "--kernel", str(KERNEL), "--listen=127.0.0.1:0", *every)
    assert checked.returncode == 2
    for _, words in (faults[0], faults[3], faults[5]):
        assert words in checked.stderr


def test_names_of_new_keys():
    for name in ("", "a b", "a/b", "x" * 33, "anonymous"):
        made = subprocess.run([BUILD / "stratusd", "--new-key", name], capture_output=True, text=True, timeout=180)
        assert made.returncode == 2 and made.stdout == ""
    assert subprocess.run([BUILD / "stratusd", "--new-key"], capture_output=True, timeout=180).returncode == 2


# --- TLS ---------------------------------------------------------------------------------------------------------------------------


def make_certificate(folder, name, *more):
    """(certificate, key) of the name, for 127.0.0.1."""
    cert, key = folder / f"{name}.pem", folder / f"{name}.key"
    command = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2", "-subj", f"/CN={name}"]
    command += ["-addext", "subjectAltName=IP:127.0.0.1", "-keyout", key, "-out", cert, *more]
    subprocess.run(command, check=True, capture_output=True, timeout=300)
    key.chmod(0o600)
    return str(cert), str(key)


@pytest.fixture(scope="module")
def certificate(tmp_path_factory):
    return make_certificate(tmp_path_factory.mktemp("tls"), "first")


@pytest.fixture(scope="module")
def secure(start_module_daemon, certificate, keys):
    """With keys, too, but for its metrics."""
    cert, key = certificate
    daemon = start_module_daemon("--tls-cert", cert, "--tls-key", key, "--keys", str(keys.path), "--open-metrics", "--asset-max-mb=1")
    daemon.trust = ssl.create_default_context(cafile=cert)
    daemon.ca, daemon.shown = cert, bearer(keys.keys["alice"])
    return daemon


def test_service_over_tls(secure):
    assert secure.get("/healthz").status == 200
    assert secure.get(SUN).status == 401
    rendered = secure.render({"output": {"width": 320, "height": 240}}, **secure.shown)
    assert rendered.status == 200 and rendered.body.startswith(b"\x89PNG")
    assert secure.get(rendered.headers["Content-Location"], **secure.shown).body == rendered.body
    assert secure.request("PUT", "/v1/assets/a", PNG, secure.shown).status == 201
    assert secure.get("/v1/assets/a", **secure.shown).body == PNG
    assert secure.metric("stratus_certificate_expiry_seconds") == pytest.approx(time.time() + 2 * 86400, abs=3600)
    assert secure.get("https://127.0.0.1/healthz").status == 200


def test_too_large_a_body_over_tls(secure):
    """Answered past the library that speaks HTTP, and in the same TLS connection."""
    connection = secure.connect()
    connection.putrequest("PUT", "/v1/assets/large")
    connection.putheader("Transfer-Encoding", "chunked")
    connection.putheader("Authorization", secure.shown["Authorization"])
    connection.endheaders()
    try:
        for begin in [b"\x89PNG\r\n\x1a\n"] + 39 * [b""]:
            connection.send(b"10000\r\n" + begin.ljust(65536, b"\0") + b"\r\n")
            time.sleep(0.005)
    except OSError:
        pass
    try:
        answer = connection.getresponse()
        assert answer.status == 413 and json.loads(answer.read())["status"] == 413
    except (ConnectionError, ssl.SSLError, http.client.HTTPException):
        pass  # the answer may be lost with what was still on its way
    connection.close()
    assert wait_for(lambda: secure.metric('stratus_requests_total{route="/v1/assets/NAME",status="413"}') == 1)


def test_versions_of_tls(secure):
    for version in (ssl.TLSVersion.TLSv1_2, ssl.TLSVersion.TLSv1_3):
        context = ssl.create_default_context(cafile=secure.ca)
        context.minimum_version = context.maximum_version = version
        with context.wrap_socket(socket.create_connection(("127.0.0.1", secure.port), timeout=180), server_hostname="127.0.0.1") as client:
            assert client.version() == {ssl.TLSVersion.TLSv1_2: "TLSv1.2", ssl.TLSVersion.TLSv1_3: "TLSv1.3"}[version]
            assert client.cipher()[2] >= 128 and "RSA" != client.cipher()[0].split("-")[0]
    old = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    old.check_hostname, old.verify_mode = False, ssl.CERT_NONE
    old.set_ciphers("ALL:@SECLEVEL=0")
    old.minimum_version, old.maximum_version = ssl.TLSVersion.TLSv1, ssl.TLSVersion.TLSv1_1
    with pytest.raises((ssl.SSLError, ConnectionError)):
        old.wrap_socket(socket.create_connection(("127.0.0.1", secure.port), timeout=180))
    assert secure.get("/healthz").status == 200


def test_what_is_no_tls(secure):
    for data in (b"GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n", bytes(range(256)), b"\x16\x03\x01\xff\xff" + bytes(100)):
        with socket.create_connection(("127.0.0.1", secure.port), timeout=180) as client:
            client.sendall(data)
            try:
                client.shutdown(socket.SHUT_WR)
                assert b"HTTP/1.1" not in client.recv(4096)
            except OSError:
                pass  # closed already
    assert secure.get("/healthz").status == 200


def test_client_that_leaves_is_noticed_over_tls(secure):
    """A render that nobody waits for any more is dropped, as without TLS."""
    scene = {"output": {"width": 320, "height": 240}, "model": {"name": "reference", "samples": 2048}}
    connection = secure.connect()
    connection.request("POST", "/v1/render", json.dumps(scene), {"Content-Type": "application/json", **secure.shown})
    assert wait_for(lambda: secure.metric("stratus_requests_in_flight") > 1)
    connection.sock.close()
    connection.close()
    assert wait_for(lambda: secure.metric('stratus_renders_ended_total{reason="abandoned"}') == 1)


def stratus(daemon, *arguments, **environment):
    clean = {name: value for name, value in os.environ.items() if not name.startswith("STRATUS_")}
    command = [BUILD / "stratus", "--server", f"https://127.0.0.1:{daemon.port}", *arguments]
    return subprocess.run(command, env={**clean, **environment}, capture_output=True, text=True, timeout=300)


def test_client_over_tls_with_a_key(secure, keys, tmp_path):
    key, ca = keys.keys["alice"], secure.ca
    untrusted = stratus(secure, "health")
    assert untrusted.returncode == 3 and "certificate" in untrusted.stderr
    assert stratus(secure, "--ca-cert", ca, "health").returncode == 0
    assert stratus(secure, "health", "--ready", "--ca-cert", ca).returncode == 0
    refused = stratus(secure, "presets", STRATUS_CA_CERT=ca)
    assert refused.returncode == 1 and "No key" in refused.stderr
    assert stratus(secure, "presets", STRATUS_CA_CERT=ca, STRATUS_API_KEY=new_key("x")[0]).returncode == 1
    assert stratus(secure, "presets", STRATUS_CA_CERT=ca, STRATUS_API_KEY=key).returncode == 0
    assert stratus(secure, "--key", key, "presets", "--ca-cert", ca).returncode == 0
    (tmp_path / "scene.json").write_text(json.dumps(SMALL))
    sky = tmp_path / "sky.png"
    done = stratus(secure, "render", "--key", key, "-o", str(sky), str(tmp_path / "scene.json"), STRATUS_CA_CERT=ca)
    assert done.returncode == 0, done.stderr
    assert sky.read_bytes().startswith(b"\x89PNG")


def certificate_shown(daemon):
    with ssl._create_unverified_context().wrap_socket(socket.create_connection(("127.0.0.1", daemon.port), timeout=180)) as client:
        return client.getpeercert(True)


def test_certificate_is_read_again(secure, certificate, tmp_path):
    """The last test of this daemon, which has another certificate then."""
    cert, key = certificate
    before = certificate_shown(secure)
    standing = secure.connect()
    standing.request("GET", "/healthz")
    assert standing.getresponse().read()
    other_cert, other_key = make_certificate(tmp_path, "other")
    # A certificate without its key is not taken.
    shutil.copy(other_cert, cert)
    reload(secure)  # the certificate comes behind the keys
    assert wait_for(lambda: "the certificate of before stay in force" in secure.log.read_text())
    assert certificate_shown(secure) == before
    shutil.copy(other_key, key)
    reload(secure)
    assert wait_for(lambda: certificate_shown(secure) == ssl.PEM_cert_to_DER_cert(open(other_cert).read()) != before)
    standing.request("GET", "/healthz")
    assert standing.getresponse().status == 200
    standing.close()
    assert secure.stop() == 0


# --- pages of other origins ----------------------------------------------------------------------------------------------------------

def cors_headers(answer):
    return {name.lower() for name in answer.headers if name.lower().startswith("access-control-") or name.lower() == "timing-allow-origin"}


def preflight(daemon, target, origin, method="POST", headers="content-type"):
    asked = {"Origin": origin, "Access-Control-Request-Method": method, "Access-Control-Request-Headers": headers}
    return daemon.request("OPTIONS", target, headers=asked)


def test_off_unless_named(daemon):
    for origin in (NAMED, "null", f"http://127.0.0.1:{daemon.port}"):
        answer = daemon.get(SUN, Origin=origin)
        assert answer.status == 200 and not cors_headers(answer) and "Vary" not in answer.headers
        refused = preflight(daemon, "/v1/render", origin)
        assert_problem(refused, 405, "method-not-allowed")
        assert not cors_headers(refused)


@pytest.fixture
def open_to_pages(guarded, keys):
    guarded.shown = bearer(keys.keys["alice"])
    return guarded


@pytest.mark.parametrize("origin", [NAMED, OTHER])
def test_named_origins(open_to_pages, origin):
    shown = {"Origin": origin, **open_to_pages.shown}
    render = open_to_pages.render(SMALL, **shown)
    # Why it was refused may be read, too.
    refused = [open_to_pages.get(SUN, Origin=origin), open_to_pages.render("{", **shown), open_to_pages.get("/nowhere", Origin=origin)]
    assert [answer.status for answer in refused] == [401, 400, 404]
    for answer in (render, open_to_pages.get(SUN, **shown), *refused):
        assert answer.headers["Access-Control-Allow-Origin"] == origin
        assert answer.headers["Timing-Allow-Origin"] == origin
        assert "Access-Control-Allow-Credentials" not in answer.headers
        assert "Origin" in ", ".join(answer.headers.get_all("Vary"))
        exposed = set(answer.headers["Access-Control-Expose-Headers"].split(", "))
        assert {"Server-Timing", "ETag", "Content-Location", "X-Request-Id", "Retry-After", "WWW-Authenticate"} <= exposed
    assert render.status == 200 and "Accept" in ", ".join(render.headers.get_all("Vary"))
    known = open_to_pages.get(render.headers["Content-Location"], **shown, If_None_Match=render.headers["ETag"])
    assert known.status == 304 and known.headers["Access-Control-Allow-Origin"] == origin


def test_preflight(open_to_pages):
    for target, methods in (("/v1/render", "GET, HEAD, POST"), ("/v1/assets/a", "GET, HEAD, PUT, DELETE")):
        answer = preflight(open_to_pages, target, NAMED, headers="authorization, content-type, x-timeout-ms")
        assert answer.status == 204 and answer.body == b""
        assert answer.headers["Access-Control-Allow-Origin"] == NAMED
        assert answer.headers["Access-Control-Allow-Methods"] == methods
        allowed = {name.lower() for name in answer.headers["Access-Control-Allow-Headers"].split(", ")}
        assert {"authorization", "content-type", "if-none-match", "if-match", "x-timeout-ms", "x-request-id"} <= allowed
        assert 0 < int(answer.headers["Access-Control-Max-Age"]) <= 7200
    assert_problem(preflight(open_to_pages, "/nowhere", NAMED), 404, "not-found")
    plain = open_to_pages.request("OPTIONS", "/v1/render", headers={"Origin": NAMED, **open_to_pages.shown})  # no question of a browser
    assert_problem(plain, 405, "method-not-allowed")


@pytest.mark.parametrize(
    "origin",
    ["null", "https://sky.example.evil.example", "https://sky.exampl", "http://sky.example", "https://sky.example:443", "https://SKY.example"]
    + ["https://sky.example,http://localhost:3000", "https://sky.example, http://localhost:3000", "http://localhost:300", "http://localhost:30001", "*", ""]
    + ["https://evil.example"],
)
def test_other_origins(open_to_pages, origin):
    shown = {"Origin": origin, **open_to_pages.shown}
    for answer in (open_to_pages.get(SUN, **shown), open_to_pages.get("/nowhere", **shown), preflight(open_to_pages, "/v1/render", origin)):
        assert not cors_headers(answer)
        assert "Origin" in ", ".join(answer.headers.get_all("Vary"))
    assert preflight(open_to_pages, "/v1/render", origin).status == 401  # no question that would be answered without a key
    assert "Origin" in open_to_pages.get(SUN).headers["Vary"]
