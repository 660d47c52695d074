"""Reads back, through OpenImageIO's own reader, the sample files that the unit test of the image module writes."""

import math
import os
import pathlib
import struct
import subprocess
import zlib

import numpy
import OpenImageIO as oiio
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = ROOT / os.environ.get("STRATUS_BUILD", "build")
WIDTH, HEIGHT = 45, 70
SCENE = '{"note":"h\u00e9 \u2601"}'
LAYERS = ["color", "sun_direct", "transmittance", "optical_thickness", "distance"]
CHANNELS = {
    "color": ["R", "G", "B"],
    "sun_direct": ["sun_direct.R", "sun_direct.G", "sun_direct.B"],
    "transmittance": ["transmittance.R", "transmittance.G", "transmittance.B"],
    "optical_thickness": ["optical_thickness.Y"],
    "distance": ["distance.Z"],
}


@pytest.fixture(scope="module")
def samples(tmp_path_factory):
    folder = tmp_path_factory.mktemp("samples")
    subprocess.run([BUILD / "tests/test_image"], env={**os.environ, "STRATUS_IMAGE_DIR": str(folder)}, check=True, capture_output=True)
    return folder


def read(path, kind):
    image = oiio.ImageInput.open(str(path))
    assert image, oiio.geterror()
    spec = image.spec()
    pixels = image.read_image(0, 0, 0, spec.nchannels, kind)
    image.close()
    return spec, pixels


def chunks(path):
    data = path.read_bytes()
    at = 8
    while at < len(data):
        size, name = struct.unpack(">I4s", data[at : at + 8])
        body = data[at + 8 : at + 8 + size]
        assert struct.unpack(">I", data[at + 8 + size : at + 12 + size])[0] == zlib.crc32(name + body)
        yield name.decode(), body
        at += 12 + size


@pytest.mark.parametrize("compression", ["fast", "small"])
@pytest.mark.parametrize("bits", [8, 16])
def test_png_values(samples, bits, compression):
    spec, pixels = read(samples / f"{bits}-{compression}.png", f"uint{bits}")
    y, x, c = numpy.mgrid[0:HEIGHT, 0:WIDTH, 0:3]
    wanted = (y * 3 + x + c * 7) % 256 if bits == 8 else (y * 900 + x * 5 + c * 7) % 65536
    assert spec.format == f"uint{bits}" and spec.nchannels == 3
    assert (pixels == wanted).all()


def test_png_metadata(samples):
    spec, _ = read(samples / "8-fast.png", "uint8")
    assert spec.getattribute("stratus:scene") == SCENE
    assert spec.getattribute("oiio:ColorSpace") == "sRGB"
    assert spec.getattribute("Software") == "stratus test"
    parts = list(chunks(samples / "8-fast.png"))
    names = [name for name, _ in parts]
    assert "sRGB" in names and "tIME" not in names
    assert [text for name, text in parts if name == "iTXt"][:2] == [
        b"stratus:scene\0\0\0\0\0" + SCENE.encode(),
        b"stratus:exposure_ev\0\0\0\0\0-1.5000",
    ]


@pytest.mark.parametrize("compression", ["none", "rle", "zip", "piz", "dwaa"])
@pytest.mark.parametrize("kind", ["auto", "half", "float"])
def test_exr_values(samples, kind, compression):
    spec, pixels = read(samples / f"{kind}-{compression}.exr", "float")
    assert spec.getattribute("compression").split(":")[0] == compression
    names = list(spec.channelnames)
    assert sorted(names) == sorted(sum(CHANNELS.values(), []))
    y, x = numpy.mgrid[0:HEIGHT, 0:WIDTH]
    for index, layer in enumerate(LAYERS):
        for component, name in enumerate(CHANNELS[layer]):
            wanted = index * 100 + y + x / 64 + component * 0.25
            if name == "sun_direct.G":
                wanted[0, 0] = 65504 if kind == "half" else 1.6e6
            found = pixels[:, :, names.index(name)]
            if compression == "dwaa":  # lossy by design; large single values disturb their block
                assert abs(found[40:] - wanted[40:]).max() < 0.02 * wanted.max()
            elif kind == "float":
                assert numpy.array_equal(found, wanted.astype(numpy.float32))
            else:
                assert abs(found / numpy.maximum(wanted, 1e-6) - 1)[1:].max() < 2**-11


def channel_types(spec):
    kinds = spec.channelformats or [spec.format] * spec.nchannels
    return {name: str(kind) for name, kind in zip(spec.channelnames, kinds)}


def test_exr_types(samples):
    def types(kind):
        return channel_types(read(samples / f"{kind}-zip.exr", "float")[0])

    assert set(types("float").values()) == {"float"}
    assert set(types("half").values()) == {"half"}
    automatic = types("auto")
    assert automatic.pop("sun_direct.G") == "float"
    assert set(automatic.values()) == {"half"}


