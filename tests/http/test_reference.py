"""The model reference over HTTP: what it may cost, how it ends, what its pictures say of themselves. What they show: tests/unit, make judge."""
import json
import threading

import numpy
import pytest

from conftest import measures, wait_for
from test_compare import channels, compare, layer

TINY = {"width": 24, "height": 16}


def scene_of(model=None, **output):
    return {"model": {"name": "reference", "samples": 4, **(model or {})}, "output": {**TINY, **output}}


def float_exr(**model):
    return scene_of(model, format="exr", exr_type="float", layers=["color", "standard_error"])


def test_same_seed_same_bytes(daemon):
    first, again, other = (daemon.render(scene_of({"seed": seed}), Cache_Control="no-cache") for seed in (1, 1, 2))
    assert first.status == again.status == other.status == 200
    assert first.body == again.body and first.headers["ETag"] == again.headers["ETag"]
    assert first.body != other.body and first.headers["ETag"] != other.headers["ETag"]
    assert first.headers["Stratus-Samples"] == "4" and first.headers["Stratus-Partial"] is None


def test_pictures_tell_their_samples(daemon, read_image):
    pixels, spec = read_image(daemon.render(float_exr(samples=6)).body)
    assert spec.getattribute("stratus:samples") == 6 and spec.getattribute("stratus:partial") == 0
    assert not [attribute.name for attribute in spec.extra_attribs if "illuminance" in attribute.name]  # they would be the slab's
    error = layer(pixels, spec, "standard_error")
    assert numpy.isfinite(error).all() and (error >= 0).all() and error.mean() > 0
    _, spec = read_image(daemon.render(scene_of()).body)
    assert (spec.getattribute("stratus:samples"), spec.getattribute("stratus:partial")) == ("4", "false")
    assert json.loads(spec.getattribute("stratus:scene"))["model"] == {
        "name": "reference", "optics": "mie", "samples": 4, "time_budget_ms": 0, "seed": 1, "partial": False
    }
    assert daemon.render({"output": TINY}).headers["Stratus-Samples"] is None


@measures
def test_standard_error_is_the_scatter_of_seeds(daemon, read_image):
    """Of the whole picture's mean: six seeds scatter as much as one of them says."""
    means, errors = [], []
    for seed in range(6):
        pixels, spec = read_image(daemon.render(float_exr(seed=seed, samples=16)).body)
        means.append(channels(pixels, spec, "R", "G", "B").mean())
        errors.append(numpy.sqrt((layer(pixels, spec, "standard_error") ** 2).sum((0, 1))).mean() / (24 * 16))
    assert numpy.std(means, ddof=1) < 3 * numpy.mean(errors)
    assert numpy.std(means, ddof=1) > numpy.mean(errors) / 6


def test_shading_and_radiosity_make_no_other_reference(daemon):
    plain = daemon.head("/v1/render?model.name=reference").headers["ETag"]
    assert daemon.head("/v1/render?model.name=reference&model.shading=paper&radiosity.enabled=false").headers["ETag"] == plain
    assert daemon.head("/v1/render?model.name=reference&model.optics=paper").headers["ETag"] != plain


@pytest.mark.parametrize("member, value", [("samples", 64), ("time_budget_ms", 0), ("seed", 1), ("partial", False)])
def test_members_of_the_reference_alone(daemon, member, value):
    answer = daemon.render({"model": {member: value}})
    assert answer.status == 422 and answer.pointers == {f"/model/{member}"}


def test_standard_error_is_of_the_reference_alone(daemon):
    answer = daemon.render({"output": {"format": "exr", "layers": ["standard_error"]}})
    assert answer.status == 422 and answer.pointers == {"/output/layers"}


def test_a_picture_has_so_many_paths_at_most(start_daemon):
    daemon = start_daemon("--reference-mpaths", "1")
    answer = daemon.render(scene_of({"samples": 100}, width=640, height=480))
    assert answer.status == 422 and answer.pointers == {"/model/samples"}
    assert "--reference-mpaths" in answer.json["errors"][0]["detail"] and "so 3 samples here" in answer.json["errors"][0]["detail"]
    assert daemon.head("/v1/render?model.name=reference&model.samples=3&output.width=640&output.height=480").status == 200
    answer = compare(daemon, {"scene": {"output": {"width": 640, "height": 480}}, "variants": [{}, {"model": {"name": "reference"}}]})
    assert answer.pointers == {"/scene/model/samples"}
    answer = compare(daemon, {"scene": {"output": {"width": 640, "height": 480}}, "variants": [{}, {"model": {"name": "reference", "samples": 4}}]})
    assert answer.pointers == {"/variants/1/model/samples"}


def test_time_budget(daemon):
    """Far fewer than 65536 samples in half a second; no two such pictures need be the same."""
    answer = daemon.render(scene_of({"samples": 65536, "time_budget_ms": 500}, width=64, height=48))
    assert answer.status == 200 and 0 < int(answer.headers["Stratus-Samples"]) < 65536
    assert answer.headers["Stratus-Partial"] is None
    assert answer.headers["ETag"] is None and answer.headers["Cache-Control"] == "no-store"


def in_growing_time(ask):
    """(answer, milliseconds) of the first that has a sample: ask(X-Timeout-Ms); how long the first sample takes is the machine's affair."""
    for seconds in (4, 8, 16, 32, 64, 128):
        answer = ask(str(1000 * seconds))
        if answer.status == 200:
            break
    return answer, 1000 * seconds


