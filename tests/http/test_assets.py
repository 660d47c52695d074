"""Uploaded maps: the calls, the scenes that name them, files of strangers, and everything at once."""
import concurrent.futures
import http.client
import itertools
import json
import os
import random
import re
import signal
import socket
import struct
import threading
import time
import zlib

import numpy
import OpenImageIO as oiio
import pytest

from conftest import SANITIZED, Daemon, in_some_try, wait_for
from test_service import assert_problem

SMALL = {"width": 32, "height": 24}


def write(path, pixels, kind="uint8", **attributes):
    """Any file that OpenImageIO writes. pixels: [height][width] or [height][width][channel]."""
    pixels = numpy.atleast_3d(numpy.asarray(pixels, numpy.float32))
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], kind)
    tile = attributes.pop("tile", 0)
    if tile:
        spec.tile_width = spec.tile_height = tile
    for name, value in attributes.items():
        spec.attribute(name.replace("__", ":"), value)
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), spec), output.geterror()
    if tile:
        assert output.write_tiles(0, pixels.shape[1], 0, pixels.shape[0], 0, 1, pixels), output.geterror()
    else:
        assert output.write_image(pixels), output.geterror()
    output.close()
    return path.read_bytes()


@pytest.fixture
def picture(tmp_path):
    """Bytes of a PNG, or with form="exr" of an EXR."""

    def make(pixels, kind="uint8", form="png", **attributes):
        return write(tmp_path / f"made.{form}", pixels, kind, **attributes)

    return make


