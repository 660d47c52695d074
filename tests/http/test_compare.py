"""/v1/compare: what it answers, held against the pictures themselves and against FLIP written down a second time."""
import itertools
import json
import math
import subprocess
import time

import numpy
import pytest

from conftest import BUILD, in_some_try, wait_for

SMALL = {"output": {"width": 96, "height": 64, "exr_type": "float"}}
PAPER = [{}, {"model": {"shading": "paper"}}]
LUMINANCE = [0.2126, 0.7152, 0.0722]


def compare(daemon, body, **headers):
    sent = {"Content-Type": "application/json", **{name.replace("_", "-"): value for name, value in headers.items()}}
    return daemon.request("POST", "/v1/compare", body if isinstance(body, str) else json.dumps(body), sent)


def channels(pixels, spec, *names):
    return pixels[..., [list(spec.channelnames).index(name) for name in names]]


def layer(pixels, spec, name):
    return channels(pixels, spec, *(f"{name}.{c}" for c in "RGB"))


@pytest.fixture
def small(daemon, read_image):
    """The answers of one comparison: figures, and the layers of its EXR."""
    body = {"scene": SMALL, "variants": PAPER}
    figures = compare(daemon, body)
    assert figures.status == 200
    return figures.json, *read_image(compare(daemon, body, Accept="image/x-exr").body)


def test_figures_are_those_of_the_pictures(small):
    figures, pixels, spec = small
    truth, paper = layer(pixels, spec, "solved"), layer(pixels, spec, "paper")
    assert [region["name"] for region in figures["regions"]] == ["all", "cloud", "sky", "ground"]
    assert figures["reference"] == "solved"
    masks = {name: channels(pixels, spec, f"mask.{name}.Y")[..., 0] > 0 for name in ("cloud", "sky", "ground")}
    masks["all"] = masks["cloud"] | masks["sky"] | masks["ground"]
    for region in figures["regions"]:
        mask = masks[region["name"]]
        assert region["pixels"] == mask.sum() > 0
        mean, difference = truth[mask].mean(), (paper - truth)[mask].astype(float)
        got = figures["variants"][1]["regions"][region["name"]]
        assert region["mean"] == pytest.approx(mean, rel=1e-4)
        assert got["bias"] == pytest.approx(difference.mean() / mean, rel=1e-3, abs=1e-6)
        assert got["rms"] == pytest.approx(math.sqrt((difference**2).mean()) / mean, rel=1e-3)
        assert got["noise"] == 0 and got["noise_corrected_rms"] == got["rms"]
        assert got["channel_bias"] == pytest.approx(list(difference.mean(0) / truth[mask].mean(0)), rel=1e-3, abs=1e-5)
        flip = channels(pixels, spec, "paper.flip.Y")[..., 0][mask]
        assert got["flip"] == pytest.approx({"mean": flip.mean(), "max": flip.max()}, rel=1e-4)
    assert numpy.allclose(layer(pixels, spec, "paper.difference"), paper - truth, atol=1e-6 * truth.max())


def test_pictures_are_those_of_render(daemon, read_image, small):
    figures, pixels, spec = small
    for variant in figures["variants"]:
        alone, its = read_image(daemon.get(variant["location"]).body)
        assert numpy.array_equal(channels(alone, its, "R", "G", "B"), layer(pixels, spec, variant["name"]))


def test_file_holds_the_figures_and_the_scene(small):
    figures, _, spec = small
    assert json.loads(spec.getattribute("stratus:comparison")) == figures
    assert json.loads(spec.getattribute("stratus:scene"))["model"]["shading"] == "solved"


def linear_of_srgb(codes):
    return numpy.where(codes > 0.04045, ((codes + 0.055) / 1.055) ** 2.4, codes / 12.92)


