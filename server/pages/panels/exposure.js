/** The exposure: by the service when it is automatic, else in the browser, on the light of the picture that is shown, without another render. */
import { FIELDS } from "../scene/fields.js";
import { latest } from "../service/latest.js";

const FIELD = FIELDS.get("output.exposure_ev");
/** Where the slider begins when the service has not said its own. */
const SUNNY = -4;

export class Exposure {
	#frame = 0;

	/**
	 * @param {import("../scene/scene.js").Scene} scene
	 * @param {import("../picture/viewer.js").Viewer} viewer
	 * @param {HTMLElement} bar
	 * @param {import("../picture/loop.js").RenderLoop} loop
	 * @param {(error: Error) => void} failed
	 */
	constructor(scene, viewer, bar, loop, failed) {
		this.scene = scene;
		this.viewer = viewer;
		this.loop = loop;
		this.auto = bar.querySelector("#exposure-auto");
		this.slider = bar.querySelector("#exposure");
		this.shown = bar.querySelector("#exposure-value");
		Object.assign(this.slider, { min: FIELD.low, max: FIELD.high, step: FIELD.step });
		this.light = latest(async (_, signal) => {
			await viewer.fetchLight(signal);
			if (loop.rests)
				viewer.developLight();
		}, failed);
		this.auto.addEventListener("change", () => this.#switch());
		this.slider.addEventListener("input", () => this.scene.set({ "output.exposure_ev": Number(this.slider.value) }, { moving: true }));
		this.#follow();
	}

	/** A picture was drawn with this exposure. */
	drawn(ev) {
		if (this.scene.value("output.exposure_ev") === "auto")
			this.automatic = ev;
		this.#follow();
	}

	#switch() {
		if (this.auto.checked)
			this.scene.set({ "output.exposure_ev": "auto" });
		else
			this.scene.set({ "output.exposure_ev": Number((this.automatic ?? SUNNY).toFixed(1)) });
	}

	#follow() {
		const ev = this.scene.value("output.exposure_ev");
		this.auto.checked = ev === "auto";
		const value = ev === "auto" ? this.automatic : ev;
		if (value !== undefined)
			this.slider.value = String(value);
		this.shown.textContent = value === undefined ? "auto" : `${value > 0 ? "+" : ""}${value.toFixed(1)} EV`.replace("-", "−");
		this.slider.setAttribute("aria-valuetext", this.shown.textContent);
	}

	/**
	 * Takes a change on.
	 * @param {Set<string> | null} paths what changed
	 * @returns {boolean} whether that was all: no render is needed
	 */
	takes(paths) {
		const mine = (path) => path === "output.exposure_ev" || path === "output.tone";
		this.#follow();
		if (!paths?.size || ![...paths].every(mine) || !this.loop.rests || this.viewer.layer !== "color" || this.viewer.other)
			return false;
		this.#develop();
		return true;
	}

	#develop() {
		cancelAnimationFrame(this.#frame);
		this.#frame = requestAnimationFrame(() => this.loop.rests && (this.viewer.developLight() || this.light.want(null)));
	}
}