def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png_by_hand(width, height, rows, before=b"", depth=8, kind=0):
    header = struct.pack(">IIBBBBB", width, height, depth, kind, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + before + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


@pytest.fixture
def put(daemon):
    """Uploads under names that go with the test."""
    names = []

    def upload(name, data, **headers):
        answer = daemon.request("PUT", f"/v1/assets/{name}", data, {k.replace("_", "-"): v for k, v in headers.items()})
        names.append(name)
        return answer

    yield upload
    for name in set(names):
        daemon.request("DELETE", f"/v1/assets/{name}")


def names_of(daemon):
    return [asset["name"] for asset in daemon.get("/v1/assets").json["assets"]]


def facts_of(daemon, name):
    return next(asset for asset in daemon.get("/v1/assets").json["assets"] if asset["name"] == name)


# --- the calls --------------------------------------------------------------------------------------------------------------------


def test_life_of_an_asset(daemon, put, picture):
    data, other = picture([[0, 0.5], [1, 0.2]]), picture([[0.1, 0.5, 0.9]])
    assert_problem(daemon.get("/v1/assets/hills"), 404, "not-found")
    created = put("hills", data)
    assert created.status == 201 and created.body == b""
    tag = created.headers["ETag"]
    assert re.fullmatch(r'"[0-9a-f]{32}"', tag)
    got = daemon.get("/v1/assets/hills")
    assert got.status == 200 and got.body == data
    assert got.headers["Content-Type"] == "image/png"
    assert got.headers["ETag"] == tag
    assert got.headers["Cache-Control"] == "no-cache"
    assert got.headers["X-Content-Type-Options"] == "nosniff"
    head = daemon.head("/v1/assets/hills")
    assert head.status == 200 and head.body == b""
    assert int(head.headers["Content-Length"]) == len(data)
    assert head.headers["ETag"] == tag

    same = put("hills", data)
    assert same.status == 204 and same.headers["ETag"] == tag
    replaced = put("hills", other)
    assert replaced.status == 204 and replaced.headers["ETag"] != tag
    assert daemon.get("/v1/assets/hills").body == other
    facts = facts_of(daemon, "hills")
    assert facts["hash"] == replaced.headers["ETag"].strip('"')
    assert (facts["width"], facts["height"], facts["bytes"], facts["content_type"]) == (3, 1, len(other), "image/png")
    assert facts["thickness"] == pytest.approx([26 / 255, 230 / 255], abs=1e-6)
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", facts["modified"])

    gone = daemon.request("DELETE", "/v1/assets/hills")
    assert gone.status == 204 and gone.body == b""
    assert_problem(daemon.get("/v1/assets/hills"), 404, "not-found")
    assert_problem(daemon.request("DELETE", "/v1/assets/hills"), 404, "not-found")
    assert "hills" not in names_of(daemon)


def test_exr_keeps_its_type(daemon, put, picture):
    data = picture([[0.25, 0.5]], "half", "exr")
    assert put("layer.exr", data, Content_Type="text/plain").status == 201
    got = daemon.get("/v1/assets/layer.exr")
    assert got.headers["Content-Type"] == "image/x-exr" and got.body == data


def test_conditional(daemon, put, picture):
    one, two = picture([[0.1]]), picture([[0.2]])
    assert_problem(put("cond", one, If_Match="*"), 412, "precondition-failed")
    tag = put("cond", one, If_None_Match="*").headers["ETag"]
    assert_problem(put("cond", two, If_None_Match="*"), 412, "precondition-failed")
    assert daemon.get("/v1/assets/cond").body == one
    for condition in (tag, "W/" + tag, f'"x", {tag}', "*"):
        known = daemon.get("/v1/assets/cond", If_None_Match=condition)
        assert known.status == 304 and known.body == b"" and known.headers["ETag"] == tag
    assert daemon.get("/v1/assets/cond", If_None_Match='"x"').status == 200
    assert_problem(daemon.get("/v1/assets/cond", If_Match='"x"'), 412, "precondition-failed")
    assert daemon.get("/v1/assets/cond", If_Match=tag).status == 200
    second = put("cond", two, If_Match=tag)
    assert second.status == 204
    assert_problem(put("cond", one, If_Match=tag), 412, "precondition-failed")
    assert_problem(daemon.request("DELETE", "/v1/assets/cond", headers={"If-Match": tag}), 412, "precondition-failed")
    assert daemon.request("DELETE", "/v1/assets/cond", headers={"If-Match": second.headers["ETag"]}).status == 204
    listed = daemon.get("/v1/assets")
    assert daemon.get("/v1/assets", If_None_Match=listed.headers["ETag"]).status == 304


def test_names(daemon, put, picture):
    data = picture([[0.5]])
    for name in ("a", "A-b_c.9", "x" * 63, "upload.ABCDEF", "%61%2Db"):
        assert put(name, data).status == 201, name
    assert {"a", "A-b_c.9", "x" * 63, "upload.ABCDEF", "a-b"} <= set(names_of(daemon))
    bad = ["", ".a", "..", "../x", "%2e%2e", "a/b", "a%2Fb", "%2Fetc%2Fpasswd", "x" * 64, "a%20b", "a%00", "%C3%A4", "a%", "..%2f..%2fx", "a+b"]
    for name in bad:
        assert_problem(daemon.request("PUT", f"/v1/assets/{name}", data), 400, "bad-request")
        assert_problem(daemon.get(f"/v1/assets/{name}"), 404, "not-found")
        assert_problem(daemon.request("DELETE", f"/v1/assets/{name}"), 404, "not-found")


def test_methods(daemon):
    for method in ("POST", "PATCH", "OPTIONS"):
        answer = daemon.request(method, "/v1/assets/a")
        assert_problem(answer, 405, "method-not-allowed")
        assert answer.headers["Allow"] == "GET, HEAD, PUT, DELETE"
    for method in ("PUT", "DELETE", "POST"):
        answer = daemon.request(method, "/v1/assets")
        assert_problem(answer, 405, "method-not-allowed")
        assert answer.headers["Allow"] == "GET, HEAD"


def test_refused_bodies(daemon, put, picture):
    data = picture([[0.5]])
    assert_problem(put("bad", b""), 415, "unsupported-media-type")
    assert_problem(put("bad", b"\x89PN"), 415, "unsupported-media-type")
    assert_problem(put("bad", b"GIF89a" + bytes(100000)), 415, "unsupported-media-type")
    assert_problem(put("bad", data, Content_Encoding="gzip"), 415, "unsupported-media-type")
    assert_problem(put("bad", data, Content_Range="bytes 0-9/100"), 400, "bad-request")
    assert_problem(put("bad", data[:-20]), 422, "invalid-asset")
    assert_problem(put("bad", png_by_hand(100000, 100000, b"")), 422, "invalid-asset")
    assert "100000 x 100000" in put("bad", png_by_hand(100000, 100000, b"")).json["detail"]
    assert_problem(put("bad", png_by_hand(64, 64, b"\0" * 65)), 422, "invalid-asset")  # fewer rows than it says
    assert_problem(put("bad", png_by_hand(4, 4, b"\x09\1\2\3\4" * 4)), 422, "invalid-asset")  # no such filter
    assert_problem(put("bad", picture([[0.5, float("nan")]], "float", "exr")), 422, "invalid-asset")
    assert "bad" not in names_of(daemon)


def test_texts_are_not_unpacked(daemon, put):
    """A compressed text that would be a gigabyte, and large ones that are none."""
    bomb = zlib.compress(bytes(200 << 20), 9)
    before = chunk(b"zTXt", b"key\0\0" + bomb) + chunk(b"iTXt", b"key\0\1\0\0\0" + bomb) + chunk(b"iTXt", b"key\0\0\0\0\0" + bytes(8 << 20))
    data = png_by_hand(1, 1, b"\0\x33", before)

    def is_quick():
        began = time.monotonic()
        assert put("texts", data).status in (201, 204)
        return time.monotonic() - began < (30 if SANITIZED else 5)

    assert in_some_try(is_quick)
    assert facts_of(daemon, "texts")["thickness"] == pytest.approx([0.2, 0.2], abs=1e-6)


def test_kinds_of_files(daemon, put, picture, tmp_path):
    """Whatever other programs write is read as they meant it."""
    ramp = numpy.linspace(0, 1, 48, dtype=numpy.float32).reshape(6, 8)
    colours = numpy.stack([ramp, ramp * 0.5, ramp * 0.25], 2)
    kinds = [
        ("png", "uint8", ramp, {}, 0.5 / 255),
        ("png", "uint16", ramp, {}, 0.5 / 65535),
        ("exr", "half", ramp, {}, 1e-3),
        ("exr", "float", ramp, {"tile": 16}, 1e-7),
        ("exr", "float", ramp, {"openexr__lineOrder": "decreasingY"}, 1e-7),
    ] + [("exr", "half", colours, {"compression": c}, 0.02) for c in ("none", "rle", "zip", "zips", "piz", "pxr24", "b44", "dwaa", "dwab")]
    for form, kind, pixels, attributes, tolerance in kinds:
        answer = put("kind", picture(pixels, kind, form, **attributes))
        assert answer.status in (201, 204), (form, kind, attributes, answer.body)
        assert facts_of(daemon, "kind")["albedo"][0] == pytest.approx(0, abs=tolerance)
        assert facts_of(daemon, "kind")["thickness"][1] == pytest.approx(1 if pixels is ramp else 0.2126 + 0.3576 + 0.01805, abs=tolerance)


def test_exr_of_several_parts_or_deep(daemon, put, tmp_path):
    path = tmp_path / "parts.exr"
    specs = [oiio.ImageSpec(4, 4, 3, "half"), oiio.ImageSpec(4, 4, 3, "half")]
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), tuple(specs))
    output.write_image(numpy.zeros((4, 4, 3), numpy.float32))
    assert output.open(str(path), specs[1], "AppendSubimage")
    output.write_image(numpy.zeros((4, 4, 3), numpy.float32))
    output.close()
    answer = put("parts", path.read_bytes())
    assert_problem(answer, 422, "invalid-asset")
    assert "several parts" in answer.json["detail"]


