"""Twenty minutes of everything at once, with faults: soak.py BUILD_DIR. SOAK_MINUTES=N for another time.

A mixed open load (mix.jsonl), clients that leave while they are worked for, uploads and deletions, comparisons; every ten seconds a fault of the
GPU or the memory. Afterwards the daemon's log must hold no answer of status 500 and above that no fault explains, memory must be flat (the last third
within 5 % of the middle third) and file descriptors too, and the daemon must end with status 0. Fails otherwise.
"""
import http.client
import itertools
import json
import os
import pathlib
import random
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time

BUILD = pathlib.Path(sys.argv[1])
SECONDS = 60 * float(os.environ.get("SOAK_MINUTES", "20"))
RATE = os.environ.get("SOAK_RATE", "4")
FAULT_EVERY_S = 10
# A renderer that is made anew takes seconds on processors, and works off meanwhile what has come.
EXPLAINED_S = 30
HERE = pathlib.Path(__file__).parent
KEPT = pathlib.Path("out/soak")
# Faults of the program for tests (tests/faults/faults.c): name, number, seconds until it is taken back (None: it happens once).
FAULTS = [("gl-reset", 0, None), ("host-memory", 100000, None), ("gl-memory", 1, None), ("black", 1, 3), ("gl-reset", 40, None), ("gl-error", 1, None),
          ("gone", 1, 2), ("growth", 700, None)]