def test_partial_at_the_deadline(daemon, read_image):
    long = scene_of({"samples": 65536}, width=64, height=48)
    assert daemon.render(long, X_Timeout_Ms="1500").status == 504
    long["model"]["partial"] = True
    assert daemon.render(long, X_Timeout_Ms="1").status == 504  # no pixel has a sample yet
    answer, deadline = in_growing_time(lambda ms: daemon.render(long, X_Timeout_Ms=ms))
    assert answer.status == 200 and answer.headers["Stratus-Partial"] == "true" and answer.headers["ETag"] is None
    _, spec = read_image(answer.body)
    assert spec.getattribute("stratus:partial") == "true"
    assert 0 < int(spec.getattribute("stratus:samples")) == int(answer.headers["Stratus-Samples"]) < 65536
    assert float(answer.timing["total"]["dur"]) < deadline


def test_partial_that_is_done_in_time(daemon):
    answer = daemon.render(scene_of({"partial": True}))
    assert answer.status == 200 and answer.headers["Stratus-Samples"] == "4" and answer.headers["Stratus-Partial"] is None
    assert answer.headers["ETag"] is None


def test_if_none_match_never_matches_what_is_timed(daemon):
    target = "/v1/render?model.name=reference&model.samples=1&model.partial=true&output.width=16&output.height=16"
    assert daemon.get(target, If_None_Match="*").status == 200
    assert daemon.head(target).headers["ETag"] is None


def test_a_reference_that_nobody_waits_for_ends(daemon):
    connection = daemon.connect()
    ended = 'stratus_renders_ended_total{reason="abandoned"}'
    before = daemon.metric(ended)
    body = json.dumps(scene_of({"samples": 65536, "partial": True}, width=64, height=48))
    connection.request("POST", "/v1/render", body, {"Content-Type": "application/json"})
    assert wait_for(lambda: daemon.metric("stratus_requests_in_flight") == 2 and daemon.metric("stratus_queue_depth") == 0)
    connection.close()
    assert daemon.render({"output": TINY}).status == 200
    assert wait_for(lambda: daemon.metric(ended) == before + 1)  # others pass it before it is asked for again


@measures
def test_compared_with_the_reference(daemon):
    """The reference is the truth unless told otherwise; another seed differs by noise alone, and the slab by more."""
    variants = [{}, {"name": "again", "model": {"name": "reference", "samples": 16, "seed": 7}},
                {"name": "truth", "model": {"name": "reference", "samples": 48}}]
    answer = compare(daemon, {"scene": {"output": {"width": 64, "height": 48}}, "variants": variants, "reference": "truth"})
    assert answer.status == 200
    assert [v.get("samples") for v in answer.json["variants"]] == [None, 16, 48]
    again = answer.json["variants"][1]["regions"]["all"]
    assert again["noise"] > 0 and abs(again["bias"]) < 5 * again["bias_standard_error"]
    assert abs(again["rms"] - again["noise"]) < 0.5 * again["noise"]
    assert answer.json["variants"][2]["regions"]["all"].keys() == {"noise"}
    plain = compare(daemon, {"scene": {"output": TINY}, "variants": [{}, {"model": {"name": "reference", "samples": 1}}]})
    assert plain.json["reference"] == "reference"


def test_partial_comparison(daemon):
    variants = [{}, {"model": {"name": "reference", "samples": 65536, "partial": True}}]
    body = {"scene": {"output": {"width": 48, "height": 32}}, "variants": variants}
    answer, _ = in_growing_time(lambda ms: compare(daemon, body, X_Timeout_Ms=ms))
    assert answer.status == 200 and answer.json["variants"][1]["partial"] is True and answer.json["variants"][1]["samples"] > 0
    variants[1]["model"]["partial"] = False
    # Too late, or refused at once as soon as the daemon knows what a reference takes.
    assert compare(daemon, {"scene": {"output": {"width": 48, "height": 32}}, "variants": variants}, X_Timeout_Ms="1500").status in (503, 504)


def test_others_pass_a_long_reference(daemon):
    """Pictures of the slab do not wait for its end, and it is the same as without them."""
    for samples in (32, 128, 512, 2048, 8192):  # until it is long enough here for two pictures to pass
        scene, answers, passed = scene_of({"samples": samples}, width=48, height=32), {}, 0
        long = threading.Thread(target=lambda: answers.update(long=daemon.render(scene, Cache_Control="no-cache")))
        long.start()
        while long.is_alive() and passed < 5:
            # Other skies, so that what the reference needs is driven out of memory, too.
            other = {"clouds": {"seed": 100 + passed, "resolution": 1024}, "sun": {"elevation_deg": 20 + passed}, "output": {"width": 64, "height": 48}}
            assert daemon.render(other, Cache_Control="no-cache").status == 200
            passed += long.is_alive()
        long.join()
        if passed >= 2:
            break
    assert passed >= 2
    assert answers["long"].status == 200 and answers["long"].body == daemon.render(scene, Cache_Control="no-cache").body


def test_references_wait_for_each_other(daemon):
    """Two at a time end both, and one that is too late is told so."""
    scene = scene_of({"samples": 30}, width=48, height=32)
    answers = {}
    threads = [threading.Thread(target=lambda i=i: answers.update({i: daemon.render({**scene, "sun": {"elevation_deg": 30 + i}})})) for i in range(3)]
    for thread in threads:
        thread.start()
    late = daemon.render({**scene, "model": {**scene["model"], "samples": 65536}}, X_Timeout_Ms="700")
    for thread in threads:
        thread.join()
    assert late.status == 504 or late.json["type"] == "urn:stratus:problem:predicted-late"
    assert all(answers[i].status == 200 for i in range(3))
