/** What is where the pointer is: the direction, how far that is from the sun, and, after a click, how bright it is. */
import { between, directionAt } from "../scene/direction.js";
import { latest } from "../service/latest.js";

const angle = (value) => `${value.toFixed(1)}°`;
/** Where half precision ends, as the light is fetched; the sun's disc is beyond. */
const MOST = 65504e3;
const brightness = (luminance) => `${luminance > 0.99 * MOST ? "over " : ""}${luminance.toLocaleString("en", { maximumSignificantDigits: 3 })} cd/m²`;
/** A hand that moved less clicked. */
const STILL_PX = 4;

export class Probe {
	/** @type {MouseEvent | null} */
	#pointer = null;

	/**
	 * @param {import("../scene/scene.js").Scene} scene
	 * @param {import("./viewer.js").Viewer} viewer
	 * @param {HTMLElement} line
	 * @param {{sun: () => {azimuth: number, elevation: number}, failed: (error: Error) => void}} page
	 */
	constructor(scene, viewer, line, page) {
		this.scene = scene;
		this.viewer = viewer;
		this.line = line;
		this.page = page;
		this.help = [...line.childNodes];
		const { element } = viewer.stage;
		const light = latest(async (_, signal) => {
			await viewer.fetchLight(signal);
			this.#tell();
		}, page.failed);
		let down = null;
		element.addEventListener("pointerdown", (event) => (down = event));
		element.addEventListener("pointermove", (event) => {
			this.#pointer = event.pointerType === "mouse" ? event : null;
			this.#tell();
		});
		element.addEventListener("click", (event) => {
			if (!down || Math.hypot(event.clientX - down.clientX, event.clientY - down.clientY) > STILL_PX)
				return;
			this.#pointer = event;
			light.want(null);
		});
		element.addEventListener("pointerleave", () => {
			this.#pointer = null;
			line.replaceChildren(...this.help);
		});
	}

	#tell() {
		const place = this.#pointer && this.viewer.stage.placeOf(this.#pointer);
		const direction = place && directionAt(this.scene, 2 * place.x - 1, 1 - 2 * place.y);
		if (!direction)
			return;
		const luminance = this.viewer.luminanceAt(place);
		const parts = [`azimuth ${angle(direction.azimuth)}`, `elevation ${angle(direction.elevation)}`, `${angle(between(direction, this.page.sun()))} from the sun`];
		parts.push(luminance === null ? "click to measure its luminance" : brightness(luminance));
		this.line.textContent = parts.join("  ·  ").replaceAll("-", "−");
	}
}
