"""make install: files, their places, and the programs that find each other there; the unit of systemd; versions that agree."""
import os
import pathlib
import re
import shutil
import stat
import subprocess

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]


def run(*command, **options):
    return subprocess.run(command, capture_output=True, text=True, timeout=600, **options)


def make(*arguments):
    environment = {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MAKELEVEL", "SAN")}
    result = run("make", "-s", "-C", str(ROOT), *arguments, env=environment)
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.fixture(scope="module")
def prefix(tmp_path_factory):
    prefix = tmp_path_factory.mktemp("installed") / "usr"
    make("install", f"PREFIX={prefix}", f"SYSCONFDIR={prefix}/etc")
    return prefix


def files_below(folder):
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


FILES = {
    "bin/stratusd": 0o755,
    "bin/stratus": 0o755,
    "lib/stratus/stratus-image.so": 0o644,
    "lib/systemd/system/stratusd.service": 0o644,
    "share/stratus/mie.kernel": 0o644,
    "share/stratus/grafana-dashboard.json": 0o644,
    "share/stratus/prometheus-alerts.yml": 0o644,
    "share/man/man8/stratusd.8": 0o644,
    "share/man/man1/stratus.1": 0o644,
    "share/bash-completion/completions/stratus": 0o644,
    "etc/stratusd.env": 0o640,
}


def test_files(prefix):
    assert files_below(prefix) == set(FILES)
    assert {name: stat.S_IMODE((prefix / name).stat().st_mode) for name in FILES} == FILES


def test_destdir(tmp_path):
    make("install", f"DESTDIR={tmp_path}", "PREFIX=/usr", "SYSCONFDIR=/etc/stratus")
    placed = {("usr/" + name).replace("usr/etc/", "etc/stratus/") for name in FILES}
    assert files_below(tmp_path) == placed
    unit = (tmp_path / "usr/lib/systemd/system/stratusd.service").read_text()
    assert "ExecStart=/usr/bin/stratusd\n" in unit and "EnvironmentFile=-/etc/stratus/stratusd.env\n" in unit
    assert not re.search(r"@[A-Z]+@", unit) and str(tmp_path) not in unit


def test_installed_programs_find_their_files(prefix, tmp_path):
    """From a copy elsewhere, so that nothing is found in the build folder."""
    moved = tmp_path / "moved"
    shutil.copytree(prefix, moved)
    clean = {"HOME": str(tmp_path), "PATH": os.environ["PATH"]}
    result = run(moved / "bin/stratusd", "--check-config", "--listen=127.0.0.1:0", env=clean)
    assert result.returncode == 0, result.stderr
    assert f"# Mie kernel table: {moved}/bin/../share/stratus/mie.kernel" in result.stdout
    assert "# image module: OpenImageIO" in result.stdout
    (moved / "lib/stratus/stratus-image.so").unlink()
    assert run(moved / "bin/stratusd", "--check-config", "--listen=127.0.0.1:0", env=clean).returncode == 2
    assert run(moved / "bin/stratus", "--version").returncode == 0


def test_settings_survive_an_upgrade(tmp_path):
    arguments = [f"PREFIX={tmp_path}/usr", f"SYSCONFDIR={tmp_path}/etc"]
    make("install", *arguments)
    settings = tmp_path / "etc" / "stratusd.env"
    settings.write_text("STRATUS_QUEUE_LENGTH=3\n")
    make("install", *arguments)
    assert settings.read_text() == "STRATUS_QUEUE_LENGTH=3\n"
    make("uninstall", *arguments)
    assert files_below(tmp_path) == {"etc/stratusd.env"}


def test_settings_of_the_service_are_settings(prefix, tmp_path):
    """Those that are set and those that are commented out."""
    lines = re.findall(r"^#?(STRATUS_\w+)=(.*)$", (prefix / "etc/stratusd.env").read_text(), re.M)
    files = {name for name, value in lines if value.startswith("/etc/")}  # the operator's, who makes them
    environment = {"HOME": str(tmp_path), "PATH": os.environ["PATH"], **{name: value for name, value in lines if name not in files}}
    result = run(prefix / "bin/stratusd", "--check-config", "--listen=127.0.0.1:0", env=environment)
    assert result.returncode == 0
    assert "no setting" not in result.stderr
    for name, value in lines:
        if name != "STRATUS_LISTEN":
            assert (f"{name}=\n" if name in files else f"{name}={value}\n") in result.stdout


# --- systemd -----------------------------------------------------------------------------------------------------------------------


@pytest.fixture
def unit(prefix):
    if not shutil.which("systemd-analyze"):
        pytest.skip("no systemd-analyze here")
    return prefix / "lib/systemd/system/stratusd.service"


def test_unit_is_a_unit(unit):
    result = run("systemd-analyze", "--man=no", "verify", unit)
    assert result.returncode == 0 and "stratusd" not in result.stdout + result.stderr, result.stderr


def test_unit_is_hardened(unit):
    """Its exposure by systemd's own measure, of 10; 1.6 is what a network service with GPUs and machine code made at run time has."""
    result = run("systemd-analyze", "security", "--offline=yes", "--no-pager", "--threshold=17", unit)
    assert result.returncode == 0, result.stdout[-2000:]


def test_unit_waits_as_long_as_the_daemon(unit):
    """Draining is bounded by --drain-s; giving up and refusing the rest by 15 s more (server/service.c), and ending takes some."""
    drain_s = int(re.search(r"STRATUS_DRAIN_S \[(\d+)\]", run(ROOT / "build" / "stratusd", "--help").stdout)[1])
    assert int(re.search(r"^TimeoutStopSec=(\d+)$", unit.read_text(), re.M)[1]) >= drain_s + 30
    assert int(re.search(r"^LimitNOFILE=(\d+)$", unit.read_text(), re.M)[1]) > 1024


# --- versions ----------------------------------------------------------------------------------------------------------------------


def test_versions_agree(prefix):
    version = run(prefix / "bin/stratusd", "--version").stdout
    assert run(prefix / "bin/stratus", "--version").stdout == version
    number = version.split()[1]
    assert re.search(r"^ARG VERSION=(.*)$", (ROOT / "Dockerfile").read_text(), re.M)[1] == number


# --- the image ---------------------------------------------------------------------------------------------------------------------


def needed(path):
    """Sonames that the program or module itself asks for."""
    return re.findall(r"NEEDED +(\S+)", run("objdump", "-p", path).stdout)


def package_of(soname):
    found = re.search(rf"^\s*{re.escape(soname)} \(.*x86-64.*\) => (\S+)$", run("/sbin/ldconfig", "-p").stdout, re.M)
    assert found, soname
    for path in (os.path.realpath(found[1]), os.path.realpath(found[1]).removeprefix("/usr")):
        owner = run("dpkg", "-S", path).stdout
        if owner:
            return owner.split(":")[0]
    raise AssertionError(f"no package has {soname}")


def test_image_has_the_libraries(prefix):
    """Of every library that is linked the Dockerfile installs the package; the base has those of the compiler."""
    if os.uname().machine != "x86_64":
        pytest.skip("names of libraries are looked up for x86-64")
    stage = (ROOT / "Dockerfile").read_text().split("\nFROM ")[-1]
    installed = set(re.search(r"--no-install-recommends(.*?)&&", stage, re.S)[1].replace("\\", " ").split())
    binaries = [prefix / "bin/stratusd", prefix / "bin/stratus", prefix / "lib/stratus/stratus-image.so"]
    packages = {package_of(soname) for binary in binaries for soname in needed(binary)}
    assert packages - installed <= {"libc6", "libgcc-s1", "libstdc++6"}
