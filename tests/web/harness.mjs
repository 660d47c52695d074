/** A daemon of its own on a free port, Chromium, and what tests of the page have in common. Nothing here waits for time: only for what is to happen. */
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { mkdtempSync, openSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { createInterface } from "node:readline";
import { after, before, test } from "node:test";

const BUILD = resolve(process.env.STRATUS_BUILD ?? "build");
const require = createRequire(join(resolve(process.env.STRATUS_WEB_MODULES ?? "build/web-test"), "node_modules", "x.js"));
const { chromium } = require("playwright-core");
export const AXE = require.resolve("axe-core/axe.min.js");

/** A picture is there in a tenth of a second on an idle machine; on a busy one that draws by software it may take much longer. */
export const PATIENCE = Number(process.env.PATIENCE ?? 180000);
export const DESKTOP = { width: 1100, height: 600 };
export const PHONE = { width: 390, height: 844 };

export class Daemon {
	/** @param {string[]} flags */
	static async start(...flags) {
		const daemon = new Daemon();
		daemon.folder = mkdtempSync(join(tmpdir(), "stratus-web-"));
		const log = openSync(join(daemon.folder, "log"), "w");
		const all = ["--listen", "127.0.0.1:0", "--state-dir", join(daemon.folder, "state"), "--kernel", "build/mie.kernel", "--timeout-ms", String(PATIENCE), ...flags];
		daemon.process = spawn(join(BUILD, "stratusd"), all, { stdio: ["ignore", "pipe", log] });
		for await (const line of createInterface({ input: daemon.process.stdout })) {
			daemon.url = line.match(/listening on (\S+)/)?.[1];
			if (daemon.url)
				return daemon;
		}
		throw new Error(`the daemon did not start; see ${daemon.folder}/log`);
	}

	async stop() {
		const ended = new Promise((done) => this.process.once("exit", done));
		this.process.kill();
		await ended;
		rmSync(this.folder, { recursive: true, force: true });
	}
}

/** Chromium will not have its sandbox as root, which is who runs tests in containers. */
export const launch = () => chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: process.getuid() === 0 ? ["--no-sandbox"] : [] });

/** A page as a person has it open: with what it asked for and what went wrong. */
export class Visit {
	/** @param {import("playwright-core").Browser} browser  @param {Daemon} daemon  @param {object} [context] of playwright */
	static async open(browser, daemon, hash = "", context = {}) {
		const visit = new Visit();
		visit.context = await browser.newContext({ viewport: DESKTOP, ...context });
		visit.page = await visit.context.newPage();
		visit.page.setDefaultTimeout(PATIENCE);
		visit.wrong = [];
		visit.asked = [];
		visit.page.on("console", (message) => message.type() === "error" && visit.wrong.push(message.text()));
		visit.page.on("pageerror", (error) => visit.wrong.push(String(error)));
		visit.page.on("request", (request) => visit.asked.push(request.url()));
		visit.daemon = daemon;
		visit.hash = hash;
		return visit;
	}

	async load() {
		await this.page.goto(`${this.daemon.url}/${this.hash}`);
		return this;
	}

	/** Waits for a function in the page to come true. */
	until(condition, argument) {
		return this.page.waitForFunction(condition, argument, { timeout: PATIENCE, polling: 50 });
	}

	/** Until the picture at full size shows a scene whose members include these, and nothing is in work. */
	rests(wanted = {}) {
		return this.until((wanted) => {
			const { shows, working, scene } = document.getElementById("stage").dataset;
			const shown = JSON.parse(scene ?? "{}");
			const holds = ([path, value]) => JSON.stringify(path.split(".").reduce((inner, name) => inner?.[name], shown)) === JSON.stringify(value);
			return shows === "full" && working === "" && Object.entries(wanted).every(holds);
		}, wanted);
	}

	/** Values of pixels of a canvas, one in seventeen. */
	pixels(canvas = "#picture") {
		return this.page.$eval(canvas, (element) => [...element.getContext("2d").getImageData(0, 0, element.width, element.height).data].filter((_, i) => i % 17 === 0));
	}

	/** Addresses of renders that were asked for, newest last. */
	get renders() {
		return this.asked.filter((url) => url.includes("/v1/render?") && !url.includes("output.width=176&"));
	}

	async tab(name) {
		await this.page.click(`#tab-${name}`);
	}

	/** Types into the number of a member. */
	async enter(path, value) {
		const input = this.page.locator(`#field-${path.replaceAll(/[._]/g, "-")}`);
		await input.fill(String(value));
		await input.press("Enter");
	}

	close() {
		return this.context.close();
	}
}

/**
 * Runs a file's tests: `check` names one, which is given a page that is open and at rest; nothing may have gone wrong in it by its end but what it took
 * off `wrong`. Everything is closed whatever happens.
 */
export function suite() {
	const has = { daemon: null, browser: null };
	before(async () => {
		has.daemon = await Daemon.start();
		has.browser = await launch();
	});
	after(async () => {
		await has.browser?.close();
		await has.daemon?.stop();
	});
	const open = async (t, hash, context, daemon = has.daemon) => {
		const visit = await Visit.open(has.browser, daemon, hash, context);
		t.after(() => visit.close());
		return visit.load();
	};
	const check = (name, hash, body, context) =>
		test(name, async (t) => {
			const visit = await open(t, hash, context);
			await visit.rests();
			await body(visit, t);
			assert.deepEqual(visit.wrong, []);
		});
	return { has, open, check };
}

/** Mean absolute difference of two pictures in codes. */
export function difference(a, b) {
	if (a.length !== b.length)
		return Infinity;
	let sum = 0;
	for (let i = 0; i < a.length; i++)
		sum += Math.abs(a[i] - b[i]);
	return sum / a.length;
}
