/** For everyone: who uses other senses, and who needs a key. */
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { test } from "node:test";
import { AXE, Daemon, PHONE, suite } from "./harness.mjs";

const { open, check } = suite();

/** What axe finds wrong, with where. */
const audit = async (page) =>
	(await page.evaluate(() => window.axe.run(document, { resultTypes: ["violations"] }))).violations.map(({ id, nodes }) => `${id}: ${nodes.map(({ target }) => target.join(" ")).join(", ")}`);

for (const [name, context] of [
	["light", { colorScheme: "light", bypassCSP: true }],
	["dark", { colorScheme: "dark", bypassCSP: true }],
	["a phone", { viewport: PHONE, isMobile: true, hasTouch: true, bypassCSP: true }],
])
	check(`axe finds nothing wrong: ${name}`, "#ground.type=lambert", async (visit) => {
		await visit.page.addScriptTag({ path: AXE });
		for (const tab of ["sun", "clouds", "droplets", "ground", "camera", "layers", "share"]) {
			await visit.tab(tab);
			assert.deepEqual(await audit(visit.page), [], tab);
		}
		await visit.page.selectOption("#compare", "radiosity");
		await visit.rests();
		await visit.tab("sun");
		await visit.page.locator("text=By time and place").click();
		await visit.until(() => document.getElementById("sun-stands").textContent !== "");
		assert.deepEqual(await audit(visit.page), [], "comparing, by time and place");
	}, context);

check("tabs by keys, and what is chosen is told", "", async (visit) => {
	await visit.page.focus("#tab-sun");
	await visit.page.keyboard.press("ArrowRight");
	assert.equal(await visit.page.evaluate(() => document.activeElement.id), "tab-clouds");
	assert.ok(await visit.page.isVisible("#panel-clouds"));
	assert.ok(await visit.page.isHidden("#panel-sun"));
	await visit.until(() => /Picture of \d+ by \d+ pixels/.test(document.getElementById("status").textContent));
	assert.match(await visit.page.getAttribute("#sun-handle", "aria-valuetext"), /elevation 35.0°, azimuth 140.0°, south-east/);
});

check("the theme is switched, and kept", "", async (visit) => {
	const ground = () => visit.page.evaluate(() => getComputedStyle(document.body).backgroundColor);
	const light = await ground();
	await visit.page.click("#theme");
	const dark = await ground();
	assert.notEqual(dark, light);
	await visit.page.reload();
	await visit.until((dark) => getComputedStyle(document.body).backgroundColor === dark, dark);
	await visit.rests();
}, { colorScheme: "light" });

test("a key is asked for, and used for pictures and presets", async (t) => {
	const folder = mkdtempSync(join(tmpdir(), "stratus-keys-"));
	t.after(() => rmSync(folder, { recursive: true }));
	const file = join(folder, "keys");
	const build = process.env.STRATUS_BUILD ?? "build";
	const [key, line] = execFileSync(join(build, "stratusd"), ["--new-key", "page"], { encoding: "utf8", stdio: ["ignore", "pipe", "ignore"] }).split("\n");
	writeFileSync(file, `${line}\n`, { mode: 0o600 });
	const guarded = await Daemon.start("--keys", file);
	t.after(() => guarded.stop());
	const visit = await open(t, "", {}, guarded);
	await visit.until(() => document.getElementById("key-dialog").open);
	await visit.page.fill("#key", "wrong");
	await visit.page.press("#key", "Enter");
	await visit.page.waitForSelector("#key-dialog .wrong:not([hidden])");
	await visit.page.fill("#key", key);
	await visit.page.click("#key-use");
	await visit.rests();
	await visit.until(() => document.querySelector("#presets .thumb img"));
	await visit.tab("share");
	assert.match(await visit.page.inputValue("#share-curl"), /\$STRATUS_API_KEY/);
	assert.ok(!(await visit.page.inputValue("#share-address")).includes(key));
	assert.deepEqual(visit.wrong.filter((text) => !text.includes("401")), []);
});
