/** Frames one after the other, each asked for when the one before it is there: clouds that drift, or the sun over a day. */
import { nextSun } from "./night.js";

const SHORTEST_MS = 60;

export class Animation {
	/** @type {AbortController | null} */
	#playing = null;

	/**
	 * @param {import("../scene/scene.js").Scene} scene
	 * @param {HTMLElement} bar
	 * @param {{draw: (signal: AbortSignal) => Promise<void>, begin: () => void, end: () => void, failed: (error: Error) => void, place: () => void}} stage
	 */
	constructor(scene, bar, stage) {
		this.scene = scene;
		this.stage = stage;
		this.button = bar.querySelector("#play");
		this.what = bar.querySelector("#play-what");
		this.button.addEventListener("click", () => (this.#playing ? this.stop() : this.play()));
	}

	get playing() {
		return this.#playing !== null;
	}

	async #step(signal) {
		const [what, by] = this.what.value.split(":");
		if (what === "sun")
			await this.#moveSun(Number(by), signal);
		else
			this.scene.set({ "clouds.time_s": (this.scene.value("clouds.time_s") + Number(by)) % 1e7 }, { moving: true });
	}

	async #moveSun(minutes, signal) {
		if (!this.scene.isByPlace)
			return this.stop();
		const from = this.scene.value("sun.time");
		const time = await nextSun(this.scene, minutes, signal);
		signal.throwIfAborted();
		/* Whoever has set another time, or the sun by hand, meanwhile has the word. */
		if (this.scene.value("sun.time") === from)
			this.scene.set({ "sun.time": time }, { moving: true });
	}

	async play() {
		const { signal } = (this.#playing = new AbortController());
		this.#look(true);
		this.stage.begin();
		if (this.what.value.startsWith("sun"))
			this.stage.place();
		try {
			while (!signal.aborted) {
				const began = performance.now();
				await this.#step(signal);
				await this.stage.draw(signal);
				await new Promise((done) => setTimeout(done, Math.max(SHORTEST_MS - (performance.now() - began), 0)));
			}
		} catch (error) {
			if (!signal.aborted)
				this.stage.failed(error);
		}
		this.#playing = null;
		this.#look(false);
		this.stage.end();
	}

	stop() {
		this.#playing?.abort();
	}

	#look(playing) {
		this.button.setAttribute("aria-pressed", String(playing));
		this.button.querySelector(".word").textContent = playing ? "Pause" : "Play";
	}
}
