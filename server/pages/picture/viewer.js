/** Asks for the pictures that the stage shows, and develops those that come as light. */
import { toQuery } from "../scene/address.js";
import { fetchBytes } from "../service/api.js";
import { readExr } from "./exr.js";
import { planesOf, showLayer } from "./layers.js";
import { readPngText } from "./png_text.js";
import { develop } from "./develop.js";

/** Scene light, as small as a browser can read it without ado. */
const LIGHT = { format: "exr", exr_type: "half", exr_compression: "none" };

const takesLong = (members) => members.model?.name === "reference";

/** The same scene by a model that is done in time. */
function inTime(members) {
	if (!takesLong(members))
		return members;
	const { name, samples, time_budget_ms, seed, partial, ...model } = members.model;
	return { ...members, model };
}

export class Viewer {
	/** Light of the picture at rest: {key, exr} */
	#light = null;

	/**
	 * @param {import("../scene/scene.js").Scene} scene
	 * @param {import("./stage.js").Stage} stage
	 * @param {import("./size.js").Sizes} sizes
	 */
	constructor(scene, stage, sizes) {
		this.scene = scene;
		this.stage = stage;
		this.sizes = sizes;
		this.layer = "color";
		/** @type {((members: object, kind: "quick" | "full") => object) | null} what stands beside the picture, for comparing */
		this.other = null;
		/** @type {(drawn: {kind: string, width: number, height: number, took: number, shown: number, bytes: number, ev: number, timing: object[]}) => void} */
		this.drawn = () => {};
	}

	#ask(kind, more = {}) {
		const members = this.scene.members({ ...this.sizes.output(this.scene, kind), ...more });
		return kind === "quick" ? inTime(members) : members;
	}

	async draw(kind, signal) {
		this.stage.working(kind);
		try {
			const more = this.layer === "color" ? {} : { ...LIGHT, layers: [this.layer] };
			const members = this.#ask(kind, more);
			const drawn = await this.#drawPane("picture", members, kind, signal);
			const other = this.other?.(members, kind);
			if (other && !(kind === "quick" && takesLong(other)))
				await this.#drawPane("other", other, kind, signal);
			this.drawn({ kind, ...drawn });
		} finally {
			this.stage.working(null);
		}
	}

	async #drawPane(pane, members, kind, signal) {
		const { blob, took, timing } = await fetchBytes(`v1/render?${toQuery(members)}`, { signal, priority: "high" });
		const began = performance.now();
		const size = this.layer === "color" ? await this.#showPng(pane, blob, signal) : await this.#showLayer(pane, blob, signal);
		this.sizes.learn(size.width * size.height, timing);
		if (pane === "picture")
			this.stage.describe(kind, size, members);
		return { ...size, took, timing, shown: performance.now() - began, bytes: blob.size };
	}

	async #showPng(pane, blob, signal) {
		const bitmap = await createImageBitmap(blob);
		signal.throwIfAborted();
		this.stage.scale(null);
		const { width, height } = bitmap;
		this.stage.draw(pane, bitmap);
		return { width, height, ev: Number(await readPngText(blob, "stratus:exposure_ev")) };
	}

	async #showLayer(pane, blob, signal) {
		const exr = readExr(await blob.arrayBuffer());
		signal.throwIfAborted();
		const image = new ImageData(exr.width, exr.height);
		const scale = showLayer(exr, this.layer, exr.header["stratus:exposure_ev"], this.scene.value("output.tone"), image.data);
		this.stage.draw(pane, image);
		this.stage.scale(scale);
		return { width: exr.width, height: exr.height, ev: exr.header["stratus:exposure_ev"] };
	}

	/** What light depends on: everything but how it is developed. */
	#lightMembers() {
		return this.#ask("full", { ...LIGHT, exposure_ev: undefined, tone: undefined });
	}

	/** Fetches the light of the picture at rest, unless it is there. */
	async fetchLight(signal) {
		const key = toQuery(this.#lightMembers());
		if (this.#light?.key !== key) {
			const { blob } = await fetchBytes(`v1/render?${key}`, { signal, priority: "high" });
			this.#light = { key, exr: readExr(await blob.arrayBuffer()) };
		}
		return this.#light.exr;
	}

	#hasLight() {
		return this.#light?.key === toQuery(this.#lightMembers());
	}

	/** Luminance at a place of the picture, cd/m2; null while its light is not known. */
	luminanceAt({ x, y }) {
		if (!this.#hasLight())
			return null;
		const { exr } = this.#light;
		const at = Math.floor(y * exr.height) * exr.width + Math.floor(x * exr.width);
		const [r, g, b] = planesOf(exr, "color").map((plane) => plane[at]);
		return 1000 * (0.2126 * r + 0.7152 * g + 0.0722 * b);
	}

	/** The picture at rest with the exposure that the scene now says, out of light that was fetched; false when there is none of this scene. */
	developLight() {
		if (!this.#hasLight() || this.layer !== "color")
			return false;
		const { exr } = this.#light;
		const image = new ImageData(exr.width, exr.height);
		const ev = this.scene.value("output.exposure_ev");
		develop(planesOf(exr, "color"), exr.width, ev === "auto" ? exr.header["stratus:exposure_ev"] : ev, this.scene.value("output.tone"), image.data);
		this.stage.draw("picture", image);
		return true;
	}
}
