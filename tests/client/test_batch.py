"""stratus batch: retries, what is kept, what is told."""
import json
import os
import signal
import subprocess
import threading
import time

import pytest

from conftest import BUILD, PICTURE


def manifest(folder):
    return [json.loads(line) for line in (folder / "manifest.jsonl").read_text().splitlines()]


def scenes(path, *lines):
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    return path


def suns(path, count):
    return scenes(path, *({"sun": {"elevation_deg": n}} for n in range(count)))


def test_pictures_and_manifest(service, stratus, tmp_path):
    done = stratus(service, "batch", suns(tmp_path / "s", 7), "-o", tmp_path / "out", "--at-once", "3")
    assert done.returncode == 0, done.stderr
    names = [f"{n:06d}" for n in range(1, 8)]
    assert sorted(os.listdir(tmp_path / "out")) == [name + ".png" for name in names] + ["manifest.jsonl"]
    lines = manifest(tmp_path / "out")
    assert [line["name"] for line in lines] == names
    assert [line["scene"] for line in lines] == [{"sun": {"elevation_deg": n}} for n in range(7)]
    assert all(line["file"] == line["name"] + ".png" and line["bytes"] == len(PICTURE) and line["stages_ms"] == {"view": 2.5, "total": 4} for line in lines)
    assert (tmp_path / "out" / "000003.png").read_bytes() == PICTURE
    assert len(service.asked) == 7
    assert "7 pictures made" in done.stderr


def test_what_was_made_is_kept(service, stratus, tmp_path):
    folder = tmp_path / "out"
    stratus(service, "batch", suns(tmp_path / "s", 5), "-o", folder)
    (folder / "000002.png").unlink()
    (folder / "000004.png").write_bytes(b"cut")
    del service.asked[:]
    scenes(tmp_path / "s", *({"sun": {"elevation_deg": 9 if n == 2 else n}} for n in range(6)))
    done = stratus(service, "batch", tmp_path / "s", "-o", folder, "--at-once", "1")
    assert done.returncode == 0 and "3 kept" not in done.stderr and "2 kept" in done.stderr
    assert [body["sun"]["elevation_deg"] for body in service.bodies()] == [1, 9, 3, 5]
    assert len(manifest(folder)) == 6
    del service.asked[:]
    assert stratus(service, "batch", tmp_path / "s", "-o", folder, "-q").stderr == "" and not service.asked
    stratus(service, "batch", tmp_path / "s", "-o", folder, "--anew")
    assert len(service.asked) == 6


def test_a_manifest_that_was_cut_is_read(service, stratus, tmp_path):
    folder = tmp_path / "out"
    stratus(service, "batch", suns(tmp_path / "s", 3), "-o", folder)
    text = (folder / "manifest.jsonl").read_text()
    (folder / "manifest.jsonl").write_text(text[:-20])
    del service.asked[:]
    assert stratus(service, "batch", tmp_path / "s", "-o", folder).returncode == 0
    assert [body["sun"]["elevation_deg"] for body in service.bodies()] == [2]
    assert [line["name"] for line in manifest(folder)] == ["000001", "000002", "000003"]


@pytest.mark.parametrize("status", [503, 429])
def test_a_busy_daemon_is_asked_again_not_before_it_says(service, stratus, tmp_path, status):
    times = []

    def reply(handler, number, body):
        times.append(time.monotonic())
        handler.problem(status, [("Retry-After", "1")]) if number == 0 else handler.picture()

    service.reply = reply
    done = stratus(service, "batch", suns(tmp_path / "s", 1), "-o", tmp_path / "out")
    assert done.returncode == 0 and "1 retries" in done.stderr
    assert len(times) == 2 and times[1] - times[0] >= 0.95


def test_a_daemon_that_stays_busy_is_given_up(service, stratus, tmp_path):
    service.reply = lambda handler, *_: handler.problem(503, title="Busy")
    done = stratus(service, "batch", suns(tmp_path / "s", 1), "-o", tmp_path / "out", "--retries", "2")
    assert done.returncode == 1 and len(service.asked) == 3
    assert manifest(tmp_path / "out")[0]["error"] == {"status": 503, "title": "Busy"}
    service.reply = lambda handler, *_: handler.picture()
    assert stratus(service, "batch", tmp_path / "s", "-o", tmp_path / "out").returncode == 0
    assert "error" not in manifest(tmp_path / "out")[0]


