"""stratus optics against the daemon's answer, which the tests over HTTP hold against Mie theory."""
import json
import os
import shutil

import pytest

DROPLETS = ["--set", "dsd.effective_radius_um=12", "--set", "dsd.gamma=7"]


def rows(text):
    return {line[:34].strip(): line[34:].split() for line in text.splitlines() if len(line.split()) >= 4}


def test_table_is_what_the_daemon_says(real_daemon, stratus):
    told = json.loads(stratus(real_daemon, "optics", *DROPLETS, "--json").stdout)
    table = rows(stratus(real_daemon, "optics", *DROPLETS).stdout)
    number = lambda name: [float(text) for text in table[name]]
    assert number("wavelength, nm") == told["wavelength_nm"] == [650, 550, 450]
    assert number("extinction, 1/m") == pytest.approx(told["extinction_per_m"], rel=1e-4)
    assert number("mean free path, m") == pytest.approx([1 / value for value in told["extinction_per_m"]], rel=1e-3)
    assert number("asymmetry") == pytest.approx(told["asymmetry"], abs=1e-4)
    phase = told["phase_function"]
    assert number("0 degrees") == pytest.approx([band[0] for band in phase["value"]], rel=1e-3)
    assert number("180 degrees") == pytest.approx([band[-1] for band in phase["value"]], rel=1e-3)
    # Of these droplets the bow stands where the literature has that of clouds, and the ring shrinks with the wavelength.
    assert all(138 < angle < 143 for angle in number("fogbow, degrees from the sun"))
    red, green, blue = number("glory's ring, radius in degrees")
    assert 3 > red > green > blue > 0.5


def test_droplets_of_a_scene_count_alone(real_daemon, stratus, tmp_path):
    (tmp_path / "s.json").write_text('{"dsd": {"effective_radius_um": 12, "gamma": 7}, "sun": {"elevation_deg": 3}, "output": {"width": 64}}')
    assert stratus(real_daemon, "optics", tmp_path / "s.json").stdout == stratus(real_daemon, "optics", *DROPLETS).stdout


def test_curve_in_characters(real_daemon, stratus):
    lines = stratus(real_daemon, "optics", "--plot").stdout.splitlines()
    marks = [line for line in lines if "|" in line]
    assert sum(line.count("*") for line in marks) == 73
    first = [row for row, line in enumerate(marks) if line.split("|")[1].startswith("*")]
    assert first == [min(row for row, line in enumerate(marks) if "*" in line)]  # forward is where it is largest


@pytest.mark.skipif(not shutil.which("gnuplot"), reason="gnuplot is not installed")
@pytest.mark.parametrize("name, start", [("a.png", b"\x89PNG"), ("it's.svg", b"<?xml")])
def test_figure(real_daemon, stratus, tmp_path, name, start):
    done = stratus(real_daemon, "optics", "-o", tmp_path / name)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / name).read_bytes().startswith(start) and os.listdir(tmp_path) == [name]


def test_refusals(real_daemon, stratus, tmp_path):
    done = stratus(real_daemon, "optics", "--set", "dsd.effective_radius_um=1e9")
    assert done.returncode == 1 and "/dsd/effective_radius_um" in done.stderr
    assert stratus(real_daemon, "optics", "--set", "dsd.gamma=a b&c").returncode == 1
    assert stratus(real_daemon, "optics", "-o", tmp_path / "a.jpg").returncode == 2
    without = stratus(real_daemon, "optics", "-o", tmp_path / "a.png", env={"PATH": str(tmp_path)})
    assert without.returncode == 4 and os.listdir(tmp_path) == []
