"""A daemon to ask. Threads may share a Client: each has a connection of its own."""
from __future__ import annotations

import collections
import concurrent.futures
import http.client
import json
import os
import random
import ssl
import threading
import time
import urllib.parse
from collections.abc import Iterable, Iterator

import numpy

from stratus import errors
from stratus.members import Section, plain
from stratus.picture import Picture, read_timings
from stratus.scene import Scene

FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.25, 30.0


class Client:
    """Of the daemon at `url`, else at STRATUS_SERVER, else at http://127.0.0.1:8080.

    key: where the daemon asks for one (STRATUS_API_KEY). timeout_s: how long a request may take, in the daemon as well. retries: how often one is
    asked again while the daemon is busy (429, 503; not before its Retry-After) or away. ca_cert: authorities of an https address (STRATUS_CA_CERT).
    """

    def __init__(self, url: str | None = None, *, key: str | None = None, timeout_s: float = 60, retries: int = 10, ca_cert: str | None = None):
        self.url = url or os.environ.get("STRATUS_SERVER") or "http://127.0.0.1:8080"
        self.key = key or os.environ.get("STRATUS_API_KEY")
        self.timeout_s, self.retries = timeout_s, retries
        self._address = urllib.parse.urlsplit(self.url)
        if self._address.scheme not in ("http", "https") or not self._address.hostname:
            raise ValueError(f"a daemon is at http://HOST:PORT or https://HOST:PORT, not at {self.url}")
        trust = ca_cert or os.environ.get("STRATUS_CA_CERT")
        self._trust = ssl.create_default_context(cafile=trust) if self._address.scheme == "https" else None
        self._local = threading.local()

    # --- requests ---------------------------------------------------------------------------------------------------------------------------

    def _connection(self) -> http.client.HTTPConnection:
        if not hasattr(self._local, "connection"):
            host, port, patience = self._address.hostname, self._address.port, self.timeout_s + 2  # the daemon's own 504 says more
            if self._trust:
                self._local.connection = http.client.HTTPSConnection(host, port, timeout=patience, context=self._trust)
            else:
                self._local.connection = http.client.HTTPConnection(host, port, timeout=patience)
        return self._local.connection

    def _send_once(self, method: str, path: str, body: bytes | None, headers: dict) -> tuple[http.client.HTTPResponse, bytes]:
        connection = self._connection()
        rested = connection.sock is not None
        try:
            connection.request(method, path, body, headers)
            response = connection.getresponse()
            return response, response.read()
        except (OSError, http.client.HTTPException) as broken:
            connection.close()
            # A daemon may close a connection that rests at any time: what was then sent on it was not heard.
            if rested and isinstance(broken, (http.client.RemoteDisconnected, ConnectionResetError, BrokenPipeError)):
                return self._send_once(method, path, body, headers)
            raise errors.Unreachable(f"{self.url}: {broken or type(broken).__name__}") from broken

    def request(self, method: str, path: str, body: bytes | None = None, **headers: str) -> tuple[http.client.HTTPResponse, bytes]:
        """Any call, with retries; an answer beyond 299 is raised as what it is."""
        sent = {"X-Timeout-Ms": f"{self.timeout_s * 1000:.0f}", **headers}
        if self.key:
            sent["Authorization"] = f"Bearer {self.key}"
        pause_s = FIRST_PAUSE_S
        for attempt in range(self.retries + 1):
            wait_s = pause_s * random.uniform(1, 1.25)
            try:
                response, data = self._send_once(method, path, body, sent)
                if response.status < 300:
                    return response, data
                refused = _refusal(response, data)
                if not isinstance(refused, errors.Busy) or attempt == self.retries:
                    raise refused
                wait_s = max(wait_s, refused.retry_after_s)
            except errors.Unreachable:
                if attempt == self.retries:
                    raise
            time.sleep(wait_s)
            pause_s = min(2 * pause_s, LONGEST_PAUSE_S)
        raise AssertionError("unreachable")

    def _json(self, path: str, **query) -> dict:
        words = {name: _query_text(value) for name, value in query.items() if value is not None}
        _, data = self.request("GET", path + ("?" + urllib.parse.urlencode(words, safe=",") if words else ""))
        return json.loads(data)

    # --- pictures ----------------------------------------------------------------------------------------------------------------------------

    def render(self, scene: Scene | dict | None = None) -> Picture:
        """Renders a scene; `.array` of what comes is numpy's."""
        begin = time.monotonic()
        response, data = self.request("POST", "/v1/render", json.dumps(_plain_scene(scene)).encode(), **{"Content-Type": "application/json"})
        timings = read_timings(", ".join(response.headers.get_all("Server-Timing", [])))
        return Picture(data, response.headers.get_content_type(), timings, time.monotonic() - begin, response.headers.get("ETag", ""))

    def render_array(self, scene: Scene | dict | None = None) -> numpy.ndarray:
        return self.render(scene).array

    def render_many(self, scenes: Iterable[Scene | dict], *, at_once: int = 4, refused: str = "raise") -> Iterator[Picture | errors.Refused]:
        """Pictures in the order of the scenes, `at_once` requests under way. `scenes` may be endless: it is read as pictures are taken.

        refused: "raise", or "yield" to get the error in place of the picture and go on.
        """
        if refused not in ("raise", "yield"):
            raise ValueError('refused is "raise" or "yield"')
        waiting: collections.deque[concurrent.futures.Future] = collections.deque()
        pool = concurrent.futures.ThreadPoolExecutor(at_once)
        try:
            for scene in scenes:
                waiting.append(pool.submit(self.render, scene))
                if len(waiting) >= 2 * at_once:
                    yield _result(waiting.popleft(), refused)
            while waiting:
                yield _result(waiting.popleft(), refused)
        finally:
            pool.shutdown(wait=False, cancel_futures=True)

    # --- everything else ---------------------------------------------------------------------------------------------------------------------

    def compare(self, variants: list[dict], scene: Scene | dict | None = None, **more) -> dict:
        """Figures of /v1/compare; more: reference, regions."""
        body = {"scene": _plain_scene(scene), "variants": variants, **more}
        _, data = self.request("POST", "/v1/compare", json.dumps(body).encode(), **{"Content-Type": "application/json", "Accept": "application/json"})
        return json.loads(data)

    def presets(self) -> dict[str, Scene]:
        return {one["name"]: Scene.from_json(one["scene"]) for one in self._json("/v1/presets")["presets"]}

    def sun(self, time: str, latitude_deg: float, longitude_deg: float) -> dict:
        return self._json("/v1/sun", time=time, latitude_deg=latitude_deg, longitude_deg=longitude_deg)

    def optics(self, scene: Scene | dict | None = None, **query) -> dict:
        """Of the scene's droplets; query: sun_zenith_deg."""
        return self._json("/v1/optics", **_members(scene, ("dsd",), ("model.optics",)), **query)

    def slab(self, scene: Scene | dict | None = None, **query) -> dict:
        """Of the scene's droplets in a plane layer; query: optical_thickness or thickness_m, sun_zenith_deg, view_zenith_deg, ..."""
        return self._json("/v1/slab", **_members(scene, ("dsd",), ("model.optics",)), **query)

    def sky(self, scene: Scene | dict | None = None, **query) -> dict:
        """The clear sky of the scene's sun, atmosphere and ground; query: view_zenith_deg, azimuth_deg."""
        return self._json("/v1/sky", **_members(scene, ("sun", "atmosphere", "ground"), ()), **query)

    def ready(self) -> bool:
        try:
            return self._send_once("GET", "/readyz", None, {})[0].status == 200
        except errors.Unreachable:
            return False