# --- limits -----------------------------------------------------------------------------------------------------------------------


def noise(side, seed=0):
    return numpy.random.default_rng(seed).random((side, side))


def test_limits(start_daemon, picture):
    daemon = start_daemon("--asset-max-mb", "1", "--asset-count", "3", "--assets-disk-mb", "2")
    fits, large = picture(noise(900)), picture(noise(1200))
    assert len(fits) < 1 << 20 < len(large)
    assert_problem(daemon.request("PUT", "/v1/assets/large", large), 413, "body-too-large")
    assert daemon.request("PUT", "/v1/assets/a", fits).status == 201
    assert daemon.request("PUT", "/v1/assets/b", fits).status == 201
    assert_problem(daemon.request("PUT", "/v1/assets/c", picture(noise(700))), 507, "storage-full")
    assert daemon.request("PUT", "/v1/assets/b", fits).status == 204
    assert daemon.request("PUT", "/v1/assets/c", picture([[0.5]])).status == 201
    full = daemon.request("PUT", "/v1/assets/d", picture([[0.5]]))
    assert_problem(full, 507, "storage-full")
    assert "at most 3 and 2097152 bytes" in full.json["detail"]
    assert daemon.get("/v1/assets").json["limits"] == {"count": 3, "total_bytes": 2 << 20, "bytes": 1 << 20, "side": 8192}
    assert daemon.metric("stratus_assets") == 3
    assert daemon.metric("stratus_assets_bytes") == 2 * len(fits) + len(picture([[0.5]]))
    assert daemon.request("DELETE", "/v1/assets/a").status == 204
    assert daemon.request("PUT", "/v1/assets/d", picture([[0.5]])).status == 201
    assert daemon.metric('stratus_requests_total{route="/v1/assets/NAME",status="507"}') == 2