def flip_of(first, second, per_degree=0.7 * 3840 / 0.7 * math.pi / 180):
    """FLIP after the paper (Andersson et al. 2020) with its kernels in two dimensions, of sRGB pictures from 0 to 1."""
    matrix = numpy.array([[0.4123866, 0.3575916, 0.1804505], [0.2126368, 0.7151830, 0.0721802], [0.0193307, 0.1191972, 0.9503726]])
    white = matrix.sum(1)

    def filtered(plane, kernel):
        r = kernel.shape[0] // 2
        padded = numpy.pad(plane, r, mode="edge")
        out = numpy.zeros_like(plane)
        for y in range(2 * r + 1):
            for x in range(2 * r + 1):
                out += kernel[y, x] * padded[y : y + plane.shape[0], x : x + plane.shape[1]]
        return out

    def grid(r):
        return numpy.meshgrid(numpy.arange(-r, r + 1.0), numpy.arange(-r, r + 1.0))

    def contrast_kernel(terms):
        x, y = grid(math.ceil(3 * math.sqrt(0.04 / (2 * math.pi**2)) * per_degree))
        z = (x**2 + y**2) / per_degree**2
        kernel = sum(a * math.sqrt(math.pi / b) * numpy.exp(-math.pi**2 * z / b) for a, b in terms)
        return kernel / kernel.sum()

    def feature_strength(luminance, kind):
        sd = 0.5 * 0.082 * per_degree
        x, y = grid(math.ceil(3 * sd))
        kernel = (-x if kind == "edge" else x**2 / sd**2 - 1) * numpy.exp(-(x**2 + y**2) / (2 * sd**2))
        kernel = numpy.where(kernel < 0, kernel / -kernel[kernel < 0].sum(), kernel / kernel[kernel > 0].sum())
        return numpy.hypot(filtered(luminance, kernel), filtered(luminance, kernel.T))

    def lab(rgb):
        xyz = rgb @ matrix.T / white
        f = numpy.where(xyz > (6 / 29) ** 3, numpy.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
        lightness = 116 * f[..., 1] - 16
        return numpy.stack(
            [lightness, lightness * 5 * (f[..., 0] - f[..., 1]), lightness * 2 * (f[..., 1] - f[..., 2])], -1
        )

    def hyab(a, b):
        return abs(a[..., 0] - b[..., 0]) + numpy.hypot(a[..., 1] - b[..., 1], a[..., 2] - b[..., 2])

    kernels = [contrast_kernel(t) for t in ([(1, 0.0047)], [(1, 0.0053)], [(34.1, 0.04), (13.5, 0.025)])]
    seen, features = [], []
    for picture in (first, second):
        x, y, z = numpy.moveaxis(linear_of_srgb(picture) @ matrix.T / white, -1, 0)
        planes = [filtered(plane, kernel) for plane, kernel in zip([116 * y - 16, 500 * (x - y), 200 * (y - z)], kernels)]
        y2 = (planes[0] + 16) / 116
        xyz = numpy.stack([y2 + planes[1] / 500, y2, y2 - planes[2] / 200], -1) * white
        seen.append(lab(numpy.clip(xyz @ numpy.linalg.inv(matrix).T, 0, 1)))
        features.append([feature_strength(y, kind) for kind in ("edge", "point")])
    largest = hyab(lab(numpy.array([0.0, 1, 0])), lab(numpy.array([0.0, 0, 1]))) ** 0.7
    distance, knee = hyab(*seen) ** 0.7, 0.4 * largest
    colour = numpy.where(distance < knee, 0.95 / knee * distance, 0.95 + (distance - knee) / (largest - knee) * 0.05)
    feature = numpy.maximum(abs(features[0][0] - features[1][0]), abs(features[0][1] - features[1][1]))
    return colour ** (1 - numpy.sqrt(feature / math.sqrt(2)))


def cell(pixels, width, height, column, row):
    return pixels[row * height : (row + 1) * height, column * width : (column + 1) * width]


def test_side_by_side(daemon, read_image):
    """The pictures are those of /v1/render but for their dither, the maps below them those of the EXR; FLIP is FLIP."""
    scene = {"output": {"width": 96, "height": 64, "exr_type": "float", "exposure_ev": -4}}
    body = {"scene": scene, "variants": PAPER}
    answer = compare(daemon, body, Accept="image/png")
    assert answer.headers["Content-Type"] == "image/png"
    sheet, spec = read_image(answer.body)
    assert sheet.shape == (3 * 64, 2 * 96, 3)
    assert json.loads(spec.getattribute("stratus:comparison"))["reference"] == "solved"
    pictures = []
    for column, shading in enumerate(("solved", "paper")):
        alone = read_image(daemon.render({**scene, "model": {"shading": shading}}).body)[0]
        pictures.append(cell(sheet, 96, 64, column, 0))
        assert abs(alone - pictures[-1]).max() <= 2.5 / 255
    pixels, exr = read_image(compare(daemon, body, Accept="image/x-exr").body)
    flip = channels(pixels, exr, "paper.flip.Y")[..., 0]
    assert numpy.allclose(flip, flip_of(*(picture.astype(float) for picture in pictures)), atol=2e-3)
    red, blue = (cell(sheet, 96, 64, 1, 1)[..., c] for c in (0, 2))
    difference = layer(pixels, exr, "paper.difference") @ LUMINANCE / (layer(pixels, exr, "solved") @ LUMINANCE)
    assert (red > blue)[difference > 0.1].all() and (red < blue)[difference < -0.1].all()


@pytest.mark.parametrize("accept, kind", [
    (None, "application/json"), ("*/*", "application/json"), ("image/*", "image/png"), ("image/x-exr", "image/x-exr"),
    ("image/png;q=0.5, application/json", "application/json"), ("text/html, image/x-exr;q=0.1", "image/x-exr"),
])
def test_negotiation(daemon, accept, kind):
    answer = compare(daemon, {"scene": SMALL, "variants": PAPER}, **({"Accept": accept} if accept else {}))
    assert (answer.status, answer.headers["Content-Type"]) == (200, kind)
    assert answer.headers["Vary"] == "Accept" and answer.headers["Cache-Control"] == "no-store" and answer.headers["ETag"] is None


def test_nothing_acceptable(daemon):
    answer = compare(daemon, {"variants": PAPER}, Accept="text/html")
    assert answer.status == 406 and answer.headers["Vary"] == "Accept"
    assert "application/json" in answer.json["detail"] and "image" not in answer.json["title"]


def test_the_same_scene_differs_nowhere(daemon):
    answer = compare(daemon, {"scene": SMALL, "variants": [{"name": "one"}, {"name": "two"}]}).json
    for figures in answer["variants"][1]["regions"].values():
        assert figures["bias"] == figures["rms"] == figures["flip"]["max"] == 0


def test_variants_are_merge_patches(daemon):
    """null takes a member of the scene away; other sections than the model may change; the truth is the one that is named."""
    body = {
        "scene": {**SMALL, "sun": {"elevation_deg": 20}, "model": {"shading": "paper"}},
        "variants": [{}, {"name": "usual", "model": None, "sun": {"azimuth_deg": 141}}, {"name": "dark", "radiosity": {"enabled": False}}],
        "reference": "usual",
    }
    answer = compare(daemon, body).json
    assert answer["reference"] == "usual" and [variant["name"] for variant in answer["variants"]] == ["paper", "usual", "dark"]
    assert [("shading=paper" in v["location"], "azimuth_deg=141" in v["location"]) for v in answer["variants"]] == [
        (True, False), (False, True), (True, False)
    ]
    assert all("elevation_deg=20" in variant["location"] for variant in answer["variants"])


@pytest.mark.parametrize("variants, names", [
    ([{}, {"radiosity": {"enabled": False}}], ["solved", "radiosity-enabled-false"]),
    ([{"sun": {"elevation_deg": -4}}, {}], ["sun-elevation_deg--4", "solved"]),
    ([{}, {"clouds": {"coverage": 0.55}}, {"clouds": {"coverage": 0.4}, "ground": {"type": "snow"}}],
     ["solved", "clouds-coverage-0_55", "coverage-0_4-type-snow"]),
    ([{"name": "paper"}, {"model": {"shading": "paper"}}, {}], ["paper", "model-shading-paper", "solved"]),
    ([{}, {"clouds": {"type": "altocumulus", "coverage": 0.4, "thickness_m": 200, "seed": 5}}], ["solved", "type-altocumulus-and-3-more"]),
    ([{}, {"clouds": {"coverage": 0.4, "seed": 5}, "ground": {"type": "snow"}, "radiosity": {"enabled": False}}],
     ["solved", "coverage-0_4-seed-5-and-2-more"]),
    ([{"camera": {"position_m": [0, 0, 300.5]}}, {"sun": None}, {"sun": None}], ["camera-position_m-0-0-300_5", "sun-default", "sun-default-2"]),
])
def test_variants_are_named_by_what_they_change(daemon, variants, names):
    answer = compare(daemon, {"scene": {"output": {"width": 32, "height": 24}}, "variants": variants})
    assert answer.status == 200, answer.json
    assert [variant["name"] for variant in answer.json["variants"]] == names


def test_client_needs_no_names(daemon):
    done = subprocess.run(
        [str(BUILD / "stratus"), "compare", "--server", f"http://127.0.0.1:{daemon.port}", "--set", "output.width=32", "--set", "output.height=24",
         "--with", "radiosity.enabled=false"], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0 and "radiosity-enabled-false" in done.stdout, done.stderr


def test_regions(daemon):
    """Looking up from below there is no ground; a rectangle is measured by itself."""
    body = {
        "scene": {**SMALL, "camera": {"elevation_deg": 60, "vertical_fov_deg": 40}, "clouds": {"type": "stratus", "coverage": 1}},
        "variants": PAPER,
        "regions": ["ground", {"name": "corner", "rectangle": [90, 60, 6, 4]}, {"name": "whole", "rectangle": [0, 0, 96, 64]}, "all"],
    }
    answer = compare(daemon, body).json
    ground, corner, whole, everything = answer["regions"]
    figures = answer["variants"][1]["regions"]
    assert ground["pixels"] == 0 and ground["mean"] is None and figures["ground"]["rms"] is None
    assert corner["pixels"] == 24 and corner["rectangle"] == [90, 60, 6, 4]
    assert figures["whole"] == figures["all"] and whole["pixels"] == everything["pixels"]


@pytest.mark.parametrize("camera", [
    {"projection": "fisheye"}, {"projection": "cubemap"}, {"projection": "equirectangular"}, {"position_m": [0, 0, 5000], "elevation_deg": -30}
])
def test_regions_of_every_camera(daemon, camera):
    side = {"fisheye": 64, "cubemap": 32, "equirectangular": 128}.get(camera.get("projection"), 64)
    answer = compare(daemon, {"scene": {"camera": camera, "output": {"width": side}}, "variants": PAPER}).json
    pixels = {region["name"]: region["pixels"] for region in answer["regions"]}
    assert pixels["all"] == pixels["cloud"] + pixels["sky"] + pixels["ground"]
    if camera.get("projection") == "fisheye":
        assert pixels["all"] == pytest.approx(64 * 64 * math.pi / 4, rel=0.02) and pixels["ground"] == 0
    if camera.get("projection") in ("cubemap", "equirectangular"):
        assert pixels["ground"] == pytest.approx(answer["width"] * answer["height"] / 2, rel=0.02)


def test_the_disc_of_the_sun_counts_nowhere(daemon):
    scene = {"clouds": {"type": "none"}, "camera": {"azimuth_deg": 140, "elevation_deg": 35, "vertical_fov_deg": 5}, **SMALL}
    answer = compare(daemon, {"scene": scene, "variants": [{}, {"name": "hazy", "atmosphere": {"aerosol_optical_depth": 0.11}}]}).json
    region = answer["regions"][0]
    assert 96 * 64 * 0.9 < region["pixels"] < 96 * 64
    assert region["mean"] < 1000  # its disc has millions


def test_black_ground_at_night_has_no_figures(daemon):
    scene = {**SMALL, "ground": {"type": "black"}, "clouds": {"type": "none"}, "camera": {"elevation_deg": -90}}
    answer = compare(daemon, {"scene": scene, "variants": PAPER})
    assert answer.status == 200 and "NaN" not in answer.body.decode()


@pytest.mark.parametrize("body, pointers", [
    ([], {""}),
    ({}, {"/variants"}),
    ({"variants": [{}]}, {"/variants"}),
    ({"variants": [{}] * 5}, {"/variants"}),
    ({"variants": {}}, {"/variants"}),
    ({"variants": [{}, 3]}, {"/variants/1"}),
    ({"variants": PAPER, "models": []}, {"/models"}),
    ({"scene": [], "variants": PAPER}, {"/scene"}),
    ({"scene": {"sun": {"elevation_deg": 91}}, "variants": PAPER}, {"/scene/sun/elevation_deg"}),
    ({"scene": {"sun": {"elevation_deg": 91}}, "variants": [{}, {"sun": {"elevation_deg": 3}, "model": {"shading": "paper"}}]},
     {"/scene/sun/elevation_deg"}),
    ({"variants": [{}, {"model": {"shading": "none"}, "name": "x"}]}, {"/variants/1/model/shading"}),
    ({"variants": [{}, {"model": {"shading": "none"}}]}, {"/variants/1/model/shading"}),
    ({"variants": [{}, {"clouds": {"coverage": 2}}]}, {"/variants/1/clouds/coverage"}),
    ({"variants": [{}, {"moon": {}, "name": "x"}]}, {"/variants/1/moon"}),
    ({"scene": {"name": "x"}, "variants": [{}, {"name": "y", "model": {"shading": "paper"}}]}, {"/scene/name"}),
    ({"variants": [{}, {"clouds": {"base_m": 1}, "camera": {"position_m": [0, 0, -1]}, "name": "x"}]},
     {"/variants/1/clouds/base_m", "/variants/1/camera/position_m/2"}),
    ({"scene": {"camera": {"position_m": [0, 0, 300]}}, "variants": [{}, {"clouds": {"base_m": 200}, "name": "x"}]},
     {"/scene/camera/position_m/2"}),
    ({"variants": [{}, {}]}, {"/variants/1/name"}),
    ({"variants": [{"name": "one"}, {"name": "one", "model": {"shading": "paper"}}]}, {"/variants/1/name"}),
    ({"variants": [{"name": "solved", "sun": {"elevation_deg": 3}}, {}]}, {"/variants/1/name"}),
    ({"variants": [{"name": ""}, {"name": "a.b"}]}, {"/variants/0/name", "/variants/1/name"}),
    ({"variants": [{}, {"name": "x", "output": {"width": 64}}]}, {"/variants/1/output"}),
    ({"variants": [{}, {"name": "x", "camera": {"projection": "fisheye"}}]}, {"/variants/1/camera"}),
    ({"variants": PAPER, "reference": "truth"}, {"/reference"}),
    ({"variants": PAPER, "regions": []}, {"/regions"}),
    ({"variants": PAPER, "regions": ["sea"]}, {"/regions/0"}),
    ({"variants": PAPER, "regions": ["sky", "sky"]}, {"/regions/1"}),
    ({"variants": PAPER, "regions": [{"name": "x", "rectangle": [0, 0, 1025, 1]}]}, {"/regions/0/rectangle"}),
    ({"variants": PAPER, "regions": [{"rectangle": [0, 0, 1, 1], "sides": 4}]}, {"/regions/0/name", "/regions/0/sides"}),
    ({"variants": PAPER, "regions": [{"name": "all", "rectangle": [0, 0, 1, 1]}]}, {"/regions/0/name"}),
    ({"variants": PAPER, "regions": ["all", {"name": "sky", "rectangle": [0, 0, 1, 1]}]}, {"/regions/1/name"}),
    ({"scene": {"output": {"width": 4096, "height": 4096}}, "variants": PAPER}, {"/scene/output"}),
    ({"variants": [{"name": "a", "foo": None}, {}]}, {"/variants/0/foo"}),
    ({"variants": [{}, {"sun": {"foo": None, "elevation_deg": None}}]}, {"/variants/1/sun/foo"}),
    ({"variants": [{}, {"clouds": {"map": "nothing"}, "name": "x"}]}, {"/variants/1/clouds/map"}),
    ({"scene": {"clouds": {"map": "nothing"}}, "variants": PAPER}, {"/scene/clouds/map"}),
])
def test_refusals_name_their_place(daemon, body, pointers):
    before = daemon.settled('stratus_stage_duration_seconds_count{stage="view"}')
    answer = compare(daemon, body)
    assert answer.status == 422 and answer.headers["Content-Type"] == "application/problem+json"
    assert answer.pointers == pointers
    assert daemon.metric('stratus_stage_duration_seconds_count{stage="view"}') == before


def test_refusals_tell_whose_doing_they_are(daemon):
    """A member of the scene that is wrong only with what a variant changes is no fault of the scene's."""
    scene = {"camera": {"position_m": [0, 0, 300]}}
    by_variant = compare(daemon, {"scene": scene, "variants": [{}, {"clouds": {"base_m": 200}}]}).json["errors"]
    assert [error["pointer"] for error in by_variant] == ["/scene/camera/position_m/2"]
    assert by_variant[0]["detail"].endswith(", with what /variants/1 changes")
    by_scene = compare(daemon, {"scene": {**scene, "clouds": {"base_m": 200}}, "variants": [{}, {"model": {"shading": "paper"}}]}).json["errors"]
    assert [error["pointer"] for error in by_scene] == ["/scene/camera/position_m/2"] and "/variants/" not in by_scene[0]["detail"]


def test_other_refusals(daemon):
    assert compare(daemon, "{").status == 400
    assert daemon.get("/v1/compare").status == 405
    assert daemon.request("POST", "/v1/compare?x=1", "{}", {"Content-Type": "application/json"}).status == 400
    assert compare(daemon, {"variants": PAPER}, X_Timeout_Ms="soon").status == 400


def test_timing_and_metrics(daemon):
    routed = 'stratus_requests_total{route="/v1/compare",status="200"}'
    compared = 'stratus_stage_duration_seconds_count{stage="compare"}'
    before = daemon.settled(routed), daemon.metric(compared)
    answer = compare(daemon, {"scene": SMALL, "variants": PAPER})
    assert {"queue", "view", "readback", "compare", "encode", "total"} <= set(answer.timing)
    assert wait_for(lambda: (daemon.metric(routed), daemon.metric(compared)) == (before[0] + 1, before[1] + 1))


def test_deadline(daemon):
    """No machine draws 4 pictures of 4 Mpixel so fast."""
    scene = {"output": {"width": 2048, "height": 2048}, "clouds": {"seed": 77}}
    answer = compare(daemon, {"scene": scene, "variants": [{"name": n} for n in "abcd"]}, X_Timeout_Ms="1")
    assert answer.status == 504


LARGE = {"scene": {"output": {"width": 4096, "height": 1024}, "clouds": {"type": "none"}}, "variants": PAPER, "regions": ["all"]}


@pytest.fixture(scope="module")
def large(daemon):
    """What comparing and all of the rest take, ms; only the comparing can be longer than the drawing of a clear sky."""
    answer = compare(daemon, LARGE, X_Timeout_Ms="240000")
    assert answer.status == 200
    return {name: float(part["dur"]) for name, part in answer.timing.items()}


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_deadline_while_comparing(daemon, large, share):
    """Also while figures are made: the answer comes soon after the deadline."""
    deadline = large["total"] - large.get("encode", 0) - (1 - share) * large["compare"]

    def is_soon():
        began = time.monotonic()
        # The machine may be quicker or slower than before: then it is done, or it was drawing.
        assert compare(daemon, LARGE, X_Timeout_Ms=str(int(deadline))).status in (200, 504)
        return 1000 * (time.monotonic() - began) - deadline < max(300, 0.25 * large["compare"])

    assert in_some_try(is_soon)


def test_deadline_while_drawing(daemon):
    """The slab's layers of so many pixels are not drawn at one go."""
    body = {"scene": {"output": {"width": 4096, "height": 1024}, "sun": {"elevation_deg": 33.5}}, "variants": PAPER}
    whole = {name: float(part["dur"]) / 1000 for name, part in compare(daemon, body, X_Timeout_Ms="240000").timing.items()}
    undivided = sum(whole.get(name, 0) for name in ("optics", "sky", "field", "radiosity"))  # not drawn in parts
    seeds = itertools.count(5)

    def is_soon():
        other = {**body, "scene": {**body["scene"], "clouds": {"seed": next(seeds)}, "sun": {"elevation_deg": 34}}}  # nothing of it is remembered
        began = time.monotonic()
        assert compare(daemon, other, X_Timeout_Ms="200").status == 504
        return time.monotonic() - began < 0.7 + undivided + 0.25 * whole["view"]

    assert in_some_try(is_soon)


def test_leaving_while_comparing(daemon, large):
    ended = 'stratus_renders_ended_total{reason="abandoned"}'

    def ends_soon():
        before = daemon.metric(ended)
        connection = daemon.connect()
        connection.request("POST", "/v1/compare", json.dumps(LARGE), {"Content-Type": "application/json"})
        time.sleep((large["total"] - large.get("encode", 0) - 0.7 * large["compare"]) / 1000)
        connection.close()
        left = time.monotonic()
        assert wait_for(lambda: daemon.metric("stratus_requests_in_flight") == 1)
        # It may have been quicker than before, and have had its answer.
        return daemon.metric(ended) == before + 1 and time.monotonic() - left < 1 + 0.25 * large["compare"] / 1000

    assert in_some_try(ends_soon)


def test_maps_are_compared(daemon, example_map):
    body = {"scene": SMALL, "variants": [{"name": "flat", "clouds": {"type": "stratus"}}, {"name": "mapped", "clouds": {"map": example_map}}]}
    answer = compare(daemon, body)
    assert answer.status == 200 and answer.json["variants"][1]["regions"]["all"]["rms"] > 0


@pytest.fixture
def example_map(daemon):
    png = bytes.fromhex(
        "89504e470d0a1a0a0000000d4948445200000002000000010800000000d14920560000000b49444154789c6360f80f000102010042bebc680000000049454e44ae426082"
    )
    assert daemon.request("PUT", "/v1/assets/compared", png).status in (201, 204)
    yield "compared"
    daemon.request("DELETE", "/v1/assets/compared")