def test_a_refused_scene_costs_no_other(service, stratus, tmp_path):
    errors = [{"pointer": "/sun/elevation_deg", "detail": "must be from -18 to 90"}]

    def reply(handler, number, body):
        handler.problem(422, title="Wrong", errors=errors) if body["sun"]["elevation_deg"] == 1 else handler.picture()

    service.reply = reply
    done = stratus(service, "batch", suns(tmp_path / "s", 4), "-o", tmp_path / "out")
    assert done.returncode == 1 and "000002: stratus: the server answers 422 Wrong" in done.stderr and "/sun/elevation_deg" in done.stderr
    assert [line.get("error", {}).get("errors") for line in manifest(tmp_path / "out")] == [None, errors, None, None]
    assert not (tmp_path / "out" / "000002.png").exists()


def test_a_key_that_is_wrong_ends_it(service, stratus, tmp_path):
    service.reply = lambda handler, *_: handler.problem(401)
    assert stratus(service, "batch", suns(tmp_path / "s", 50), "-o", tmp_path / "out", "--at-once", "2").returncode == 1
    assert len(service.asked) <= 4


def test_an_interrupted_batch_goes_on(service, stratus, tmp_path):
    def reply(handler, number, body):
        if number >= 6:
            handler.server.hold.wait(60)
        handler.picture()

    service.hold = threading.Event()
    service.reply = reply
    command = [BUILD / "stratus", "batch", suns(tmp_path / "s", 20), "-o", tmp_path / "out", "--at-once", "2", "--server", service.url]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 60
    # Six are answered; the places they leave are filled by two that wait.
    while len(service.asked) < 8 and time.monotonic() < until:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, text = process.communicate(timeout=60)
    assert process.returncode == 130 and "goes on" in text
    assert len(manifest(tmp_path / "out")) == 6
    assert len(os.listdir(tmp_path / "out")) == 7
    service.hold.set()
    service.reply = lambda handler, *_: handler.picture()
    del service.asked[:]
    assert stratus(service, "batch", tmp_path / "s", "-o", tmp_path / "out").returncode == 0
    assert sorted(body["sun"]["elevation_deg"] for body in service.bodies()) == list(range(6, 20))


def test_as_many_at_once_as_was_said(service, stratus, tmp_path):
    service.now = service.most = 0
    together = threading.Barrier(5)

    def reply(handler, number, body):
        with service.lock:
            service.now += 1
            service.most = max(service.most, service.now)
        together.wait(60)  # none is answered before five have come
        with service.lock:
            service.now -= 1
        handler.picture()

    service.reply = reply
    assert stratus(service, "batch", suns(tmp_path / "s", 30), "-o", tmp_path / "out", "--at-once", "5").returncode == 0
    assert service.most == 5


def test_named_lines_bases_and_changes(service, stratus, tmp_path):
    lines = scenes(tmp_path / "s", {"name": "low", "scene": {"sun": {"elevation_deg": 3}}, "labels": {"kind": 1}}, {"camera": {"azimuth_deg": 5}})

    def reply(handler, number, body):
        if body is None:
            preset = {"sun": {"elevation_deg": 60, "azimuth_deg": 10}}
            handler.answer(200, "application/json", json.dumps({"presets": [{"name": "noon", "scene": preset}]}).encode())
        else:
            handler.picture()

    service.reply = reply
    done = stratus(service, "batch", lines, "-o", tmp_path / "out", "--preset", "noon", "--set", "camera.azimuth_deg=7", "--format", "exr")
    assert done.returncode == 0, done.stderr
    low, second = manifest(tmp_path / "out")
    common = {"camera": {"azimuth_deg": 7}, "output": {"format": "exr"}}
    assert (low["name"], low["file"], low["labels"]) == ("low", "low.exr", {"kind": 1})
    assert low["scene"] == {"sun": {"elevation_deg": 3, "azimuth_deg": 10}, **common}
    assert second["name"] == "000002" and second["scene"] == {"sun": {"elevation_deg": 60, "azimuth_deg": 10}, **common}