def test_uploads_may_be_switched_off(start_daemon, picture):
    daemon = start_daemon("--asset-count", "0")
    assert_problem(daemon.request("PUT", "/v1/assets/a", picture([[0.5]])), 507, "storage-full")
    assert daemon.get("/v1/assets").json["assets"] == []


def test_body_of_unknown_length(daemon, put, picture):
    """Chunked, without a Content-Length, right up to the limit and beyond it."""
    data = picture(noise(300))

    def pieces(count):
        for i in range(0, len(data), 5000):
            yield data[i : i + 5000]
        for _ in range(count):
            yield bytes(1 << 20)

    connection = daemon.connect()
    connection.request("PUT", "/v1/assets/chunked", pieces(0), encode_chunked=True, headers={"Transfer-Encoding": "chunked"})
    assert connection.getresponse().status == 201
    connection.close()
    connection = daemon.connect()
    try:
        connection.request("PUT", "/v1/assets/chunked", pieces(80), encode_chunked=True, headers={"Transfer-Encoding": "chunked"})
    except (BrokenPipeError, ConnectionResetError):
        pass
    try:
        assert connection.getresponse().status == 413
    except (ConnectionError, http.client.HTTPException):
        pass  # the answer may be lost with what was still on its way
    connection.close()
    assert daemon.get("/v1/assets/chunked").body == data
    daemon.request("DELETE", "/v1/assets/chunked")


def test_expectation_is_answered_before_the_body(daemon):
    """What is wrong in the headers is said before a client that waits for it has sent a byte."""
    with socket.create_connection(("127.0.0.1", daemon.port), timeout=180) as client:
        client.sendall(b"PUT /v1/assets/big HTTP/1.1\r\nHost: x\r\nContent-Length: 99999999999\r\nExpect: 100-continue\r\n\r\n")
        assert client.recv(4096).startswith(b"HTTP/1.1 413 ")


def test_broken_uploads_leave_nothing(start_daemon, picture):
    daemon = start_daemon()
    incoming = daemon.log.parent / "state" / "assets" / "incoming"
    data = picture(noise(300))
    for _ in range(5):
        client = socket.create_connection(("127.0.0.1", daemon.port))
        client.sendall(b"PUT /v1/assets/part HTTP/1.1\r\nHost: x\r\nContent-Length: %d\r\n\r\n" % len(data) + data[:10000])
        assert wait_for(lambda: any(incoming.iterdir()) if incoming.exists() else False)
        client.close()
        assert wait_for(lambda: not any(incoming.iterdir()))
    assert daemon.get("/v1/assets").json["assets"] == []
    assert wait_for(lambda: daemon.metric("stratus_requests_in_flight") == 1)


# --- scenes -----------------------------------------------------------------------------------------------------------------------


