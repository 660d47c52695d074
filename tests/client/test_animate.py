"""stratus animate and sun: which scenes frames are, in which order they come into a film, and what is left when one fails."""
import json
import os
import shutil
import struct
import subprocess
import threading
import zlib

import pytest

needs_ffmpeg = pytest.mark.skipif(not shutil.which("ffmpeg"), reason="ffmpeg is not installed")


def png(grey, width=34, height=18):
    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    rows = (b"\0" + bytes([grey] * 3) * width) * height
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def greys(path):
    """The grey of each frame of a film."""
    command = ["ffmpeg", "-v", "error", "-i", path, "-vf", "scale=1:1", "-f", "rawvideo", "-pix_fmt", "gray", "-"]
    return list(subprocess.run(command, capture_output=True, check=True).stdout)


def times(service):
    return sorted(body["clouds"]["time_s"] for body in service.bodies() if body)


def test_frames_of_a_folder(service, stratus, tmp_path):
    (tmp_path / "s.json").write_text('{"clouds": {"time_s": 100, "seed": 3}}')
    ramp = ["--ramp", "sun.elevation_deg=20..-4"]
    done = stratus(service, "animate", tmp_path / "s.json", "--duration", "0.5", "--fps", "10", "--speed", "30", *ramp, "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    lines = [json.loads(line) for line in (tmp_path / "out" / "manifest.jsonl").read_text().splitlines()]
    assert [line["file"] for line in lines] == [f"{n:06d}.png" for n in range(1, 6)]
    assert [line["scene"]["clouds"] for line in lines] == [{"time_s": 100 + 3 * n, "seed": 3} for n in range(5)]
    assert [line["scene"]["sun"]["elevation_deg"] for line in lines] == [20, 14, 8, 2, -4]
    assert all(line["scene"]["output"] == {"format": "png"} for line in lines)
    del service.asked[:]
    (tmp_path / "out" / "000002.png").unlink()
    stratus(service, "animate", tmp_path / "s.json", "--duration", "0.5", "--fps", "10", "--speed", "30", *ramp, "-o", tmp_path / "out")
    assert times(service) == [103]


@needs_ffmpeg
@pytest.mark.parametrize("name, codec", [("a.mp4", "h264"), ("a.webm", "vp9")])
def test_a_film_has_its_frames_in_order(service, stratus, tmp_path, name, codec):
    later = threading.Event()

    def reply(handler, number, body):
        frame = round(body["clouds"]["time_s"])
        if frame == 0:
            later.wait(60)  # the first comes after others
        if frame == 2:
            later.set()
        handler.answer(200, "image/png", png(40 + 20 * frame))

    service.reply = reply
    options = ["--duration", "0.8", "--fps", "10", "--speed", "10", "--at-once", "4", "-o", tmp_path / name]
    done = stratus(service, "animate", *options)
    assert done.returncode == 0, done.stderr
    assert os.listdir(tmp_path) == [name]
    found = greys(tmp_path / name)
    assert len(found) == 8 and all(abs(grey - (40 + 20 * n)) <= 4 for n, grey in enumerate(found)), found
    command = ["ffprobe", "-v", "error", "-show_entries", "stream=codec_name,r_frame_rate:format_tags=comment", "-of", "json", tmp_path / name]
    told = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
    assert told["streams"][0] == {"codec_name": codec, "r_frame_rate": "10/1"}
    tags = {name.lower(): text for name, text in told["format"]["tags"].items()}
    assert json.loads(tags["comment"])["clouds"]["time_s"] == 0


@needs_ffmpeg
def test_a_frame_that_is_refused_leaves_no_film(service, stratus, tmp_path):
    (tmp_path / "a.mp4").write_bytes(b"old")

    def reply(handler, number, body):
        handler.problem(422, title="Wrong") if body["clouds"]["time_s"] > 20 else handler.answer(200, "image/png", png(9))

    service.reply = reply
    done = stratus(service, "animate", "--duration", "1", "--fps", "5", "-o", tmp_path / "a.mp4")
    assert done.returncode == 1 and "422 Wrong" in done.stderr and "frame 00000" in done.stderr
    assert os.listdir(tmp_path) == ["a.mp4"] and (tmp_path / "a.mp4").read_bytes() == b"old"


@needs_ffmpeg
def test_an_encoder_that_fails_leaves_no_film(service, stratus, tmp_path):
    service.reply = lambda handler, *_: handler.answer(200, "image/png", b"\x89PNG no picture")
    done = stratus(service, "animate", "--duration", "1", "--fps", "5", "-o", tmp_path / "a.webm")
    assert done.returncode == 4 and "ffmpeg" in done.stderr
    assert os.listdir(tmp_path) == []


def test_without_ffmpeg_it_is_said_before_anything_is_rendered(service, stratus, tmp_path):
    done = stratus(service, "animate", "-o", tmp_path / "a.mp4", env={"PATH": str(tmp_path)})
    assert done.returncode != 0 and "ffmpeg" in done.stderr
    assert not service.asked and os.listdir(tmp_path) == []


@pytest.mark.parametrize(
    "options",
    [[], ["-o", "x", "--day", "2026-06-21"], ["-o", "x", "--from", "2026-06-21T00:00:00Z"], ["-o", "x", "--ramp", "sun.elevation_deg=1"], ["-o", "x", "--fps", "0"],
     ["-o", "x", "--duration", "86400", "--fps", "240"], ["-o", "x", "--latitude", "1", "--longitude", "1", "--day", "yesterday"],
     ["-o", "x", "--latitude", "1", "--longitude", "1", "--from", "2026", "--until", "2027"]],
)  # fmt: skip
def test_usage(service, stratus, tmp_path, options):
    assert stratus(service, "animate", *options, cwd=tmp_path).returncode == 2
    assert not service.asked and os.listdir(tmp_path) == []


@pytest.mark.parametrize("name", ["f.gif", "f.avi", "f.MOV", "f.mkv", "f.png", "f.exr"])
def test_no_folder_under_the_name_of_a_film(service, stratus, tmp_path, name):
    done = stratus(service, "animate", "-o", tmp_path / name)
    assert done.returncode == 2 and ".mp4 and .webm" in done.stderr
    assert not service.asked and os.listdir(tmp_path) == []


def test_frames_of_a_longer_film_are_told(service, stratus, tmp_path):
    command = ["animate", "--fps", "10", "-o", tmp_path / "out", "--duration"]
    assert "earlier" not in stratus(service, *command, "0.4").stderr
    assert "earlier" not in stratus(service, *command, "0.4").stderr
    done = stratus(service, *command, "0.2")
    assert done.returncode == 0 and f"{tmp_path / 'out' / '000003.png'} and what follows" in done.stderr
    assert (tmp_path / "out" / "000004.png").exists()


PARIS = ["--latitude", "48.8566", "--longitude", "2.3522"]


def minutes(text):
    return int(text[11:13]) * 60 + int(text[14:16]) + int(text[17:19]) / 60


def test_sunrise_and_sunset_are_those_of_an_almanac(real_daemon, stratus):
    """Paris at the solstice of 2026: 5:47 and 21:58 of summer time (almanacs give whole minutes)."""
    table = json.loads(stratus(real_daemon, "sun", *PARIS, "--day", "2026-06-21", "--json").stdout)
    events = {row["event"]: row for row in table if "event" in row}
    assert minutes(events["sunrise"]["time"]) == pytest.approx(3 * 60 + 47, abs=1.5)
    assert minutes(events["sunset"]["time"]) == pytest.approx(19 * 60 + 58, abs=1.5)
    assert [row["time"] for row in table] == sorted(row["time"] for row in table)
    assert len(table) == 24 + 2
    # Its highest is 90 - 48.857 + 23.44 degrees, at 13:52 of summer time; the table has whole hours.
    assert max(row["elevation_deg"] for row in table) == pytest.approx(64.55, abs=0.15)


def test_sun_at_a_time(real_daemon, stratus):
    there = json.loads(stratus(real_daemon, "sun", *PARIS, "--time", "2026-06-21T14:00:00+02:00", "--json").stdout)
    text = stratus(real_daemon, "sun", *PARIS, "--time", "2026-06-21T12:00:00Z").stdout.splitlines()[1].split()
    assert there["time"] == text[0] == "2026-06-21T12:00:00Z"
    assert float(text[1]) == pytest.approx(there["elevation_deg"], abs=1e-3) and float(text[2]) == pytest.approx(there["azimuth_deg"], abs=1e-3)
    for options in (["--time", "noon"], ["--day", "2026-6"], ["--day", "2026-06-21", "--time", "2026-06-21T12:00:00Z"]):
        assert stratus(real_daemon, "sun", *PARIS, *options).returncode == 2
    assert stratus(real_daemon, "sun").returncode == 2


def test_where_the_sun_does_not_set(real_daemon, stratus, tmp_path):
    place = ["--latitude", "80", "--longitude", "0"]
    assert "event" not in stratus(real_daemon, "sun", *place, "--day", "2026-06-21", "--json").stdout
    night = stratus(real_daemon, "animate", *place, "--day", "2026-12-21", "-o", tmp_path / "x")
    assert night.returncode == 2 and "no day" in night.stderr


def test_the_course_of_a_day(real_daemon, stratus, tmp_path):
    size = ["--set", "output.width=16", "--set", "output.height=16", "--set", "clouds.resolution=64"]
    done = stratus(real_daemon, "animate", *size, *PARIS, "--day", "2026-06-21", "--duration", "0.5", "--fps", "10", "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    lines = [json.loads(line) for line in (tmp_path / "out" / "manifest.jsonl").read_text().splitlines()]
    elevations = [
        json.loads(stratus(real_daemon, "sun", *PARIS, "--time", line["scene"]["sun"]["time"], "--json").stdout)["elevation_deg"] for line in lines
    ]
    assert elevations[0] == pytest.approx(-6, abs=0.05) and elevations[-1] == pytest.approx(-6, abs=0.05)
    assert elevations[2] == max(elevations) > 64