def limits(path: str):
    """The range (low, high) of a scene's member, "sun.elevation_deg"; a list of them for a position; None where there is none."""
    from stratus.members import metadata

    return metadata(Scene, path)["limits"]


def _plain_scene(scene) -> dict:
    return {} if scene is None else scene.to_json() if isinstance(scene, Section) else plain_tree(scene)


def plain_tree(value):
    return {name: plain_tree(inner) for name, inner in value.items()} if isinstance(value, dict) else plain(value)


def _members(scene, sections, single) -> dict:
    found = {}
    for section, members in _plain_scene(scene).items():
        found.update({f"{section}.{name}": value for name, value in members.items() if section in sections or f"{section}.{name}" in single})
    return found


def _query_text(value) -> str:
    value = plain(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    return ",".join(map(_query_text, value)) if isinstance(value, list) else str(value)


def _refusal(response, data) -> errors.Refused:
    try:
        problem = json.loads(data)
        problem = problem if isinstance(problem, dict) else {}
    except ValueError:
        problem = {}
    after = response.headers.get("Retry-After", "")
    return errors.of_answer(response.status, problem, response.headers.get("X-Request-Id", ""), float(after) if after.isdigit() else 0.0)


def _result(future, refused):
    try:
        return future.result()
    except errors.Refused as error:
        if refused == "raise":
            raise
        return error
