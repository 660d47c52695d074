"""Statistics of images that mean something."""
import math

import numpy
import pytest


def exr(scene, width=96, height=64, layers=("color",)):
    return {**scene, "output": {"width": width, "height": height, "format": "exr", "exr_type": "float", "layers": list(layers)}}


def color(pixels, spec, layer="color"):
    prefix = "" if layer == "color" else layer + "."
    names = list(spec.channelnames)
    return pixels[..., [names.index(prefix + c) for c in "RGB"]]


def pixel_of(camera, width, height, azimuth, elevation):
    """Where a direction appears: (column, row), by the perspective projection of a camera without roll."""
    a, e, ca, ce = (math.radians(x) for x in (azimuth, elevation, camera["azimuth_deg"], camera["elevation_deg"]))
    direction = numpy.array([math.sin(a) * math.cos(e), math.cos(a) * math.cos(e), math.sin(e)])
    forward = numpy.array([math.sin(ca) * math.cos(ce), math.cos(ca) * math.cos(ce), math.sin(ce)])
    right = numpy.array([math.cos(ca), -math.sin(ca), 0])
    up = numpy.cross(right, forward)
    depth, half = direction @ forward, math.tan(math.radians(camera["vertical_fov_deg"]) / 2)
    x, y = direction @ right / depth / half * height / width, direction @ up / depth / half
    return (x + 1) / 2 * width - 0.5, (1 - y) / 2 * height - 0.5


@pytest.mark.parametrize("sun", [(35, 140), (20, 155), (48, 128)])
def test_the_sun_is_where_it_should_be(daemon, read_image, sun):
    camera = {"azimuth_deg": 141, "elevation_deg": 32, "vertical_fov_deg": 40}
    scene = {"sun": {"elevation_deg": sun[0], "azimuth_deg": sun[1]}, "clouds": {"type": "none"}, "camera": camera}
    pixels, spec = read_image(daemon.render(exr(scene, 192, 144)).body)
    luminance = color(pixels, spec) @ [0.2126, 0.7152, 0.0722]
    row, column = numpy.unravel_index(luminance.argmax(), luminance.shape)
    x, y = pixel_of(camera, 192, 144, sun[1], sun[0])
    assert math.hypot(column - x, row - y) <= 2


def mean_luminance(pixels, spec):
    return float((color(pixels, spec) @ [0.2126, 0.7152, 0.0722]).mean())


def base_brightness(daemon, read_image, ground, radiosity):
    scene = {
        "clouds": {"type": "stratus", "coverage": 1, "thickness_m": 300},
        "ground": {"type": ground},
        "camera": {"elevation_deg": 60},
        "radiosity": {"enabled": radiosity},
    }
    return mean_luminance(*read_image(daemon.render(exr(scene)).body))


def test_radiosity_over_snow_brightens_the_base(daemon, read_image):
    on, off = (base_brightness(daemon, read_image, "snow", radiosity) for radiosity in (True, False))
    assert on > 1.02 * off
    assert base_brightness(daemon, read_image, "snow", True) > 1.1 * base_brightness(daemon, read_image, "black", True)


PARTS = ["sun_direct", "order0", "order1", "order2", "multiple", "cloud_sky", "cloud_ground", "sky", "ground", "air"]


@pytest.mark.parametrize(
    "camera",
    [
        {"elevation_deg": 15},
        {"azimuth_deg": 140, "elevation_deg": 35},
        {"position_m": [0, 0, 4000], "elevation_deg": -20},
    ],
    ids=["below", "sunwards", "above"],
)
def test_layers_add_up_to_color(daemon, read_image, camera):
    pixels, spec = read_image(daemon.render(exr({"camera": camera}, layers=["color"] + PARTS)).body)
    total = sum(color(pixels, spec, part).astype(numpy.float64) for part in PARTS)
    whole = color(pixels, spec)
    assert numpy.all(numpy.isfinite(pixels))
    # A saturated colour of a single layer may lie just outside Rec.709.
    assert all(color(pixels, spec, part).min() >= -1e-3 * whole.mean() for part in PARTS)
    assert numpy.allclose(total, whole, rtol=1e-3, atol=1e-5 * whole.max())


def test_mirrored_camera_mirrored_image(daemon, read_image):
    scene = {"sun": {"elevation_deg": 35, "azimuth_deg": 140}, "clouds": {"type": "none"}, "ground": {"type": "black"}}
    images = []
    for azimuth in (140 - 50, 140 + 50):
        camera = {"azimuth_deg": azimuth, "elevation_deg": 20}
        images.append(color(*read_image(daemon.render(exr({**scene, "camera": camera})).body)))
    assert numpy.allclose(images[0], images[1][:, ::-1], rtol=5e-3, atol=1e-4)
    assert not numpy.allclose(images[0], images[1], rtol=5e-3, atol=1e-4)


def test_the_sky_is_blue_and_brighter_at_the_sun(daemon, read_image):
    scene = {"clouds": {"type": "none"}, "camera": {"azimuth_deg": 320, "elevation_deg": 50}}
    away = color(*read_image(daemon.render(exr(scene)).body)).mean(axis=(0, 1))
    scene["camera"] = {"azimuth_deg": 165, "elevation_deg": 50}
    near = color(*read_image(daemon.render(exr(scene)).body)).mean(axis=(0, 1))
    assert away[2] > away[1] > away[0] > 0
    assert near.sum() > away.sum()


def test_default_picture_is_neither_black_nor_white(daemon, read_image):
    pixels, _ = read_image(daemon.render({"output": {"width": 256, "height": 192}}).body)
    assert 0.15 < pixels.mean() < 0.85
    assert pixels.std() > 0.03
    assert (pixels >= 0.999).mean() < 0.2


def test_sixteen_bits(daemon, read_image):
    scene = {"output": {"width": 64, "height": 48, "bits": 16}}
    pixels, spec = read_image(daemon.render(scene).body)
    assert str(spec.format) == "uint16"
    assert pixels.shape == (48, 64, 3)


def test_exr_types(daemon, read_image):
    for kind in ("half", "float"):
        scene = {"output": {"width": 32, "height": 16, "format": "exr", "exr_type": kind}, "clouds": {"type": "none"}}
        _, spec = read_image(daemon.render(scene).body)
        assert str(spec.format) == kind


@pytest.mark.parametrize("compression", ["none", "rle", "zip", "piz", "dwaa"])
def test_exr_compressions(daemon, read_image, compression):
    scene = {"output": {"width": 64, "height": 48, "format": "exr", "exr_compression": compression}}
    _, spec = read_image(daemon.render(scene).body)
    assert spec.getattribute("compression").startswith(compression)


def test_exposure(daemon, read_image):
    means = []
    for exposure in (-2, 0, 2):
        scene = {"output": {"width": 64, "height": 48, "exposure_ev": exposure - 3, "tone": "linear"}}
        means.append(read_image(daemon.render(scene).body)[0].mean())
    assert means[0] < means[1] < means[2]


def test_png_says_its_exposure(daemon, read_image):
    small = {"width": 64, "height": 48}
    _, png = read_image(daemon.render({"output": small}).body)
    _, exr = read_image(daemon.render({"output": {**small, "format": "exr"}}).body)
    automatic = float(png.getattribute("stratus:exposure_ev"))
    assert automatic == pytest.approx(exr.getattribute("stratus:exposure_ev"), abs=1e-3)
    said = daemon.render({"output": {**small, "exposure_ev": round(automatic, 4)}})
    assert (read_image(said.body)[0] == read_image(daemon.render({"output": small}).body)[0]).mean() > 0.99
