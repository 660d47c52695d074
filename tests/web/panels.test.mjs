/** What stands around the picture: droplets, exposure, comparison, layers, time, files. */
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { PATIENCE, difference, suite } from "./harness.mjs";

const { has, check } = suite();

check("droplets are drawn as their sliders move, glory and fogbow marked", "#dsd.gamma=20&dsd.effective_radius_um=10", async (visit) => {
	await visit.tab("droplets");
	await visit.until(() => document.querySelectorAll("#figure-back .mark-text").length === 2);
	const marks = await visit.page.$$eval("#figure-back .mark-text", (texts) => texts.map((text) => text.textContent));
	const optics = await (await fetch(`${has.daemon.url}/v1/optics?dsd.gamma=20&dsd.effective_radius_um=10`)).json();
	const { angle_deg: angles, value } = optics.phase_function;
	const bow = angles.reduce((best, angle, i) => (angle > 130 && angle < 155 && value[1][i] > value[1][best] ? i : best), angles.findIndex((a) => a > 130));
	assert.match(marks[0], new RegExp(`^fogbow ${Math.round(angles[bow])}°$`));
	assert.ok(Number(marks[1].match(/^glory ([\d.]+)°$/)[1]) > 174);
	const polar = await visit.page.getAttribute("#figure-polar path.band", "d");
	const sizes = await visit.page.getAttribute("#figure-sizes path.curve", "d");
	assert.equal(await visit.page.textContent("[data-fact='Free path']"), `${Number((1 / optics.extinction_per_m[1]).toPrecision(3))} m`);
	await visit.page.locator("#field-dsd-effective-radius-um-slider").press("PageUp");
	await visit.until((before) => document.querySelector("#figure-polar path.band").getAttribute("d") !== before, polar);
	assert.notEqual(await visit.page.getAttribute("#figure-sizes path.curve", "d"), sizes);
	await visit.rests();
});

check("liquid water is what the service takes it for", "", async (visit) => {
	await visit.tab("droplets");
	await visit.enter("dsd.effective_radius_um", 20);
	await visit.enter("dsd.n0_per_cm3", 100);
	await visit.rests({ "dsd.n0_per_cm3": 100 });
	/* 4/3 pi rho N0 rn^3 gamma (gamma + 1)(gamma + 2), rn = 5 um. */
	assert.equal(await visit.page.textContent("[data-fact='Liquid water']"), "1.26 g/m³");
});

check("the exposure is changed without a render, to the picture that the service makes", "#output.exposure_ev=-4.5", async (visit) => {
	const service = await visit.pixels();
	/* The light is fetched once, here by a click that measures. */
	await visit.page.locator("#stage").click();
	await visit.until(() => /cd\/m²$/.test(document.getElementById("stage-help").textContent));
	const count = visit.renders.length;
	const slider = visit.page.locator("#exposure");
	await slider.fill("-2.5");
	await visit.until((before) => {
		const canvas = document.getElementById("picture");
		const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
		return before.reduce((sum, v, i) => sum + Math.abs(v - data[17 * i]), 0) / before.length > 10;
	}, service);
	await slider.fill("-4.5");
	await visit.page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
	const browsers = await visit.pixels();
	assert.ok(difference(service, browsers) < 0.75, "each pixel within the noise that hides the steps of eight bits");
	/* One value in seventeen: the channels take turns. */
	for (const channel of [0, 1, 2]) {
		const off = browsers.map((v, i) => v - service[i]).filter((_, i) => i % 4 === channel);
		const mean = off.reduce((sum, v) => sum + v, 0) / off.length;
		assert.ok(Math.abs(mean) < 0.25, `codes of channel ${channel} off: ${mean}`);
	}
	assert.equal(visit.renders.length, count, "nothing was rendered for it");
});

check("two pictures are compared", "", async (visit) => {
	await visit.page.selectOption("#compare", "paper");
	await visit.until(() => document.getElementById("other").width > 480);
	await visit.rests();
	assert.ok(visit.renders.some((url) => url.includes("model.shading=paper")));
	assert.ok(difference(await visit.pixels("#picture"), await visit.pixels("#other")) > 0.5);
	const divider = visit.page.locator("#divider");
	await divider.press("ArrowLeft");
	assert.equal(await divider.getAttribute("aria-valuenow"), "48");
	const box = await visit.page.locator("#stage").boundingBox();
	const handle = await divider.boundingBox();
	await visit.page.mouse.move(handle.x + handle.width / 2, handle.y + handle.height / 2);
	await visit.page.mouse.down();
	await visit.page.mouse.move(box.x + box.width * 0.75, handle.y + handle.height / 2, { steps: 3 });
	await visit.page.mouse.up();
	await visit.until(() => Number(document.getElementById("divider").getAttribute("aria-valuenow")) > 65);
	assert.equal(await visit.page.inputValue("#field-camera-azimuth-deg"), "140", "the camera stays");
	await visit.page.selectOption("#compare", "kept");
	await visit.enter("sun.elevation_deg", 10);
	await visit.rests({ "sun.elevation_deg": 10 });
	assert.ok(difference(await visit.pixels("#picture"), await visit.pixels("#other")) > 3, "the kept scene stays as it was");
});

check("a kept scene of another projection keeps its shape", "#camera.projection=fisheye", async (visit) => {
	const shapes = () => visit.page.$$eval("#picture, #other", (panes) => panes.map(({ width, height }) => Number((width / height).toFixed(1))));
	await visit.page.selectOption("#compare", "kept");
	await visit.tab("camera");
	await visit.page.selectOption("#field-camera-projection", "perspective");
	await visit.rests();
	assert.deepEqual(await shapes(), [1.6, 1]);
	assert.equal(await visit.page.locator("#tabs .bad").count(), 0);
	await visit.page.selectOption("#compare", "");
	await visit.page.selectOption("#compare", "kept");
	await visit.page.selectOption("#field-camera-projection", "fisheye");
	await visit.rests({ "camera.projection": "fisheye" });
	assert.deepEqual(await shapes(), [1, 1.6]);
});