def test_drawn_scenes_are_their_labels_and_come_again(service, stratus, tmp_path):
    vary = ["--vary", "sun.elevation_deg=5.0..60.0", "--vary", "clouds.seed=1..3", "--vary", "clouds.type=stratus,altocumulus"]
    for name, count in (("a", "60"), ("b", "20")):
        assert stratus(service, "batch", "--count", count, *vary, "-o", tmp_path / name, "--at-once", "20").returncode == 0
    lines = manifest(tmp_path / "a")
    labels = [line["labels"] for line in lines]
    assert all(5 <= one["sun.elevation_deg"] < 60 and one["clouds.seed"] in (1, 2, 3) for one in labels)
    assert {one["clouds.type"] for one in labels} == {"stratus", "altocumulus"} and {one["clouds.seed"] for one in labels} == {1, 2, 3}
    assert len({one["sun.elevation_deg"] for one in labels}) == 60
    for line in lines:
        assert line["scene"] == {"sun": {"elevation_deg": line["labels"]["sun.elevation_deg"]}, "clouds": {k: line["labels"]["clouds." + k] for k in ("seed", "type")}}
    assert [line["scene"] for line in manifest(tmp_path / "b")] == [line["scene"] for line in lines[:20]]
    sent = sorted(json.dumps(body, sort_keys=True) for body in service.bodies()[:60])
    assert sent == sorted(json.dumps(line["scene"], sort_keys=True) for line in lines)


@pytest.mark.parametrize(
    "lines, words",
    [("{", "line 1"), ("[]", "JSON object"), ('{"name": "a/b", "scene": {}}', "name"), ('{"scene": 1}', "objects"), ("", "no scene"),
     ('{"scene": {}, "more": 1}', "nothing else"), ('{"name": "a", "scene": {}}\n{"name": "a", "scene": {}}', "line 2")],
)  # fmt: skip
def test_a_line_that_is_wrong_is_named_before_anything_is_asked(service, stratus, tmp_path, lines, words):
    (tmp_path / "s").write_text(lines)
    done = stratus(service, "batch", tmp_path / "s", "-o", tmp_path / "out")
    assert done.returncode == 2 and words in done.stderr
    assert not service.asked and not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "options",
    [["x.jsonl"], ["-o", "out"], ["x.jsonl", "-o", "out", "--count", "3", "--vary", "a.b=1..2"], ["-o", "out", "--count", "3"],
     ["-o", "out", "--count", "3", "--vary", "a.b"], ["-o", "out", "--count", "3", "--vary", "a.b=2..1"], ["-o", "out", "--count", "3", "--vary", "a.b=x..1"],
     ["/nonexistent", "-o", "out"], ["-o", "out", "--count", "0"], ["-o", "out", "--at-once", "0"], ["-o", "out", "--count", "1.5"]],
)  # fmt: skip
def test_usage(service, stratus, tmp_path, options):
    assert stratus(service, "batch", *options, cwd=tmp_path).returncode == 2
    assert not service.asked and os.listdir(tmp_path) == []


def test_where_nothing_can_be_written(service, stratus, tmp_path):
    (tmp_path / "file").write_text("")
    assert stratus(service, "batch", suns(tmp_path / "s", 1), "-o", tmp_path / "file").returncode == 4
    assert stratus(service, "batch", tmp_path / "s", "-o", tmp_path / "no" / "where").returncode == 4
    assert stratus(None, "batch", tmp_path / "s", "-o", tmp_path / "out", "--retries", "0").returncode == 3


def test_the_daemon_fills_a_folder(real_daemon, stratus, tmp_path):
    size = ["--set", "output.width=32", "--set", "output.height=32", "--set", "clouds.resolution=64"]
    done = stratus(real_daemon, "batch", "--count", "6", "--vary", "sun.elevation_deg=5.0..60.0", *size, "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    for line in manifest(tmp_path / "out"):
        told = stratus(None, "info", "--scene", tmp_path / "out" / line["file"])
        assert json.loads(told.stdout)["sun"]["elevation_deg"] == pytest.approx(line["labels"]["sun.elevation_deg"], abs=1e-4)
        assert line["stages_ms"]["total"] > 0
