"""--check-config, and what a supervisor hears."""
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import time

import pytest

from conftest import ANSWER_SECONDS, BUILD, KERNEL, ROOT


def check(*flags, **environment):
    clean = {name: value for name, value in os.environ.items() if not name.startswith("STRATUS_")}
    return subprocess.run(
        [str(BUILD / "stratusd"), "--check-config", *flags], env={**clean, **environment}, capture_output=True, text=True, timeout=ANSWER_SECONDS
    )


def settings(result):
    return dict(line.split("=", 1) for line in result.stdout.splitlines() if not line.startswith("#"))


@pytest.fixture
def state(tmp_path):
    return str(tmp_path / "some" / "state")


def test_good_settings(state, tmp_path):
    result = check("--state-dir", state, "--kernel", str(KERNEL), "--listen=127.0.0.1:0", STRATUS_LOG_LEVEL="warning", STRATUS_WORKERS="3")
    assert result.returncode == 0
    assert result.stderr == ""
    found = settings(result)
    assert found["STRATUS_STATE_DIR"] == state and found["STRATUS_WORKERS"] == "3" and found["STRATUS_LISTEN"] == "127.0.0.1:0"
    assert f"# Mie kernel table: {KERNEL}" in result.stdout and "# image module: OpenImageIO" in result.stdout
    assert list(tmp_path.iterdir()) == []  # nothing was made


def test_what_it_prints_is_an_environment_that_gives_the_same(state):
    first = check("--state-dir", state, "--queue-length", "9", "--log-format=json", "--kernel", str(KERNEL))
    assert first.returncode == 0
    again = check(**{name: value for name, value in settings(first).items() if value})
    assert again.returncode == 0
    assert again.stdout == first.stdout


def test_nothing_is_started(state):
    result = check("--state-dir", state, "--kernel", str(KERNEL), "--listen=127.0.0.1:0", "--log-level=debug")
    assert result.returncode == 0
    assert "listening" not in result.stdout and "gl:" not in result.stderr


def test_faults(tmp_path):
    """Each is a line that names its flag, all in one go, and the exit status is that of bad usage."""
    (tmp_path / "file").write_text("x")
    (tmp_path / "shaders" / "lib").mkdir(parents=True)
    flags = {
        "--listen": "nowhere",
        "--state-dir": str(tmp_path / "file" / "state"),
        "--kernel": str(tmp_path / "file"),
        "--shader-dir": str(tmp_path / "shaders"),
        "--image-module": str(tmp_path / "file"),
    }
    result = check(*[word for pair in flags.items() for word in pair])
    assert result.returncode == 2
    errors = [line for line in result.stderr.splitlines() if " error " in line]
    for flag in set(flags) - {"--image-module"}:
        assert any(flag + " " in line for line in errors), flag
    assert any("image module: " in line for line in errors)
    for shader in (ROOT / "shaders").glob("*/*.glsl"):
        assert any(line.endswith(f"{shader.relative_to(ROOT / 'shaders')}: No such file or directory") for line in errors)
    assert settings(result)["STRATUS_KERNEL"] == flags["--kernel"]


def test_a_state_directory_that_cannot_be_made():
    """Not even by root, whom permissions do not stop."""
    for state in ("/proc/x", "/proc", "/proc/x/y"):
        result = check("--state-dir", state, "--kernel", str(KERNEL), "--listen=127.0.0.1:0")
        assert result.returncode == 2 and f"--state-dir {state}: /proc: " in result.stderr


def test_the_check_leaves_an_existing_directory_as_it_was(tmp_path):
    assert check("--state-dir", str(tmp_path), "--kernel", str(KERNEL), "--listen=127.0.0.1:0").returncode == 0
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("listen", ["192.0.2.1:8080", "[::1", "127.0.0.1:70000", "no-such-host.invalid:80"])
def test_addresses_that_cannot_be(state, listen):
    result = check("--state-dir", state, "--kernel", str(KERNEL), "--listen", listen)
    assert result.returncode == 2
    assert f"--listen {listen}: " in result.stderr


def test_own_shaders(state, tmp_path):
    shutil.copytree(ROOT / "shaders", tmp_path / "shaders")
    flags = ["--state-dir", state, "--kernel", str(KERNEL), "--shader-dir", str(tmp_path / "shaders")]
    assert check(*flags).returncode == 0
    (tmp_path / "shaders" / "lib" / "view.glsl").unlink()
    result = check(*flags)
    assert result.returncode == 2
    assert "lib/view.glsl" in result.stderr


