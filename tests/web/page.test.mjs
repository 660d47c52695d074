/** The picture and its loop: what is asked for, when, and what is given up. */
import assert from "node:assert/strict";
import { difference, suite } from "./harness.mjs";

const { has, open, check } = suite();

const isFull = (url) => Number(url.searchParams.get("output.width")) > 480;
const isRender = (url) => url.pathname === "/v1/render" && url.searchParams.get("output.width") !== "176";

check("loads, of the service alone, and shows a picture", "", async (visit) => {
	const pixels = await visit.pixels();
	assert.ok(new Set(pixels).size > 100, "a picture has many values");
	assert.deepEqual(visit.asked.filter((url) => !url.startsWith(has.daemon.url) && !url.startsWith("blob:")), []);
	await visit.until(() => document.querySelector("#timing-list .stage-view b").textContent.endsWith(" ms"));
	await visit.until(() => document.querySelectorAll("#timing-bar span").length > 1);
	await visit.until(() => document.querySelectorAll("#presets img").length > 0);
});

check("the sun is dragged, and the picture follows", "", async (visit) => {
	const before = await visit.pixels();
	const dome = await visit.page.locator("#dome").boundingBox();
	const at = (x, y) => [dome.x + (dome.width * (124 + x)) / 248, dome.y + (dome.height * (124 + y)) / 248];
	await visit.page.mouse.move(...at(42, 47));
	await visit.page.mouse.down();
	await visit.page.mouse.move(...at(0, 50), { steps: 4 });
	await visit.page.mouse.move(...at(-35, -35), { steps: 4 });
	await visit.until(() => JSON.parse(document.getElementById("stage").dataset.scene).sun?.azimuth_deg > 300);
	await visit.page.mouse.up();
	const [azimuth, elevation] = await Promise.all(["azimuth", "elevation"].map((name) => visit.page.inputValue(`#field-sun-${name}-deg`).then(Number)));
	await visit.rests({ "sun.azimuth_deg": azimuth });
	assert.ok(Math.abs(azimuth - 315) < 2, `up and left is north-west, not ${azimuth}`);
	assert.ok(Math.abs(elevation - 45.5) < 1.5, `half way to the horizon is 45 degrees, not ${elevation}`);
	assert.ok(difference(before, await visit.pixels()) > 3);
	await visit.page.locator("#sun-handle").press("Shift+ArrowRight");
	await visit.rests({ "sun.azimuth_deg": Number((azimuth + 10).toFixed(1)) });
});

check("the camera is turned by dragging, by the wheel and by keys", "", async (visit) => {
	const stage = await visit.page.locator("#stage").boundingBox();
	const middle = [stage.x + stage.width / 2, stage.y + stage.height / 2];
	await visit.page.mouse.move(...middle);
	await visit.page.mouse.down();
	await visit.page.mouse.move(middle[0] - stage.height / 2, middle[1], { steps: 5 });
	await visit.page.mouse.up();
	await visit.rests();
	const azimuth = Number(await visit.page.inputValue("#field-camera-azimuth-deg"));
	assert.ok(Math.abs(azimuth - (140 + 30 / Math.cos((20 * Math.PI) / 180))) < 0.5, `half a field of view to the right, not ${azimuth}`);
	const stageElement = visit.page.locator("#stage");
	await stageElement.press("ArrowUp");
	await visit.rests({ "camera.elevation_deg": 22 });
	await stageElement.press("r");
	await visit.rests({ "camera.position_m": [0, 0, 2.5] });
	await visit.page.mouse.wheel(0, -400);
	await visit.until(() => JSON.parse(document.getElementById("stage").dataset.scene).camera.vertical_fov_deg < 50);
});

check("a picture at full size is given up when something changes", "", async (visit) => {
	await visit.page.route((url) => isRender(url) && isFull(url) && url.searchParams.get("sun.elevation_deg") === "20", () => {}); /* never answered */
	const isStale = (request) => isFull(new URL(request.url())) && request.url().includes("sun.elevation_deg=20");
	const asked = visit.page.waitForRequest(isStale);
	await visit.enter("sun.elevation_deg", 20);
	await asked;
	const aborted = visit.page.waitForEvent("requestfailed", isStale);
	await visit.enter("sun.elevation_deg", 50);
	assert.match((await aborted).failure().errorText, /ERR_ABORTED/);
	await visit.rests({ "sun.elevation_deg": 50 });
});

check("quick pictures do not queue: after the one in work comes the newest", "", async (visit) => {
	let release;
	const held = new Promise((done) => (release = done));
	await visit.page.route((url) => isRender(url) && url.searchParams.get("sun.elevation_deg") === "20", async (route) => {
		await held;
		await route.continue();
	});
	await visit.enter("sun.elevation_deg", 20);
	await visit.until(() => document.getElementById("stage").dataset.working === "quick");
	const count = visit.renders.length;
	for (const elevation of [30, 40, 50, 60])
		await visit.enter("sun.elevation_deg", elevation);
	/* What is asked for by now has been told: the page answers. */
	await visit.page.evaluate(() => new Promise(requestAnimationFrame));
	assert.equal(visit.renders.length, count, "one is in work, the others wait");
	release();
	await visit.rests({ "sun.elevation_deg": 60 });
	assert.deepEqual(visit.renders.slice(count).filter((url) => !url.includes("sun.elevation_deg=60")), [], "those between are never asked for");
});

