"""stratus compare against a server of our own: what it asks for, and what it makes of the answers."""
import json
import zlib

import pytest

from test_client import IMAGE, problem, server, stratus  # noqa: F401 (server is a fixture)

COMPARISON = {
    "width": 16, "height": 12, "exposure_ev": -4, "reference": "reference",
    "regions": [{"name": "all", "pixels": 192, "mean": 2.5}, {"name": "sky", "pixels": 0, "mean": None}],
    "variants": [
        {"name": "solved", "location": "/v1/render", "regions": {
            "all": {"bias": -0.0312, "bias_standard_error": 0.004, "channel_bias": [0, 0, 0], "rms": 0.2, "noise": 0.12,
                    "noise_corrected_rms": 0.16, "noise_corrected_rms_standard_error": 0.01, "flip": {"mean": 0.0812, "max": 0.5}},
            "sky": {"bias": None, "bias_standard_error": None, "rms": None, "noise": None, "noise_corrected_rms": None,
                    "noise_corrected_rms_standard_error": None, "flip": {"mean": None, "max": None}}}},
        {"name": "reference", "location": "/v1/render", "samples": 37, "partial": True, "regions": {"all": {"noise": 0.12}}},
    ],
}
TABLE = [
    ["against", "reference,", "16", "x", "12"],
    ["reference:", "37", "samples,", "cut", "short"],
    ["all", "192", "solved", "-3.12", "0.40", "20.00", "12.00", "16.00", "1.00", "0.0812", "0.5000"],
    ["sky", "0", "solved"] + ["-"] * 8,
]


def figures(handler):
    handler.answer(200, "application/json", json.dumps(COMPARISON).encode(), [("Server-Timing", "compare;dur=3, total;dur=9")])


def picture(handler):
    """A PNG of one pixel that carries the figures."""
    def chunk(name, data):
        return len(data).to_bytes(4, "big") + name + data + zlib.crc32(name + data).to_bytes(4, "big")

    text = b"stratus:comparison" + b"\0" * 5 + json.dumps(COMPARISON).encode()
    data = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", bytes([0, 0, 0, 1, 0, 0, 0, 1, 8, 2, 0, 0, 0])) + chunk(b"iTXt", text)
    handler.answer(200, "image/png", data + chunk(b"IDAT", zlib.compress(b"\0\0\0\0")) + chunk(b"IEND", b""))


def table_of(text):
    lines = [line.split() for line in text.decode().splitlines()]
    assert lines[2][0] == "region"
    return lines[:2] + lines[3:]


@pytest.fixture
def comparing(server):  # noqa: F811
    server.reply = figures
    return server


def test_a_scene_is_compared_with_its_reference(comparing):
    done = stratus(comparing, "compare")
    assert done.returncode == 0 and table_of(done.stdout) == TABLE
    assert [line.split()[0] for line in done.stderr.decode().splitlines()] == ["stage", "compare", "total", "client"]
    asked = comparing.seen[0]
    assert asked.path == "/v1/compare" and asked.headers["Accept"] == "application/json"
    assert asked.body == {"scene": {}, "variants": [{}, {"model": {"name": "reference"}}]}


def test_variants(comparing, tmp_path):
    (tmp_path / "scene.json").write_text('{"ground": {"type": "snow"}}')
    arguments = ["--with", "model.shading=paper", "--and", "radiosity.enabled=false", "--named", "old", "--with", "model.name=reference"]
    arguments += ["--and", "model.samples=9", "--against", "old", "--region", "cloud", "--region", "sky", "--set", "sun.elevation_deg=3"]
    assert stratus(comparing, "compare", tmp_path / "scene.json", *arguments).returncode == 0
    assert comparing.seen[0].body == {
        "scene": {"ground": {"type": "snow"}, "sun": {"elevation_deg": 3}},
        "variants": [{}, {"model": {"shading": "paper"}, "radiosity": {"enabled": False}, "name": "old"},
                     {"model": {"name": "reference", "samples": 9}}],
        "reference": "old",
        "regions": ["cloud", "sky"],
    }


def test_the_scene_itself_has_a_name(comparing):
    assert stratus(comparing, "compare", "--named", "now", "--preset", "dusk").returncode == 0
    assert comparing.seen[1].body["variants"][0] == {"name": "now"}
    assert comparing.seen[1].body["scene"] == {"sun": {"elevation_deg": 2}}


def test_json_file(comparing, tmp_path):
    done = stratus(comparing, "compare", "-o", tmp_path / "a.json")
    assert json.loads((tmp_path / "a.json").read_text()) == COMPARISON and table_of(done.stdout) == TABLE
    assert stratus(comparing, "compare", "-q", "-o", tmp_path / "a.json").stdout == b""


def test_standard_output_has_figures_alone(comparing):
    done = stratus(comparing, "compare", "-q", "-o", "-")
    assert json.loads(done.stdout) == COMPARISON and done.stderr == b""
    assert table_of(b"\n".join(stratus(comparing, "compare", "-o", "-").stderr.splitlines()[:5])) == TABLE


def test_picture_file(comparing, tmp_path):
    """The table comes out of the figures in the file."""
    comparing.reply = picture
    done = stratus(comparing, "compare", "-o", tmp_path / "a.png")
    assert comparing.seen[0].headers["Accept"] == "image/png"
    assert done.returncode == 0 and table_of(done.stdout) == TABLE and (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize("arguments", [
    ["a.json", "b.json"], ["--and", "sun.elevation_deg=1"], ["--with", "paper"], ["-o", "a.jpg"], ["-o", "a"], ["--preset", "x", "a.json"], ["--moon"],
])
def test_bad_usage(comparing, arguments):
    done = stratus(comparing, "compare", *arguments)
    assert done.returncode == 2 and done.stderr and not comparing.seen


def test_refusals(comparing, tmp_path):
    comparing.reply = problem
    done = stratus(comparing, "compare", "-o", tmp_path / "a.png")
    assert done.returncode == 1 and b"/sun/elevation_deg" in done.stderr and not (tmp_path / "a.png").exists()
    comparing.reply = lambda handler: handler.answer(200, "image/png", IMAGE)
    assert stratus(comparing, "compare").returncode == 1
    comparing.reply = lambda handler: handler.answer(200, "application/json", b"{}")
    assert stratus(comparing, "compare").returncode == 1
    comparing.reply = figures
    assert stratus(comparing, "compare", "-o", tmp_path / "none" / "a.json").returncode == 4


def test_help(comparing):
    text = stratus(comparing, "compare", "--help").stdout.decode()
    for option in ("--with", "--and", "--named", "--against", "--region", "--output", "--preset", "--set"):
        assert option in text