class Daemon:
    def __init__(self, folder):
        self.faults = folder / "faults"
        self.faults.mkdir()
        self.log = folder / "log"
        command = [BUILD / "stratusd-faulty", "--faults", self.faults, "--listen", "127.0.0.1:0", "--state-dir", folder / "state", "--kernel", "build/mie.kernel",
                   "--log-format", "json", "--golden-s", "5", "--recycle-mb", "500",
                   # Small, so that they are full before memory is looked at.
                   "--images-mb", "8", "--droplets-mb", "48", "--cache-mb", "64"]
        self.process = subprocess.Popen([str(word) for word in command], stdout=subprocess.PIPE, stderr=self.log.open("w"), text=True)
        line = self.process.stdout.readline()
        assert line.startswith("stratusd listening on "), self.log.read_text()
        self.port = int(line.rsplit(":", 1)[1])

    def ask(self, method, path, body=None, headers=None, wait=True):
        """Leaves after a moment unless it is to wait. The status, or None."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=90)
        try:
            connection.request(method, path, body, headers or {})
            if not wait:
                time.sleep(random.uniform(0, 0.3))
                return None
            answer = connection.getresponse()
            answer.read()
            return answer.status
        except (OSError, http.client.HTTPException):
            return None
        finally:
            connection.close()

    def resident(self):
        """Bytes, and descriptors."""
        status = pathlib.Path(f"/proc/{self.process.pid}/status").read_text()
        kilobytes = int(status.split("VmRSS:")[1].split()[0])
        return kilobytes * 1024, len(os.listdir(f"/proc/{self.process.pid}/fd"))


def until(end, *actions):
    for action in itertools.cycle(actions):
        if time.monotonic() >= end:
            return
        action()


def visitors(daemon, end):
    """What a load of whole answers does not do."""
    json_type = {"Content-Type": "application/json"}
    scene = lambda: json.dumps({"clouds": {"seed": random.randrange(10**6)}, "output": {"width": 800, "height": 600}})
    png = (HERE.parent / "fuzz/seeds/picture/grey-8.png").read_bytes()
    compare = json.dumps({"scene": {"output": {"width": 64, "height": 48}}, "variants": [{}, {"model": {"shading": "paper"}}]})
    until(
        end,
        lambda: [daemon.ask("POST", "/v1/render", scene(), json_type, wait=False) for _ in range(5)],
        lambda: daemon.ask("PUT", "/v1/assets/soak.png", png, {"Content-Type": "image/png"}),
        lambda: daemon.ask("GET", "/v1/render?clouds.map=soak.png&output.width=64&output.height=48"),
        lambda: daemon.ask("DELETE", "/v1/assets/soak.png"),
        lambda: daemon.ask("POST", "/v1/compare", compare, json_type),
        lambda: daemon.ask("POST", "/v1/render", "{" * 1000, json_type),
        lambda: time.sleep(2),
    )


def inject(daemon, end, happened):
    for name, number, seconds in itertools.cycle(FAULTS):
        if time.monotonic() >= end - EXPLAINED_S:
            return
        happened.append((time.time(), name))
        link = daemon.faults / name
        if not os.path.lexists(link):
            os.symlink(str(number), link)
        if seconds:
            time.sleep(seconds)
            link.unlink()
        time.sleep(FAULT_EVERY_S - (seconds or 0))


def watch(daemon, end):
    samples = []
    while time.monotonic() < end and daemon.process.poll() is None:
        samples.append(daemon.resident())
        time.sleep(1)
    return samples


def unexplained(log, happened):
    """Answers that tell of a failure, long after any fault."""
    import datetime

    found, failures = [], 0
    for line in log.read_text().splitlines():
        try:
            entry = json.loads(line)
        except ValueError:
            found.append(line)
            continue
        if int(entry.get("status", 0)) < 500:
            continue
        failures += 1
        at = datetime.datetime.fromisoformat(entry["time"].replace("Z", "+00:00")).timestamp()
        began = at - float(entry.get("duration_ms", 0)) / 1000
        # A picture is given up with 500 for an error of OpenGL, which is no loss of its context, and for nothing else.
        if not any(began - EXPLAINED_S <= when <= at and (entry["status"] != 500 or name == "gl-error") for when, name in happened):
            found.append(line)
    return found, failures


def thirds(values):
    third = len(values) // 3
    return statistics.median(values[third : 2 * third]), statistics.median(values[2 * third :])


def check(broken, holds, text):
    print(("  holds   " if holds else "  BROKEN  ") + text, flush=True)
    if not holds:
        broken.append(text)


def main():
    KEPT.mkdir(parents=True, exist_ok=True)
    broken, happened = [], []
    with tempfile.TemporaryDirectory() as folder:
        daemon = Daemon(pathlib.Path(folder))
        end = time.monotonic() + SECONDS
        load = subprocess.Popen([BUILD / "stratus", "bench", "--server", f"http://127.0.0.1:{daemon.port}", "--rate", RATE, "--random", "--mix", HERE / "mix.jsonl",
                                 "--duration", str(SECONDS), "--warm-up", "0", "--json", KEPT / "load.json", "-q"])
        threads = [threading.Thread(target=visitors, args=(daemon, end)), threading.Thread(target=inject, args=(daemon, end, happened))]
        for thread in threads:
            thread.start()
        samples = watch(daemon, end)
        for thread in threads:
            thread.join()
        load.wait()
        daemon.process.send_signal(signal.SIGTERM)
        status = daemon.process.wait(timeout=120)
        found, failures = unexplained(daemon.log, happened)
        (KEPT / "log").write_text(daemon.log.read_text())
    report = json.loads((KEPT / "load.json").read_text())
    memory, descriptors = zip(*samples)
    before, after = thirds(memory)
    print(f"{report['asked']} requests of the load: {report['status']}, errors {report['error']}; {len(happened)} faults, {failures} answers of 500 and above")
    check(broken, status == 0, f"the daemon ended with status {status}")
    check(broken, len(samples) > 0.9 * SECONDS, "it lived to the end")
    check(broken, not found, f"{len(found)} failures that no fault explains" + "".join("\n            " + line for line in found[:5]))
    check(broken, abs(after / before - 1) <= 0.05, f"resident memory {before / 2**20:.0f} MiB in the middle third, {after / 2**20:.0f} MiB in the last")
    before, after = thirds(descriptors)
    check(broken, abs(after - before) <= 3, f"{before:g} descriptors in the middle third, {after:g} in the last")
    check(broken, report["kind"]["hot"]["count"] > 0 and report["good"]["count"] > 0.8 * report["asked"] * 24 / 26, f"{report['good']['count']} good answers")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