def test_damaged_kernel(state, tmp_path):
    damaged = bytearray(KERNEL.read_bytes())
    damaged[len(damaged) // 2] ^= 1
    (tmp_path / "mie.kernel").write_bytes(damaged)
    result = check("--state-dir", state, "--kernel", str(tmp_path / "mie.kernel"))
    assert result.returncode == 2
    assert "--kernel" in result.stderr


def test_beside_a_daemon_that_runs(daemon, state):
    """So is an upgrade prepared."""
    result = check("--state-dir", state, "--kernel", str(KERNEL), "--listen", f"127.0.0.1:{daemon.port}")
    assert result.returncode == 0
    assert "another process listens" in result.stderr


def test_unknown_variables_are_named(state):
    result = check("--state-dir", state, "--kernel", str(KERNEL), "--log-format=json", STRATUS_QUEUE_LENGHT="5", STRATUS_QUEUE_LENGTH="5")
    assert result.returncode == 0
    (line,) = [json.loads(line) for line in result.stderr.splitlines()]
    assert line["level"] == "warning" and line["message"].startswith("STRATUS_QUEUE_LENGHT:")


def test_bad_flags_beside_it():
    assert check("--queue-length=0").returncode == 2
    assert check("--nonsense").returncode == 2


# --- the supervisor ----------------------------------------------------------------------------------------------------------------


@pytest.fixture
def supervisor(request, tmp_path, monkeypatch):
    """Listens as systemd does, on a path unless the test says that it is to be an abstract address."""
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    name = str(tmp_path / "notify") if getattr(request, "param", "path") == "path" else f"@stratus-test-{os.getpid()}"
    listener.bind(name.replace("@", "\0"))
    listener.settimeout(ANSWER_SECONDS)
    monkeypatch.setenv("NOTIFY_SOCKET", name)
    yield listener
    listener.close()


@pytest.mark.parametrize("supervisor", ["path", "abstract"], indirect=True)
def test_supervisor_hears_of_the_life(supervisor, start_daemon):
    daemon = start_daemon()
    assert daemon.get("/readyz").status == 200
    assert "READY=1" in supervisor.recv(4096).decode().splitlines()
    daemon.process.send_signal(signal.SIGHUP)
    told = supervisor.recv(4096).decode().splitlines()
    assert told[0] == "RELOADING=1" and re.fullmatch(r"MONOTONIC_USEC=\d+", told[1])
    assert supervisor.recv(4096) == b"READY=1"
    assert daemon.stop() == 0
    assert "STOPPING=1" in supervisor.recv(4096).decode().splitlines()
    supervisor.settimeout(0.1)
    with pytest.raises(TimeoutError):
        supervisor.recv(4096)  # no sign of life where none is asked for


def test_supervisor_hears_signs_of_life(supervisor, start_daemon, monkeypatch):
    monkeypatch.setenv("WATCHDOG_USEC", "400000")
    daemon = start_daemon()
    assert supervisor.recv(4096).startswith(b"READY=1")
    supervisor.setblocking(False)
    with pytest.raises(BlockingIOError):
        while supervisor.recv(4096):
            pass  # what came before the clock starts here
    supervisor.settimeout(ANSWER_SECONDS)
    began = time.monotonic()
    for _ in range(6):
        assert supervisor.recv(4096) == b"WATCHDOG=1"
    assert time.monotonic() - began >= 0.9  # one each half of the 0.4 s, the first of them at any time
    assert daemon.render({"output": {"width": 32, "height": 24}}).status == 200
    assert daemon.stop() == 0


def test_signs_of_life_for_another_process(supervisor, start_daemon, monkeypatch):
    monkeypatch.setenv("WATCHDOG_USEC", "50000")
    monkeypatch.setenv("WATCHDOG_PID", "1")
    start_daemon()
    supervisor.recv(4096)
    supervisor.settimeout(0.5)
    with pytest.raises(TimeoutError):
        supervisor.recv(4096)


def test_supervisor_that_is_gone(start_daemon, tmp_path, monkeypatch):
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "nobody"))
    daemon = start_daemon()
    assert daemon.get("/readyz").status == 200
    assert daemon.stop() == 0
    assert re.search(r"warning NOTIFY_SOCKET .*nobody: No such file", daemon.log.read_text())
