"""The Python package: its classes against openapi.yaml, its pictures against another reader, its errors, its documentation by running it."""
import csv
import html
import itertools
import json
import os
import re
import subprocess
import sys
import threading
import time
import typing

import numpy
import OpenImageIO as oiio
import pytest
import yaml

from conftest import PICTURE, ROOT

PACKAGE = ROOT / "clients" / "python"
sys.path.insert(0, str(PACKAGE))
import stratus as package  # noqa: E402  (the fixture of the command line has the name)

SECTIONS = yaml.safe_load((ROOT / "openapi.yaml").read_text())["components"]["schemas"]["Scene"]["properties"]
SMALL = {"output": {"width": 48, "height": 32}, "clouds": {"resolution": 64}}


@pytest.fixture
def client(real_daemon):
    return package.Client(real_daemon.url, timeout_s=300)


# --- classes ---------------------------------------------------------------------------------------------------------------------------------


def test_classes_are_made_of_the_schema():
    done = subprocess.run(["/usr/bin/python3", PACKAGE / "generate.py", "--check"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("section", SECTIONS)
def test_members_ranges_and_defaults(section):
    """Apart from the generator, by what the classes are."""
    owner = type(getattr(package.Scene(), section))
    hints = typing.get_type_hints(owner)
    assert set(hints) == set(SECTIONS[section]["properties"])
    for name, schema in SECTIONS[section]["properties"].items():
        ranges = [(one["minimum"], one["maximum"]) for one in (schema, *schema.get("oneOf", []), *schema.get("prefixItems", []), schema.get("items", {})) if "minimum" in one]
        wanted = None if not ranges else ranges if "prefixItems" in schema else ranges[0]
        assert package.limits(f"{section}.{name}") == wanted
        field = next(field for field in owner.__dataclass_fields__.values() if field.name == name)
        assert field.metadata["default"] == schema.get("default") and getattr(owner(), name) is None
        parts = [part for part in typing.get_args(hints[name]) if part is not type(None)]
        if "enum" in schema:
            assert list(typing.get_args(parts[0])) == schema["enum"] if len(parts) == 1 else parts == schema["enum"]
        plain = {"number": float, "integer": int, "string": str, "boolean": bool}.get(schema.get("type"))
        if plain and "enum" not in schema:
            assert parts == [plain]


def test_scenes_hold_what_was_set():
    scene = package.Scene(sun=package.Sun(elevation_deg=numpy.float32(4.5)), camera=package.Camera(position_m=(0, 0, numpy.int64(9))))
    scene.set("clouds.wind_mps", numpy.array([1.5, 2]))
    wanted = {"sun": {"elevation_deg": 4.5}, "clouds": {"wind_mps": [1.5, 2]}, "camera": {"position_m": [0, 0, 9]}}
    assert scene.to_json() == wanted and package.Scene.from_json(wanted).to_json() == wanted
    assert package.Scene().to_json() == {}
    with pytest.raises(AttributeError):
        scene.sun.elevation = 3
    with pytest.raises(AttributeError):
        scene.set("sun.elevation", 3)
    with pytest.raises(ValueError, match="moon"):
        package.Scene.from_json({"moon": {}})
    with pytest.raises(TypeError):
        package.Sun(elevation=3)


# --- pictures --------------------------------------------------------------------------------------------------------------------------------


def by_oiio(path, kind):
    image = oiio.ImageInput.open(str(path))
    return numpy.array(image.read_image(kind)), list(image.spec().channelnames)


@pytest.mark.parametrize("bits", [8, 16])
def test_png_as_another_reader_sees_it(client, tmp_path, bits):
    picture = client.render({**SMALL, "output": {"width": 50, "height": 33, "bits": bits}})
    wanted, _ = by_oiio(picture.save(tmp_path / "a.png"), f"uint{bits}")
    assert picture.array.dtype == numpy.dtype(f"uint{bits}") and numpy.array_equal(picture.array, wanted)
    assert numpy.asarray(picture).shape == (33, 50, 3) and not picture.is_exr
    assert os.listdir(tmp_path) == ["a.png"]


def test_exr_and_its_layers(client, tmp_path):
    picture = client.render({**SMALL, "output": {"width": 48, "height": 32, "format": "exr", "layers": ["color", "order1", "distance"], "exr_type": "float"}})
    wanted, names = by_oiio(picture.save(tmp_path / "a.exr"), "float")
    assert set(picture.layers) == {"color", "order1", "distance"} and picture.array.dtype == numpy.float32
    assert numpy.array_equal(picture.array, wanted[..., [names.index(name) for name in "RGB"]])
    assert numpy.array_equal(picture.layers["distance"], wanted[..., names.index("distance.Z")])


@pytest.mark.parametrize("extension", ["png", "exr"])
def test_a_picture_is_made_again_from_itself(client, extension):
    picture = client.render({**SMALL, "output": {**SMALL["output"], "format": extension}, "sun": {"elevation_deg": 9}})
    assert picture.scene.sun.elevation_deg == 9 and picture.scene.clouds.resolution == 64
    assert client.render(picture.scene).data == picture.data
    assert picture.timings_ms["total"] > 0 and {"view", "encode"} <= set(picture.timings_ms) and picture.seconds > 0 and picture.etag


def test_rows_of_other_filters():
    from stratus import images

    rows = numpy.array([[0, 1, 2, 3, 4, 5, 6], [2, 1, 1, 1, 1, 1, 255], [1, 1, 2, 3, 250, 5, 6]], numpy.uint8)
    assert images.unfilter(rows, 3).reshape(3, 6).tolist() == [[1, 2, 3, 4, 5, 6], [2, 3, 4, 5, 6, 5], [1, 2, 3, 251, 7, 9]]
    with pytest.raises(ValueError, match="another library"):
        images.unfilter(numpy.array([[4, 1, 2, 3]], numpy.uint8), 3)
    with pytest.raises(ValueError, match="another library"):
        images.read_png(images.PNG)


def test_timings_are_read_as_the_standard_has_them():
    from stratus.picture import read_timings

    header = 'queue;dur=0.5, optics;desc="a, b;dur=9";dur=1.25,view ; dur = 2;x, note;desc=z, view;dur=7'
    assert read_timings(header) == {"queue": 0.5, "optics": 1.25, "view": 2.0}
    assert read_timings("") == {}


# --- asking ----------------------------------------------------------------------------------------------------------------------------------


def test_every_wrong_member_is_named(client):
    with pytest.raises(package.InvalidScene) as caught:
        client.render({"sun": {"elevation_deg": 100}, "moon": 1})
    assert caught.value.status == 422 and sorted(caught.value.pointers) == ["/moon", "/sun/elevation_deg"]
    assert "/sun/elevation_deg: must be from -18 to 90" in str(caught.value)


def test_other_calls(client):
    scene = package.Scene(dsd=package.Dsd(effective_radius_um=12), sun=package.Sun(elevation_deg=5))
    assert client.optics(scene)["extinction_per_m"] != client.optics()["extinction_per_m"]
    assert len(client.slab(scene, optical_thickness=8, view_zenith_deg=[0, 30])["radiance"]["view_zenith_deg"]) == 2
    assert client.sun("2026-06-21T12:00:00Z", 48.86, 2.35)["elevation_deg"] == pytest.approx(64.5, abs=0.2)
    assert len(client.sky(scene, view_zenith_deg=[0, 30], azimuth_deg=[0])["radiance"][0]) == 2
    assert len(client.presets()) > 5 and client.ready()
    found = client.compare([{}, {"model": {"shading": "paper"}}], SMALL)
    assert [one["name"] for one in found["variants"]] == ["solved", "paper"]


def test_a_busy_daemon_is_asked_again_not_before_it_says(service):
    times = []

    def reply(handler, number, body):
        times.append(time.monotonic())
        handler.problem(503, [("Retry-After", "1")] if number else []) if number < 2 else handler.picture()

    service.reply = reply
    assert package.Client(service.url).render().data == PICTURE
    assert len(times) == 3 and times[2] - times[1] >= 0.95
    service.reply = lambda handler, *_: handler.problem(429, [("Retry-After", "7")], title="Enough")
    with pytest.raises(package.Busy) as caught:
        package.Client(service.url, retries=0).render()
    assert caught.value.retry_after_s == 7 and caught.value.status == 429


@pytest.mark.parametrize("status, kind", [(401, "Denied"), (504, "TimedOut"), (500, "Refused"), (400, "InvalidScene")])
def test_refusals_are_told_apart_and_not_repeated(service, status, kind):
    service.reply = lambda handler, *_: handler.problem(status, [("X-Request-Id", "abc")], title="No")
    with pytest.raises(package.Refused) as caught:
        package.Client(service.url, key="k", timeout_s=2).render()
    assert type(caught.value).__name__ == kind and caught.value.request_id == "abc" and len(service.asked) == 1


def test_nobody_there():
    with pytest.raises(package.Unreachable):
        package.Client("http://127.0.0.1:9", retries=0).render()
    assert not package.Client("http://127.0.0.1:9").ready()
    with pytest.raises(ValueError):
        package.Client("somewhere")


def test_a_resting_connection_that_was_closed_is_no_error(service):
    def reply(handler, number, body):
        handler.picture()
        handler.close_connection = True  # without a word of it

    service.reply = reply
    client = package.Client(service.url, retries=0)
    assert [client.render().data for _ in range(4)] == [PICTURE] * 4


def test_many_come_in_order_whoever_is_first(service):
    fifth = threading.Event()

    def reply(handler, number, body):
        if body["sun"]["elevation_deg"] == 0:
            fifth.wait(60)
        if body["sun"]["elevation_deg"] == 2:
            fifth.set()
        handler.answer(200, "image/png", str(body["sun"]["elevation_deg"]).encode())

    service.reply = reply
    endless = ({"sun": {"elevation_deg": n}} for n in itertools.count())
    pictures = package.Client(service.url).render_many(endless, at_once=3)
    assert [int(picture.data) for picture in itertools.islice(pictures, 20)] == list(range(20))
    pictures.close()
    assert len(service.asked) <= 20 + 2 * 3


def test_many_with_one_refused(service):
    service.reply = lambda handler, number, body: handler.problem(422) if body["sun"]["elevation_deg"] == 1 else handler.picture()
    scenes = [{"sun": {"elevation_deg": n}} for n in range(4)]
    found = list(package.Client(service.url).render_many(scenes, refused="yield"))
    assert [isinstance(one, package.InvalidScene) for one in found] == [False, True, False, False]
    with pytest.raises(package.InvalidScene):
        list(package.Client(service.url).render_many(scenes))


# --- what the documentation says -------------------------------------------------------------------------------------------------------------


def run_script(daemon, folder, *command):
    environment = {**os.environ, "PYTHONPATH": str(PACKAGE), "STRATUS_SERVER": daemon.url, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(["/usr/bin/python3", *map(str, command)], env=environment, cwd=folder, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("number", [0, 1])
def test_examples_of_the_documentation_run(real_daemon, tmp_path, number):
    code = re.findall(r"```python\n(.*?)```", (PACKAGE / "README.md").read_text(), re.S)
    assert len(code) == 2
    printed = run_script(real_daemon, tmp_path, "-c", code[number])
    assert number == 1 or printed.splitlines()[0] == "(240, 320, 3) uint8"


def test_the_notebook_finds_the_glory_where_theory_has_it(real_daemon, tmp_path):
    cells = json.loads((ROOT / "examples" / "skies.ipynb").read_text())["cells"]
    printed = run_script(real_daemon, tmp_path, "-c", "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"))
    rings = re.findall(r"ring at ([\d.]+) degrees in the picture, ([\d.]+) by Mie theory", printed)
    assert len(rings) == 4 and all(abs(float(seen) - float(computed)) <= 0.31 for seen, computed in rings), printed
    assert "/moon: is not a member of a scene" in printed


def test_pictures_of_the_page_are_such_as_the_daemon_draws(real_daemon):
    page = (ROOT / "examples" / "embed.html").read_text()
    sources = [html.unescape(source) for source in re.findall(r'src="([^"]+)"', page)]
    assert len(sources) == 2
    for source in sources:
        assert real_daemon.head(source.removeprefix("http://127.0.0.1:8080")).status == 200


def test_the_data_set(real_daemon, tmp_path):
    run_script(real_daemon, tmp_path, PACKAGE / "examples" / "dataset.py", "-n", "3", "-o", "skies")
    images = numpy.load(tmp_path / "skies" / "images.npy")
    with open(tmp_path / "skies" / "labels.csv", newline="") as file:
        labels = list(csv.DictReader(file))
    assert images.shape == (3, 192, 256, 3) and len(labels) == 3
    assert len({image.tobytes() for image in images}) == 3 and images.std() > 5
    assert all(2 <= float(label["sun.elevation_deg"]) <= 70 for label in labels)