def thickness_at(daemon, read_image, name, east, north, **clouds):
    """Optical thickness straight above a place, over that of 400 m."""
    scene = {
        "clouds": {"map": name, "tile_m": 16000, "resolution": 256, "wind_mps": [0, 0], **clouds},
        "camera": {"position_m": [east, north, 2], "elevation_deg": 90, "vertical_fov_deg": 2},
        "output": {"width": 16, "height": 16, "format": "exr", "layers": ["optical_thickness"]},
    }
    answer = daemon.render(scene)
    assert answer.status == 200, answer.body
    optics = daemon.get("/v1/optics").json
    return read_image(answer.body)[0][8, 8, 0] / (400 * optics["extinction_per_m"][1])


@pytest.mark.parametrize("form, kind", [("png", "uint8"), ("png", "uint16"), ("exr", "half"), ("exr", "float")])
def test_first_row_is_the_north(daemon, put, picture, read_image, form, kind):
    pixels = numpy.full((8, 8), 0.2, numpy.float32)
    pixels[0, 0] = 1  # north-west
    put("corner", picture(pixels, kind, form))
    assert thickness_at(daemon, read_image, "corner", 1000, 15000) == pytest.approx(1, abs=0.03)
    for east, north in ((15000, 15000), (1000, 1000), (15000, 1000), (8000, 8000)):
        assert thickness_at(daemon, read_image, "corner", east, north) == pytest.approx(0.2, abs=0.01)
    # Periodic, and half as thick when thickness_m is.
    assert thickness_at(daemon, read_image, "corner", 1000 - 16000, 15000 + 32000, thickness_m=200) == pytest.approx(0.5, abs=0.02)


def test_wind_moves_the_map(daemon, put, picture, read_image):
    pixels = numpy.zeros((8, 8), numpy.float32)
    pixels[3, 4] = 1
    put("spot", picture(pixels))
    wind = {"wind_mps": [10, -5], "time_s": 400}
    assert thickness_at(daemon, read_image, "spot", 9000, 9000) == pytest.approx(1, abs=0.03)
    assert thickness_at(daemon, read_image, "spot", 9000, 9000, **wind) == pytest.approx(0, abs=0.01)
    assert thickness_at(daemon, read_image, "spot", 13000, 7000, **wind) == pytest.approx(1, abs=0.03)


def ground_at(daemon, read_image, ground, east, north):
    scene = {
        "ground": ground,
        "clouds": {"type": "none", "tile_m": 16000},
        "camera": {"position_m": [east, north, 50], "elevation_deg": -90, "vertical_fov_deg": 2},
        "output": {"width": 16, "height": 16, "format": "exr", "layers": ["ground"], "exr_type": "float"},
    }
    answer = daemon.render(scene)
    assert answer.status == 200, answer.body
    return read_image(answer.body)[0][8, 8]


def test_ground_map(daemon, put, picture, read_image):
    """sRGB codes in PNG, reflectances in EXR; the same light as from a Lambertian ground of that albedo, nearly: the air is lit by the mean."""
    linear = numpy.full((8, 8, 3), [0.05, 0.1, 0.2], numpy.float32)
    linear[0, 0] = [0.6, 0.4, 0.2]
    srgb = numpy.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    for data in (picture(srgb, "uint16"), picture(linear, "float", "exr")):
        put("ground", data)
        for east, north, albedo in ((1000, 15000, [0.6, 0.4, 0.2]), (1000, 1000, [0.05, 0.1, 0.2])):
            mapped = ground_at(daemon, read_image, {"map": "ground"}, east, north)
            lambert = ground_at(daemon, read_image, {"type": "lambert", "albedo": albedo}, east, north)
            assert mapped == pytest.approx(lambert, rel=0.06)
    doubled = ground_at(daemon, read_image, {"map": "ground", "albedo_scale": 1.5}, 1000, 15000)
    assert doubled == pytest.approx(1.5 * ground_at(daemon, read_image, {"map": "ground"}, 1000, 15000), rel=0.03)


