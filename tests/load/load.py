"""How the daemon at STRATUS_SERVER bears more than it can do: load.py BUILD_DIR QUEUE_LENGTH. scripts/load.sh starts the daemon.

What it can do is measured by a closed load; then an open load offers 0.5, 1, 2 and 4 times that. Whatever is offered, those who are taken must be
answered within the time that a full queue takes, the rest must be told so at once, and the work that gets done must stay the same. LOAD_SECONDS
(20) is how long each is measured. Fails when a bound is broken.
"""
import json
import os
import pathlib
import shutil
import subprocess
import sys

SECONDS = os.environ.get("LOAD_SECONDS", "20")
MIX = pathlib.Path(__file__).parent / "mix.jsonl"
KEPT = pathlib.Path("out/load")
OFFERED = (0.5, 1, 2, 4)
CLIENTS = 8
# A refusal is one HTTP answer; on two processors that render it may wait for some turns of the scheduler.
AT_ONCE_S = 0.25
GOODPUT_LOSS = 0.10


def bench(build, name, *options):
    kept = KEPT / f"{name}.json"
    command = [build + "/stratus", "bench", "--mix", MIX, "--duration", SECONDS, "--warm-up", "5", "--json", kept, "-q", *options]
    command += ["--seed", str(len(list(KEPT.glob("*.json"))) + 1)]  # no scene twice: what is kept would be found
    subprocess.run(command, check=False)  # at an overload no good answer at all is a result, too
    return json.loads(kept.read_text())


def row(name, found):
    good, refused = found["good"], found["refused"]
    ms = lambda latency, share: f"{1000 * latency[share]:.0f}" if latency["count"] else ""
    print(
        f"{name:>8} {found['asked_per_s']:9.1f} {found['good_per_s']:9.1f} {ms(good, 'p50_s'):>8} {ms(good, 'p99_s'):>8} {refused['count']:9d}"
        f" {ms(refused, 'p50_s'):>8} {ms(refused, 'p99_s'):>8} {found['errors'] + found['other']['count']:7d}",
        flush=True,
    )


def check(broken, holds, text):
    print(("  holds   " if holds else "  BROKEN  ") + text)
    if not holds:
        broken.append(text)


def main():
    build, queue = sys.argv[1], int(sys.argv[2])
    shutil.rmtree(KEPT, ignore_errors=True)
    KEPT.mkdir(parents=True)
    print(f"{'offered':>8} {'asked/s':>9} {'good/s':>9} {'p50 ms':>8} {'p99 ms':>8} {'refused':>9} {'p50 ms':>8} {'p99 ms':>8} {'errors':>7}")
    closed = bench(build, "closed", "--connections", str(CLIENTS))
    row("closed", closed)
    capacity = closed["good_per_s"]
    service_s = 1 / capacity
    found = {}
    for offered in OFFERED:
        found[offered] = bench(build, f"open-{offered:g}", "--rate", f"{offered * capacity:.3f}", "--random")
        row(f"{offered:g} x", found[offered])

    broken = []
    limit = queue * service_s
    print(f"\ncapacity {capacity:.1f} pictures/s, so {1000 * service_s:.1f} ms each; a queue of {queue} takes {limit:.2f} s")
    for offered, load in found.items():
        p99 = load["good"].get("p99_s", 0)
        check(broken, p99 <= limit, f"{offered:g} x: p99 of those taken {p99:.2f} s <= {limit:.2f} s")
        if load["refused"]["count"]:
            p99 = load["refused"]["p99_s"]
            check(broken, p99 <= AT_ONCE_S, f"{offered:g} x: p99 of refusals {1000 * p99:.0f} ms <= {1000 * AT_ONCE_S:.0f} ms")
        others = load["errors"] + load["other"]["count"]
        check(broken, others == 0, f"{offered:g} x: {others} answers that are neither a picture nor a refusal")
    ratio = found[4]["good_per_s"] / found[1]["good_per_s"]
    check(broken, ratio >= 1 - GOODPUT_LOSS, f"goodput at 4 x is {ratio:.3f} of that at 1 x, at least {1 - GOODPUT_LOSS:.1f}")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
