"""Measures how far the slab is from its reference over the scenes beside this file: judge.py PAGE [BUILD_DIR]. scripts/judge.sh starts the daemon.

Each scene is rendered solved, in the paper's shading, by the reference, and by the reference once more with another seed and fewer samples, which
must differ from it by noise alone. The figures of finished scenes are kept in the folder JUDGE_KEPT, so that a run that was stopped goes on; the page is written
from all of them. JUDGE_SAMPLES=N takes others than 64 samples, for a quick look. Without BUILD_DIR nothing is rendered: the page is written
from what there is.
"""
import json
import os
import pathlib
import statistics
import subprocess
import sys
import time

SCENES = pathlib.Path(__file__).parent / "scenes"
WIDTH, HEIGHT = 160, 120
SAMPLES = int(os.environ.get("JUDGE_SAMPLES", 64))
SAMPLES_AGAIN = max(2, SAMPLES // 4)
KEPT = pathlib.Path(os.environ.get("JUDGE_KEPT", "out/judge"))
REGIONS = ("cloud", "sky", "ground")
BIAS_BOUND, RMS_BOUND = 5, 15  # percent
# So many pixels make a figure.
PIXELS_MIN = 100


def scenes():
    return sorted(SCENES.glob("*.json"))


def kept_file(scene):
    return KEPT / f"{scene.stem}.json"


def measure(build, scene):
    kept = kept_file(scene)
    if kept.exists():
        return json.loads(kept.read_text())
    began = time.monotonic()
    command = [build + "/stratus", "compare", scene, "--set", f"output.width={WIDTH}", "--set", f"output.height={HEIGHT}"]
    command += ["--with", "model.shading=paper"]
    command += ["--with", "model.name=reference", "--and", f"model.samples={SAMPLES}"]
    command += ["--with", "model.name=reference", "--and", f"model.samples={SAMPLES_AGAIN}", "--and", "model.seed=2", "--named", "again"]
    command += ["--against", "reference", "--timeout", "3600", "-q", "-o", "-"]
    answer = subprocess.run(list(map(str, command)), stdout=subprocess.PIPE, check=True)
    figures = json.loads(answer.stdout)
    figures["seconds"] = time.monotonic() - began
    kept.write_text(json.dumps(figures))
    print(f"{scene.stem}: {figures['seconds']:.0f} s", flush=True)
    return figures


def of(figures, variant, region):
    """The figures of a variant in a region, None where that has too few pixels."""
    pixels = next(r["pixels"] for r in figures["regions"] if r["name"] == region)
    found = next(v for v in figures["variants"] if v["name"] == variant)["regions"][region]
    return found if pixels >= PIXELS_MIN else None


def percent(value, digits=1):
    return "" if value is None else f"{100 * value:.{digits}f}"


def with_error(found, name, error):
    return "" if not found or found[name] is None else f"{percent(found[name])} ± {percent(found[error])}"


def bias(figures, variant, region):
    return with_error(of(figures, variant, region), "bias", "bias_standard_error")


def rms(figures, variant, region):
    return with_error(of(figures, variant, region), "noise_corrected_rms", "noise_corrected_rms_standard_error")


def flip(figures, variant):
    return f"{of(figures, variant, 'all')['flip']['mean']:.3f}"


def table(header, rows):
    yield "| " + " | ".join(header) + " |"
    yield "| " + " | ".join(["---"] * len(header)) + " |"
    for row in rows:
        yield "| " + " | ".join(row) + " |"


def cloud_table(results):
    header = ["scene", "solved: bias %", "rms %", "paper: bias %", "rms %", "noise %", "FLIP solved", "paper", "again"]
    rows = []
    for name, figures in results.items():
        row = [f"[{name}](../../tests/judge/scenes/{name}.json)"]
        for variant in ("solved", "paper"):
            row += [bias(figures, variant, "cloud"), rms(figures, variant, "cloud")]
        noise = of(figures, "solved", "cloud")
        row += [percent(noise and noise["noise"], 0), flip(figures, "solved"), flip(figures, "paper"), flip(figures, "again")]
        rows.append(row)
    return table(header, rows)


def other_table(results):
    header = ["scene"] + [f"{region}, {variant}: {what} %" for region in ("sky", "ground") for variant in ("solved", "paper") for what in ("bias", "rms")]
    rows = []
    for name, figures in results.items():
        rows.append([name] + [f(figures, v, r) for r in ("sky", "ground") for v in ("solved", "paper") for f in (bias, rms)])
    return table(header, rows)


def group_of(name):
    where = "below" if "-below-" in name else "above"
    return f"{'overcast' if 'overcast' in name else 'broken'}, from {where}"


def verdicts(found, name, error, bound):
    """How many figures keep a bound, break it, and cannot be told from it within three standard errors."""
    counts = [0, 0, 0]
    for figures in found:
        value, doubt = 100 * abs(figures[name]), 300 * figures[error]
        counts[0 if value + doubt <= bound else 1 if value - doubt > bound else 2] += 1
    return " / ".join(map(str, counts))


def summary(results):
    """Over cloud pixels: medians of the groups, and how many scenes keep each bound."""
    rows = []
    for group in sorted({group_of(name) for name in results}):
        members = [f for name, f in results.items() if group_of(name) == group]
        row = [group, str(len(members))]
        for variant in ("solved", "paper"):
            found = [x for x in (of(f, variant, "cloud") for f in members) if x]
            row += [percent(statistics.median(abs(x["bias"]) for x in found)), verdicts(found, "bias", "bias_standard_error", BIAS_BOUND)]
            row += [percent(statistics.median(x["noise_corrected_rms"] for x in found))]
            row += [verdicts(found, "noise_corrected_rms", "noise_corrected_rms_standard_error", RMS_BOUND)]
        rows.append(row)
    header = ["decks", "scenes"]
    for variant in ("solved", "paper"):
        header += [f"{variant}: bias %", f"{BIAS_BOUND} %", "rms %", f"{RMS_BOUND} %"]
    return table(header, rows)


def check_table(results):
    """The reference against itself with another seed, over everything: bias in standard errors, and the RMS that noise leaves."""
    rows = []
    for name, figures in results.items():
        again = of(figures, "again", "all")
        rows.append([name, f"{again['bias'] / again['bias_standard_error']:.1f}", percent(again["rms"], 0), percent(again["noise"], 0)])
    return table(["scene", "bias / standard error", "rms %", "noise %"], rows)


def page(results):
    spent = sum(figures["seconds"] for figures in results.values())
    text = (pathlib.Path(__file__).parent / "page.md").read_text()
    text = text.replace("@SIZE@", f"{WIDTH} x {HEIGHT}").replace("@SAMPLES@", str(SAMPLES)).replace("@AGAIN@", str(SAMPLES_AGAIN))
    text = text.replace("@MINUTES@", f"{spent / 60:.0f}").replace("@COUNT@", str(len(results))).replace("@ALL@", str(len(scenes())))
    for mark, lines in (("@SUMMARY@", summary), ("@CLOUD@", cloud_table), ("@OTHER@", other_table), ("@CHECK@", check_table)):
        text = text.replace(mark, "\n".join(lines(results)))
    return text


def main():
    target, build = pathlib.Path(sys.argv[1]), sys.argv[2] if len(sys.argv) > 2 else None
    KEPT.mkdir(parents=True, exist_ok=True)
    results = {scene.stem: measure(build, scene) for scene in scenes() if build or kept_file(scene).exists()}
    target.write_text(page(results))


if __name__ == "__main__":
    main()