def test_refused_scenes(daemon, put, picture):
    put("fair", picture([[0.25, 0.5]], "float", "exr"))
    put("beyond", picture([[0.25, 1.5]], "float", "exr"))
    put("below", picture([[-0.25, 0.5]], "float", "exr"))
    put("bright", picture([[0.5, 1]]))

    def refused(scene, pointer, words):
        answer = daemon.render({**scene, "output": SMALL})
        assert_problem(answer, 422, "invalid-scene")
        assert answer.pointers == {pointer}
        assert words in answer.json["errors"][0]["detail"]

    refused({"clouds": {"map": "nowhere"}}, "/clouds/map", "no asset")
    refused({"ground": {"map": "nowhere"}}, "/ground/map", "no asset")
    refused({"clouds": {"map": "../fair"}}, "/clouds/map", "name of an asset")
    refused({"clouds": {"map": "beyond"}}, "/clouds/map", "1.5")
    refused({"clouds": {"map": "below"}}, "/clouds/map", "-0.25")
    refused({"ground": {"map": "beyond"}}, "/ground/map", "1.5")
    refused({"ground": {"map": "bright", "albedo_scale": 1.1}}, "/ground/albedo_scale", "at most 1 ")
    refused({"ground": {"map": "fair", "albedo_scale": 2.0000001}}, "/ground/albedo_scale", "from 0 to 2")
    refused({"ground": {"map": "fair", "type": "snow"}}, "/ground/type", "map")
    refused({"ground": {"map": "fair", "albedo": [0.1, 0.1, 0.1]}}, "/ground/albedo", "map")
    for member, value in (("type", "stratus"), ("seed", 3), ("coverage", 0.5)):
        refused({"clouds": {"map": "fair", member: value}}, f"/clouds/{member}", "map")
    refused({"clouds": {"map": "fair", "map_hash": "0" * 32}}, "/clouds/map_hash", "holds now")
    refused({"ground": {"map_hash": "0" * 32}}, "/ground/map_hash", "map")
    both = daemon.render({"clouds": {"map": "nowhere"}, "ground": {"map": "nowhere"}})
    assert both.pointers == {"/clouds/map", "/ground/map"}
    assert daemon.render({"ground": {"map": "fair", "albedo_scale": 2}, "output": SMALL}).status == 200


def test_other_calls_take_no_maps(daemon, put, picture):
    """Droplets know nothing of maps."""
    for call in ("/v1/optics", "/v1/slab?optical_thickness=1"):
        answer = daemon.get(call + ("&" if "?" in call else "?") + "clouds.map=a")
        assert_problem(answer, 422, "invalid-scene")


def test_clear_sky_over_a_map(daemon, put, picture):
    """/v1/sky goes by the mean of the ground."""
    linear = numpy.full((4, 4, 3), [0.1, 0.2, 0.3], numpy.float32)
    linear[0] = [0.9, 0.6, 0.3]
    put("ground", picture(linear, "float", "exr"))
    mean = facts_of(daemon, "ground")["mean_albedo"]
    assert mean == pytest.approx([0.3, 0.3, 0.3], abs=1e-6)
    mapped = daemon.get("/v1/sky?ground.map=ground")
    assert mapped.headers["Cache-Control"] == "no-cache"
    lambert = daemon.get("/v1/sky?ground.type=lambert&ground.albedo=0.3,0.3,0.3")
    black = daemon.get("/v1/sky?ground.type=black")
    assert mapped.json["diffuse_irradiance"] == pytest.approx(lambert.json["diffuse_irradiance"], rel=1e-4)
    assert mapped.json["diffuse_irradiance"][2] > 1.02 * black.json["diffuse_irradiance"][2]
    put("ground", picture([[0.0]]))
    darker = daemon.get("/v1/sky?ground.map=ground", If_None_Match=mapped.headers["ETag"])
    assert darker.status == 200
    assert darker.json["diffuse_irradiance"] == pytest.approx(black.json["diffuse_irradiance"], rel=1e-4)
    assert_problem(daemon.get("/v1/sky?ground.map=nowhere"), 422, "invalid-scene")


