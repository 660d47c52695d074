"""stratus info on the daemon's own files, and on files that lie."""
import json
import os
import subprocess

import OpenImageIO as oiio
import pytest

from conftest import BUILD

PLACE = {"time": "2024-06-21T14:00:00.25+02:00", "latitude_deg": 48, "longitude_deg": 11.5}


def info(path, *options):
    return subprocess.run([str(BUILD / "stratus"), "info", *options, str(path)], capture_output=True, text=True, timeout=180)


@pytest.fixture(scope="module")
def files(daemon, tmp_path_factory):
    folder = tmp_path_factory.mktemp("info")
    output = {"width": 64, "height": 32}
    for name, more in (("sky.png", {}), ("sky.exr", {"format": "exr", "layers": ["color", "distance"]})):
        (folder / name).write_bytes(daemon.render({"sun": PLACE, "output": {**output, **more}}).body)
    return folder


def test_exr_says_what_the_other_reader_reads(files):
    told = json.loads(info(files / "sky.exr", "--json").stdout)
    spec = oiio.ImageInput.open(str(files / "sky.exr")).spec()
    assert (told["format"], told["width"], told["height"]) == ("exr", 64, 32)
    assert sorted(told["channels"]) == sorted(spec.channelnames)
    attributes = told["attributes"]
    for name in ("whiteLuminance", "altitude", "latitude", "longitude", "utcOffset") + tuple(
        f"stratus:{part}_illuminance_lux" for part in ("global", "direct", "diffuse")
    ):
        assert attributes[name] == pytest.approx(spec.getattribute(name), rel=1e-6), name
    assert attributes["stratus:global_illuminance_lux"] > 10000
    assert attributes["capDate"] == spec.getattribute("DateTime") == "2024:06:21 12:00:00"
    assert (attributes["latitude"], attributes["longitude"], attributes["altitude"]) == (48, 11.5, 2)
    assert attributes["chromaticities"] == pytest.approx([0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290])
    assert attributes["adoptedNeutral"] == pytest.approx([0.3127, 0.3290])
    assert len(attributes["worldToCamera"]) == 16
    assert attributes["compression"] == "zip"


def test_exrheader_reads_it_too(files):
    text = subprocess.run(["exrheader", str(files / "sky.exr")], capture_output=True, text=True, check=True).stdout
    for line in (
        'capDate (type string): "2024:06:21 12:00:00"',
        "latitude (type float): 48",
        "utcOffset (type float): 0",
        "whiteLuminance (type float): 1000",
        "adoptedNeutral (type v2f): (0.3127 0.329)",
    ):
        assert line in text
    assert "worldToCamera (type m44f)" in text and "stratus:global_illuminance_lux (type float)" in text


@pytest.mark.parametrize("name", ["sky.png", "sky.exr"])
def test_the_scene_renders_the_file_again(daemon, files, name):
    scene = info(files / name, "--scene")
    assert scene.returncode == 0
    assert json.loads(scene.stdout)["sun"] == {**PLACE, "time": "2024-06-21T12:00:00.250Z"}
    assert daemon.render(json.loads(scene.stdout), Cache_Control="no-cache").body == (files / name).read_bytes()


def test_text_form(files):
    told = info(files / "sky.png")
    assert told.returncode == 0
    lines = told.stdout.splitlines()
    assert lines[0].split() == ["image", "png,", "64", "x", "32"]
    assert any(line.startswith("stratus:scene ") for line in lines)
    assert "channels" in info(files / "sky.exr").stdout


def test_files_that_lie(files, tmp_path):
    """Nothing but a message and exit status 2, whatever the bytes; cut anywhere, header bytes changed anywhere."""
    for name in ("sky.png", "sky.exr"):
        whole = (files / name).read_bytes()
        broken = [whole[:cut] for cut in (0, 3, 8, 20, 60, 200, 900)]
        broken += [whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :] for at in range(8, 700, 23)]
        for body in broken:
            path = tmp_path / name
            path.write_bytes(body)
            told = info(path)
            assert told.returncode in (0, 2), (told.returncode, told.stderr)
            assert "Sanitizer" not in told.stderr
            assert told.returncode == 0 or told.stderr.startswith("stratus: ")
            assert not any(ord(c) < 32 and c != "\n" for c in told.stdout)
    (tmp_path / "text").write_text("no image at all, but long enough")
    for path in (tmp_path / "text", tmp_path / "none", tmp_path):
        told = info(path)
        assert (told.returncode, told.stdout) == (2, "")
        assert os.path.basename(path) in told.stderr
    assert info(files / "sky.png", "--wrong").returncode == 2


def test_numbers_stand_as_they_were(daemon, tmp_path):
    scene = {"sun": {"elevation_deg": 0.1 + 0.2, "azimuth_deg": 1 / 3}, "output": {"width": 32, "height": 24}}
    (tmp_path / "x.png").write_bytes(daemon.render(scene).body)
    told = info(tmp_path / "x.png", "--scene").stdout
    assert '"elevation_deg":0.30000000000000004,"azimuth_deg":0.3333333333333333}' in told and '"coverage":0.7,' in told
    assert '"coverage":0.7,' in info(tmp_path / "x.png").stdout
    assert json.loads(info(tmp_path / "x.png", "--json").stdout)["scene"] == json.loads(told)
