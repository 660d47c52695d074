"""What /metrics says, read by Prometheus's own parser of OpenMetrics, and against what was asked for."""
import resource
import time

from prometheus_client.openmetrics.parser import text_string_to_metric_families

from conftest import send, wait_for

SMALL = {"output": {"width": 32, "height": 24}}
CACHED = ["optics", "sky", "field", "radiosity", "view"]


class Scrape:
    def __init__(self, daemon):
        text = daemon.get("/metrics").body.decode()
        self.families = {family.name: family for family in text_string_to_metric_families(text)}

    def __call__(self, name, **labels):
        """The value of one sample; 0 when it is not there."""
        found = [s.value for f in self.families.values() for s in f.samples if s.name == "stratus_" + name and s.labels == labels]
        assert len(found) <= 1
        return found[0] if found else 0.0


def test_openmetrics(daemon):
    daemon.render(SMALL)
    scrape = Scrape(daemon)
    for name, family in scrape.families.items():
        assert name.startswith("stratus_")
        assert family.documentation and family.documentation.endswith(".")
        assert family.samples, name
        assert family.type in ("counter", "gauge", "histogram", "info")
    assert scrape.families["stratus_gl"].samples[0].labels.keys() == {"vendor", "renderer", "version", "software"}


def test_pictures_are_counted_by_pixels(daemon):
    before = Scrape(daemon)
    daemon.render(SMALL)
    layers = ["color", "order1", "transmittance"]
    daemon.render({"output": {"width": 320, "height": 200, "format": "exr", "layers": layers}})
    daemon.render("{")
    after = Scrape(daemon)
    counted = lambda name, **labels: after(name, **labels) - before(name, **labels)
    assert counted("picture_pixels_count") == 2
    assert counted("picture_pixels_sum") == 32 * 24 + 3 * 320 * 200
    assert counted("picture_pixels_bucket", le="1000.0") == 1
    assert counted("picture_pixels_bucket", le="200000.0") == 2
    assert after("queue_pixels") == 0


def test_waiting_pixels(start_faulty):
    """Pictures behind one that renders are counted until they leave the queue."""
    daemon = start_faulty()
    with daemon.busy():
        clients = [send(daemon, {"clouds": {"seed": i}, "output": {"width": 160, "height": 120}}) for i in range(3)]
        assert wait_for(lambda: daemon.metric("stratus_queue_depth") == 3)
        assert Scrape(daemon)("queue_pixels") == 3 * 160 * 120
        clients.pop().close()
        assert wait_for(lambda: daemon.metric("stratus_queue_depth") == 2)
        assert Scrape(daemon)("queue_pixels") == 2 * 160 * 120
    assert all(client.recv(12) == b"HTTP/1.1 200" for client in clients)
    assert Scrape(daemon)("queue_pixels") == 0


def test_stages_taken_from_memory(daemon):
    scene = {**SMALL, "clouds": {"seed": 77007}}
    daemon.render(scene)
    before = Scrape(daemon)
    daemon.render({**scene, "camera": {"azimuth_deg": 20}})
    after = Scrape(daemon)
    for stage in ("optics", "sky", "field", "radiosity"):
        assert after("stage_reused_total", stage=stage) == before("stage_reused_total", stage=stage) + 1
        assert after("stage_duration_seconds_count", stage=stage) == before("stage_duration_seconds_count", stage=stage)
    assert after("stage_reused_total", stage="view") == before("stage_reused_total", stage="view")
    assert after("stage_duration_seconds_count", stage="view") == before("stage_duration_seconds_count", stage="view") + 1
    assert after("stage_duration_seconds_sum", stage="view") > before("stage_duration_seconds_sum", stage="view")


def test_gpu_memory(start_daemon):
    """A new field takes memory; with a small bound the memory stays below it and what a frame needs."""
    daemon = start_daemon("--cache-mb", "32")
    scene = {**SMALL, "clouds": {"resolution": 1024}}
    before = Scrape(daemon)
    assert before("gpu_memory_limit_bytes") == 32 << 20
    assert all(before("gpu_memory_bytes", stage=stage) > 0 for stage in CACHED) # of the frames that warm up
    daemon.render(scene)
    first = Scrape(daemon)
    # Of height and what comes with it at least one float a cell.
    assert first("gpu_memory_bytes", stage="field") >= before("gpu_memory_bytes", stage="field") + 4 * (1024**2 - 512**2)
    for seed in range(1, 5):
        daemon.render({**scene, "clouds": {"resolution": 1024, "seed": seed}})
    last = Scrape(daemon)
    total = lambda scrape: sum(scrape("gpu_memory_bytes", stage=stage) for stage in CACHED)
    assert total(last) <= total(first) + (32 << 20)


def test_bytes_and_problems(start_daemon):
    daemon = start_daemon("--asset-count", "0")
    pictures = sum(len(daemon.render(scene).body) for scene in (SMALL, SMALL, '{"x": 1}'))
    daemon.get("/v1/render", Accept="text/html")
    daemon.request("PUT", "/v1/assets/a", b"x")
    daemon.request("POST", "/v1/render", b" " * (2 << 20), {"Content-Type": "application/json"})
    daemon.render(SMALL, X_Timeout_Ms="x")
    daemon.render({"clouds": {"seed": 4}, "output": {"width": 4096, "height": 4096}}, X_Timeout_Ms="1")
    daemon.settle()
    scrape = Scrape(daemon)
    assert scrape("response_bytes_total", route="/v1/render") > pictures
    wanted = {"invalid-scene": 1, "not-acceptable": 1, "storage-full": 1, "body-too-large": 1, "bad-request": 1, "deadline-passed": 1}
    counted = {s.labels["type"]: s.value for s in scrape.families["stratus_problems"].samples if s.value}
    assert counted == wanted
    assert scrape("renders_ended_total", reason="expired") == 1


def test_process(start_daemon):
    began = time.time()
    daemon = start_daemon()
    before = Scrape(daemon)
    daemon.render({"output": {"width": 512, "height": 512}, "clouds": {"seed": 3}})
    held = [daemon.connect() for _ in range(5)]
    for connection in held:
        connection.request("GET", "/healthz")
        connection.getresponse().read()
    after = Scrape(daemon)
    assert after("ready") == 1
    assert after("process_open_fds") >= before("process_open_fds") + len(held)
    assert after("process_max_fds") == resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    assert after("process_cpu_seconds_total") > before("process_cpu_seconds_total") > 0
    assert began - 1 < after("process_start_time_seconds") < time.time() + 1
    for connection in held:
        connection.close()