check("layers are shown, all small and one large", "", async (visit) => {
	await visit.tab("layers");
	await visit.until(() => [...document.querySelectorAll("#layers canvas")].every(({ width }) => width === 176));
	await visit.page.locator("label[for=layer-optical_thickness]").click();
	await visit.until(() => !document.getElementById("scale").hidden);
	await visit.rests();
	assert.ok(Number(await visit.page.textContent("#scale .to")) > 1);
	await visit.page.locator("label[for=layer-color]").click();
	await visit.until(() => document.getElementById("scale").hidden);
	await visit.rests();
});

check("a preset is taken over", "", async (visit) => {
	await visit.until(() => document.querySelector("[data-preset=snow-radiosity]"));
	await visit.page.click("[data-preset=snow-radiosity]");
	const preset = JSON.parse(readFileSync("server/presets/snow-radiosity.json", "utf8")).scene;
	await visit.rests({ "sun.elevation_deg": preset.sun.elevation_deg, "ground.type": preset.ground.type });
	await visit.until(() => document.querySelectorAll("#presets .thumb img").length > 1);
});

check("panoramas are shown whole", "", async (visit) => {
	await visit.tab("camera");
	await visit.page.selectOption("#field-camera-projection", "equirectangular");
	await visit.rests({ "camera.projection": "equirectangular" });
	const [width, height] = (await visit.page.getAttribute("#stage", "data-size")).split("x").map(Number);
	assert.equal(width, 2 * height);
	await visit.page.selectOption("#field-camera-projection", "perspective");
	await visit.rests();
});

check("the sun stands where time and place have it", "", async (visit) => {
	await visit.page.locator("text=By time and place").click();
	await visit.page.selectOption("#sun-place", { label: "Sydney" });
	await visit.page.fill("#sun-date", "2026-01-15");
	await visit.page.fill("#sun-clock", "12:00");
	await visit.rests({ "sun.time": "2026-01-15T12:00:00+10:00", "sun.latitude_deg": -33.87 });
	const sun = await (await fetch(`${has.daemon.url}/v1/sun?time=2026-01-15T02:00:00Z&latitude_deg=-33.87&longitude_deg=151.21`)).json();
	const text = `The sun stands ${sun.elevation_deg.toFixed(1)}° above the horizon, at azimuth ${sun.azimuth_deg.toFixed(1)}°.`;
	await visit.until((text) => document.getElementById("sun-stands").textContent === text, text);
	await visit.until(() => document.querySelectorAll("#dome .hours circle").length > 10);
	await visit.page.locator("text=By hand").click();
	await visit.rests({ "sun.elevation_deg": Number(sun.elevation_deg.toFixed(1)) });
});

check("time goes on while it plays, and stops", "", async (visit) => {
	await visit.page.click("#play");
	await visit.until(() => (JSON.parse(document.getElementById("stage").dataset.scene).clouds?.time_s ?? 0) >= 30);
	await visit.page.click("#play");
	await visit.rests();
	const time = Number(await visit.page.inputValue("#field-clouds-time-s"));
	assert.ok(time >= 30 && time % 10 === 0);
	assert.equal(await visit.page.getAttribute("#play", "aria-pressed"), "false");
});

check("the sun that plays goes over the night to the next dawn", "#sun.time=2026-06-21T20:30:00Z&sun.latitude_deg=45.19&sun.longitude_deg=5.72", async (visit) => {
	await visit.page.selectOption("#play-what", "sun:5");
	await visit.page.click("#play");
	await visit.until(() => JSON.parse(document.getElementById("stage").dataset.scene).sun.time.startsWith("2026-06-22"));
	await visit.page.click("#play");
	await visit.rests();
});

async function download(visit, file) {
	const waiting = visit.page.waitForEvent("download");
	await visit.page.click(`[data-file=${file}]`);
	const got = await waiting;
	return { name: got.suggestedFilename(), bytes: readFileSync(await got.path()) };
}

check("files are taken away", "#output.width=64&output.height=40", async (visit) => {
	await visit.tab("share");
	const png = await download(visit, "png");
	assert.equal(png.name, "sky.png");
	assert.equal(png.bytes.readUInt32BE(16), 64, "as wide as was asked for");
	const exr = await download(visit, "layers");
	assert.equal(exr.bytes.readUInt32LE(0), 0x01312f76);
	assert.ok(exr.bytes.includes("optical_thickness.Y"));
	/* A panorama of its own size: what is asked for, and that it is saved; the service draws a small one. */
	let asked;
	await visit.page.route((url) => url.searchParams.get("camera.projection") === "equirectangular", (route) => {
		asked = new URL(route.request().url());
		route.continue({ url: asked.href.replace("output.width=2048", "output.width=64") });
	});
	const hdri = await download(visit, "hdri2k");
	assert.deepEqual(["output.format", "output.width"].map((name) => asked.searchParams.get(name)), ["exr", "2048"]);
	assert.ok(hdri.bytes.includes("envmap"));
});

test("a picture by an address alone, in any page", async (t) => {
	const context = await has.browser.newContext();
	t.after(() => context.close());
	const page = await context.newPage();
	await page.setContent(`<img src="${has.daemon.url}/v1/render?sun.elevation_deg=8&amp;output.width=160&amp;output.height=100" alt="A low sun">`);
	await page.waitForFunction(() => document.images[0].naturalWidth === 160, null, { timeout: PATIENCE });
});