def test_content_decides_about_tags(daemon, put, picture, read_image):
    put("twin", picture([[0.3]]))
    scene = {"clouds": {"map": "twin"}, "ground": {"map": "twin"}, "output": SMALL}
    first = daemon.render(scene)
    location = first.headers["Content-Location"]
    assert "clouds.map=twin" in location and "ground.map=twin" in location and "hash" not in location
    assert first.headers["Cache-Control"] == "no-cache"
    again = daemon.get(location, Cache_Control="no-cache")
    assert (again.body, again.headers["ETag"]) == (first.body, first.headers["ETag"])
    assert daemon.get(location, If_None_Match=first.headers["ETag"]).status == 304
    embedded = read_image(first.body)[1].getattribute("stratus:scene")
    digest = facts_of(daemon, "twin")["hash"]
    for section in ("clouds", "ground"):
        members = json.loads(embedded)[section]
        assert (members["map"], members["map_hash"]) == ("twin", digest)
        assert "type" not in members
    replayed = daemon.render(embedded)
    assert (replayed.body, replayed.headers["ETag"]) == (first.body, first.headers["ETag"])

    put("twin", picture([[0.6]]))
    changed = daemon.get(location, If_None_Match=first.headers["ETag"])
    assert changed.status == 200
    assert changed.headers["ETag"] != first.headers["ETag"] and changed.body != first.body
    assert daemon.render(embedded).pointers == {"/clouds/map_hash", "/ground/map_hash"}
    put("twin", picture([[0.3]]))
    assert daemon.get(location).body == first.body
    # The same content under another name: the same pixels, another scene.
    put("other", picture([[0.3]]))
    other = daemon.render({"clouds": {"map": "other"}, "ground": {"map": "other"}, "output": SMALL})
    assert numpy.array_equal(read_image(other.body)[0], read_image(first.body)[0])
    assert other.headers["ETag"] != first.headers["ETag"]
    daemon.request("DELETE", "/v1/assets/twin")
    assert_problem(daemon.get(location), 422, "invalid-scene")
    assert_problem(daemon.get(location, If_None_Match=first.headers["ETag"]), 422, "invalid-scene")


def test_decoding_counts_where_it_belongs(daemon, put, picture):
    put("time", picture(noise(1500)))
    scene = {"clouds": {"map": "time", "resolution": 128}, "ground": {"map": "time"}, "output": SMALL}
    first = daemon.render(scene).timing
    assert float(first["field"]["dur"]) > 0 and "desc" not in first["field"]
    second = daemon.render({**scene, "camera": {"azimuth_deg": 3}}).timing
    assert second["field"]["desc"] == second["sky"]["desc"] == '"reused"'
    assert daemon.metric("stratus_asset_maps_bytes") > 128 * 128 * 4


# --- what happens at once, and what outlasts the daemon ----------------------------------------------------------------------------


def test_kept_on_disk(tmp_path, picture):
    daemon = Daemon(tmp_path)
    data = picture(noise(64))
    tag = daemon.request("PUT", "/v1/assets/kept", data).headers["ETag"]
    listed = daemon.get("/v1/assets").body
    daemon.process.send_signal(signal.SIGKILL)
    daemon.process.wait()
    daemon.stop()
    daemon = Daemon(tmp_path)
    try:
        assert daemon.get("/v1/assets").body == listed
        got = daemon.get("/v1/assets/kept")
        assert (got.body, got.headers["ETag"]) == (data, tag)
        assert daemon.render({"clouds": {"map": "kept"}, "output": SMALL}).status == 200
    finally:
        daemon.stop()
        daemon.assert_clean()


def test_killed_while_replacing(tmp_path, picture):
    """Whatever was answered 204 is there, or what came after it; always a whole file; nothing is left beside it."""
    versions = [picture(noise(200, seed)) for seed in range(6)]
    for kill_after in (0.05, 0.2):
        daemon = Daemon(tmp_path)
        assert daemon.request("PUT", "/v1/assets/map", versions[0]).status in (201, 204)
        answered = [versions[0]]

        def replace():
            try:
                for i in range(10000):
                    version = versions[i % len(versions)]
                    if daemon.request("PUT", "/v1/assets/map", version).status == 204:
                        answered.append(version)
            except (ConnectionError, http.client.HTTPException, OSError):
                pass

        thread = threading.Thread(target=replace)
        thread.start()
        time.sleep(kill_after)
        daemon.process.send_signal(signal.SIGKILL)
        thread.join()
        daemon.stop()
        daemon = Daemon(tmp_path)
        found = daemon.get("/v1/assets/map").body
        following = versions[(versions.index(answered[-1]) + 1) % len(versions)] if len(answered) > 1 else versions[0]
        assert found in (answered[-1], following)
        assert not any((tmp_path / "state" / "assets" / "incoming").iterdir())
        assert daemon.render({"clouds": {"map": "map"}, "output": SMALL}).status == 200
        daemon.stop()
        daemon.assert_clean()