def test_dark_channels_are_float(samples):
    spec, values = read(samples / "dark.exr", "float")
    types = channel_types(spec)
    assert {types[name] for name in "RGB"} == {"float"}
    assert {types[name] for name in ("sky.R", "sky.G", "sky.B", "air.R", "air.G", "air.B")} == {"half"}
    place = numpy.arange(3 * WIDTH * HEIGHT).reshape(HEIGHT, WIDTH, 3)
    wanted = 1e-5 * (1 + 0.001 * (place % 7919))
    found = values[:, :, [spec.channelnames.index(name) for name in "RGB"]]
    assert abs(found / wanted - 1).max() < 1e-6


def test_exr_clamping_is_said(samples):
    assert read(samples / "half-zip.exr", "float")[0].getattribute("stratus:clamped_to") == 65504
    assert read(samples / "auto-zip.exr", "float")[0].getattribute("stratus:clamped_to") is None


def test_exr_metadata(samples):
    spec, _ = read(samples / "auto-zip.exr", "float")
    assert spec.getattribute("stratus:scene") == SCENE
    assert spec.getattribute("chromaticities") == pytest.approx((0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290))
    assert spec.getattribute("whiteLuminance") == 1000
    assert spec.getattribute("software") == "stratus test"
    assert spec.getattribute("stratus:exposure_ev") == -1.5
    assert spec.getattribute("stratus:global_illuminance_lux") == 80000
    assert spec.getattribute("DateTime") is None
    assert spec.tile_width == 0
    assert spec.getattribute("screenWindowWidth") == pytest.approx(2 * math.tan(math.radians(30)) * WIDTH / HEIGHT)
    assert b"capDate" not in (samples / "auto-zip.exr").read_bytes()


def test_world_to_camera(samples):
    """Camera of the samples: at 100 m east, 2 m up, azimuth 140, elevation 20, rolled 30 degrees."""
    matrix = numpy.array(read(samples / "auto-zip.exr", "float")[0].getattribute("worldToCamera")).reshape(4, 4)
    azimuth, elevation, roll = numpy.radians([140, 20, 30])

    def camera(east, north, up):  # a point, as the file's axes have it, in camera space
        return (numpy.array([east, up, -north, 1]) @ matrix)[:3]

    assert camera(100, 0, 2) == pytest.approx([0, 0, 0], abs=1e-4)
    ahead = numpy.array([math.sin(azimuth) * math.cos(elevation), math.cos(azimuth) * math.cos(elevation), math.sin(elevation)])
    assert camera(*(ahead * 10 + [100, 0, 2])) == pytest.approx([0, 0, 10], abs=1e-4)
    right = numpy.array([math.cos(azimuth), -math.sin(azimuth), 0])
    # The picture turns clockwise: what lay to the right sinks.
    assert camera(*(right + [100, 0, 2])) == pytest.approx([math.cos(roll), -math.sin(roll), 0], abs=1e-4)
    assert numpy.linalg.det(matrix[:3, :3]) == pytest.approx(-1, abs=1e-5)  # left-handed, from a right-handed world


def test_world_to_picture(samples):
    """Where points appear: the middle ahead, and half the vertical field of view of 60 degrees above it at the upper edge."""
    matrix = numpy.array(read(samples / "auto-zip.exr", "float")[0].getattribute("worldToNDC")).reshape(4, 4)
    azimuth, elevation, roll = numpy.radians([140, 20, 30])
    ahead = numpy.array([math.sin(azimuth) * math.cos(elevation), math.cos(azimuth) * math.cos(elevation), math.sin(elevation)])
    level_up = numpy.array([-math.sin(azimuth) * math.sin(elevation), -math.cos(azimuth) * math.sin(elevation), math.cos(elevation)])
    level_right = numpy.array([math.cos(azimuth), -math.sin(azimuth), 0])
    up = math.cos(roll) * level_up - math.sin(roll) * level_right
    right = math.cos(roll) * level_right + math.sin(roll) * level_up

    def picture(direction):
        east, north, height = 50 * direction + [100, 0, 2]
        point = numpy.array([east, height, -north, 1]) @ matrix
        return point[:2] / point[3]

    half = math.tan(math.radians(30))
    assert picture(ahead) == pytest.approx([0.5, 0.5], abs=1e-5)
    assert picture(ahead + half * up) == pytest.approx([0.5, 0], abs=1e-5)
    assert picture(ahead + half * WIDTH / HEIGHT * right) == pytest.approx([1, 0.5], abs=1e-5)


@pytest.mark.parametrize("name, meaning", [("equirectangular", "LatLong Environment"), ("cubemap", "CubeFace Environment"), ("fisheye", None)])
def test_panoramas(samples, name, meaning):
    spec, _ = read(samples / f"{name}.exr", "float")
    assert spec.getattribute("textureformat") == meaning
    assert spec.getattribute("worldToCamera") is None and spec.getattribute("worldToNDC") is None
    assert spec.tile_width == 0


def test_a_face_is_a_camera(samples):
    """Face +Z looks south with west on the right: camera space has x = -X, y = Y, z = Z of the file's world."""
    spec, _ = read(samples / "face.exr", "float")
    assert spec.getattribute("textureformat") is None
    matrix = numpy.array(spec.getattribute("worldToCamera")).reshape(4, 4)
    assert matrix[:3, :3] == pytest.approx(numpy.diag([-1, 1, 1]))
    assert spec.getattribute("screenWindowWidth") == pytest.approx(2 * WIDTH / HEIGHT)