check("a refusal is said beside the control, and is over when it is mended", "", async (visit) => {
	await visit.tab("camera");
	await visit.enter("camera.position_m.2", 1300);
	await visit.until(() => !document.querySelector("[data-path='camera.position_m.2'] .wrong").hidden);
	assert.match(await visit.page.textContent("[data-path='camera.position_m.2'] .wrong"), /inside the cloud layer/);
	assert.equal(await visit.page.getAttribute("#field-camera-position-m-2", "aria-invalid"), "true");
	assert.match(await visit.page.textContent("#notice"), /Height: .*inside the cloud layer/);
	await visit.enter("camera.position_m.2", 10);
	await visit.rests({ "camera.position_m": [0, 0, 10] });
	assert.ok(await visit.page.isHidden("#notice"));
	assert.ok(await visit.page.isHidden("[data-path='camera.position_m.2'] .wrong"));
	/* A browser reports refusals as errors of its own: these and no others. */
	visit.wrong = visit.wrong.filter((text) => !text.includes("422"));
});

check("a busy service is asked again when it says", "", async (visit) => {
	let refused = 0;
	await visit.page.route((url) => isRender(url) && url.searchParams.get("sun.elevation_deg") === "21", (route) =>
		refused++ ? route.continue() : route.fulfill({ status: 503, headers: { "Retry-After": "1" }, contentType: "application/problem+json", body: `{"title":"Busy","detail":"Too much to do."}` }));
	await visit.enter("sun.elevation_deg", 21);
	await visit.rests({ "sun.elevation_deg": 21 });
	assert.ok(refused > 1);
	visit.wrong = visit.wrong.filter((text) => !text.includes("503"));
});

check("a shared address restores the scene", "#sun.elevation_deg=12.5&sun.azimuth_deg=200&clouds.wind_mps=-4,7&camera.position_m=10,20,3&radiosity.enabled=false&ground.type=snow", async (visit, t) => {
	const wanted = { "sun.elevation_deg": 12.5, "sun.azimuth_deg": 200, "clouds.wind_mps": [-4, 7], "camera.position_m": [10, 20, 3], "radiosity.enabled": false, "ground.type": "snow" };
	await visit.rests(wanted);
	assert.equal(await visit.page.inputValue("#field-sun-elevation-deg"), "12.5");
	assert.equal(await visit.page.inputValue("#field-clouds-wind-mps-0"), "-4");
	assert.equal(await visit.page.inputValue("#field-ground-type"), "snow");
	assert.equal(await visit.page.isChecked("#field-radiosity-enabled"), false);
	const first = await visit.pixels();
	await visit.tab("share");
	const shared = await visit.page.inputValue("#share-address");
	const again = await open(t, shared.slice(shared.indexOf("#")));
	await again.rests(wanted);
	assert.equal(difference(first, await again.pixels()), 0, "the same scene is the same picture");
	const answer = await fetch(`${has.daemon.url}/v1/render`, { method: "POST", headers: { "Content-Type": "application/json" }, body: await visit.page.inputValue("#share-json") });
	assert.equal(answer.status, 200);
	assert.match(answer.headers.get("content-location"), /sun\.elevation_deg=12\.5/);
});

check("what is wrong in an address is told and left out", "#output.exposure_ev=foo&constructor.prototype=1&sun.elevation_deg=abc&camera.position_m=1&dsd.gamma=0&sun.time=noon&ground.type=snow", async (visit) => {
	await visit.rests({ "ground.type": "snow" });
	const notice = await visit.page.textContent("#notice");
	for (const path of ["output.exposure_ev", "constructor.prototype", "sun.elevation_deg", "camera.position_m", "dsd.gamma", "sun.time"])
		assert.ok(notice.includes(`${path} is no`), `${path} in: ${notice}`);
	assert.ok(await visit.page.isVisible("#notice"));
	assert.deepEqual(Object.keys(JSON.parse(await visit.page.getAttribute("#stage", "data-scene"))), ["ground"]);
	await visit.enter("sun.elevation_deg", 30);
	await visit.rests({ "sun.elevation_deg": 30 });
	assert.ok(await visit.page.isHidden("#notice"), "told until something is changed");
});

check("the address follows the scene", "", async (visit) => {
	await visit.enter("sun.elevation_deg", 66);
	await visit.until(() => location.hash.includes("sun.elevation_deg=66"));
});

check("a low screen begins at the top, and the picture covers no controls", "", async (visit) => {
	assert.equal(await visit.page.evaluate(() => scrollY), 0);
	await visit.tab("share");
	await visit.tab("sun");
	const covered = await visit.page.evaluate(() => {
		const dome = document.getElementById("dome");
		dome.scrollIntoView({ block: "start" });
		const { x, y, width } = dome.getBoundingClientRect();
		return document.elementFromPoint(x + width / 2, Math.max(y, 0) + 30).closest("#stage") !== null;
	});
	assert.ok(!covered);
}, { viewport: { width: 740, height: 360 } });

check("the page works on a phone", "", async (visit) => {
	const wide = await visit.page.evaluate(() => document.documentElement.scrollWidth);
	assert.ok(wide <= 390, `nothing is wider than the screen: ${wide}`);
	const stage = await visit.page.locator("#stage").boundingBox();
	assert.ok(stage.y < 100 && stage.width > 350, "the picture comes first, as wide as the screen");
	await visit.page.tap("#tab-droplets");
	await visit.until(() => document.querySelectorAll("#figure-polar path.band").length === 3);
	await visit.page.tap("#tab-sun");
	const dome = visit.page.locator("#dome");
	await dome.scrollIntoViewIfNeeded();
	const box = await dome.boundingBox();
	await visit.page.touchscreen.tap(box.x + box.width / 2, box.y + box.height * 0.8);
	await visit.until(() => JSON.parse(document.getElementById("stage").dataset.scene).sun?.azimuth_deg === 180);
}, { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true });