def test_everything_at_once(start_daemon, picture, read_image):
    """Uploads, deletions and renders of one name: each picture is one of a content that the name had, never a mixture, and none is lost."""
    daemon = start_daemon("--queue-length", "64", "--assets-mb", "1")
    values = [0.1, 0.4, 0.9]
    versions = [picture(numpy.full((400, 400), value)) for value in values]
    scene = {
        "clouds": {"map": "busy", "resolution": 256},
        "camera": {"elevation_deg": 90},
        "output": {"width": 16, "height": 16, "format": "exr", "layers": ["optical_thickness"]},
    }
    daemon.request("PUT", "/v1/assets/busy", versions[0])
    extinction = daemon.get("/v1/optics").json["extinction_per_m"][1]
    begin, seen = time.monotonic(), set()

    def goes_on():
        """For some seconds, and until two of the contents were rendered."""
        return time.monotonic() < begin + (4 if len(seen) >= 2 else 180)

    def change(number):
        source = random.Random(number)
        while goes_on():
            if source.random() < 0.2:
                assert daemon.request("DELETE", "/v1/assets/busy").status in (204, 404)
            else:
                assert daemon.request("PUT", "/v1/assets/busy", source.choice(versions)).status in (201, 204)

    def render(number):
        source = random.Random(number)
        while goes_on():
            answer = daemon.render({**scene, "camera": {"elevation_deg": 90, "azimuth_deg": source.randrange(360)}})
            if answer.status == 422:
                assert answer.pointers == {"/clouds/map"}
                continue
            assert answer.status == 200, answer.body
            pixels, spec = read_in_thread(answer.body)
            value = pixels.mean() / (400 * extinction)
            assert pixels.std() < 1e-3 * pixels.mean()
            nearest = min(values, key=lambda v: abs(v - value))
            assert value == pytest.approx(nearest, abs=0.005)
            seen.add(nearest)

    def read_in_thread(body):
        # read_image writes one file for all.
        path = daemon.log.parent / f"{threading.get_ident()}.exr"
        path.write_bytes(body)
        source = oiio.ImageInput.open(str(path))
        pixels = numpy.array(source.read_image(oiio.FLOAT))
        source.close()
        return pixels, None

    with concurrent.futures.ThreadPoolExecutor(6) as pool:
        work = [pool.submit(change, i) for i in range(3)] + [pool.submit(render, i) for i in range(3)]
        for done in work:
            done.result()
    assert len(seen) >= 2
    assert wait_for(lambda: daemon.metric("stratus_requests_in_flight") == 1)
    assert daemon.metric("stratus_asset_maps_bytes") <= 1 << 20


def test_deleting_one_in_use(start_daemon, picture):
    """Renders that wait for their map to be decoded finish, although it was deleted meanwhile."""
    daemon = start_daemon()
    scenes = [{"clouds": {"map": "used", "resolution": r}, "output": SMALL} for r in (64, 128, 256, 512, 1024)]
    seeds = itertools.count()

    def one_is_overtaken():
        assert daemon.request("PUT", "/v1/assets/used", picture(noise(2000, next(seeds)))).status == 201
        with concurrent.futures.ThreadPoolExecutor(len(scenes)) as pool:
            running = [pool.submit(daemon.render, scene) for scene in scenes]
            assert wait_for(lambda: daemon.metric("stratus_requests_in_flight") > 1 or all(job.done() for job in running))
            assert daemon.request("DELETE", "/v1/assets/used").status == 204
            late = [job for job in running if not job.done()]
            assert {job.result().status for job in running} <= {200, 422}
        return any(job.result().status == 200 for job in late)

    assert in_some_try(one_is_overtaken, 20)
