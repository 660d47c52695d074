/** All layers of the picture at a glance, out of one small file; any of them in the large picture. */
import { LAYERS, showLayer } from "../picture/layers.js";
import { readExr } from "../picture/exr.js";
import { toQuery } from "../scene/address.js";
import { fetchBytes } from "../service/api.js";
import { latest } from "../service/latest.js";
import { element } from "./controls.js";

const WIDTH = 176;

export class LayersPanel {
	/**
	 * @param {import("../scene/scene.js").Scene} scene
	 * @param {HTMLElement} list
	 * @param {(layer: string) => void} chosen
	 */
	constructor(scene, list, chosen) {
		this.scene = scene;
		this.list = list;
		this.shownOf = "";
		this.sheet = latest((query, signal) => this.#fetch(query, signal), () => list.classList.add("stale"));
		list.append(...LAYERS.map(([name, title]) => {
			const radio = element("input", { type: "radio", name: "layer", value: name, id: `layer-${name}`, checked: name === "color" });
			radio.addEventListener("change", () => chosen(name));
			return element("div", { class: "layer" }, radio, element("label", { for: radio.id }, element("canvas", { width: 16, height: 10, "data-layer": name, "aria-hidden": "true" }), element("span", {}, title)));
		}));
	}

	choose(layer) {
		this.list.querySelector(`#layer-${layer}`).checked = true;
	}

	/** Called when the picture rests and the layers are looked at. */
	follow() {
		const panorama = this.scene.isPanorama;
		const size = { width: WIDTH, height: panorama ? undefined : Math.max(Math.round(WIDTH / this.scene.shape), 16) };
		const members = this.scene.members({ ...size, format: "exr", exr_type: "half", exr_compression: "none", layers: LAYERS.map(([name]) => name) });
		const { name, samples, time_budget_ms, seed, partial, ...model } = members.model ?? {};
		const query = toQuery({ ...members, model });
		if (query !== this.shownOf)
			this.sheet.want(query);
	}

	async #fetch(query, signal) {
		const { blob } = await fetchBytes(`v1/render?${query}`, { signal, priority: "low" });
		const exr = readExr(await blob.arrayBuffer());
		signal.throwIfAborted();
		const ev = this.scene.value("output.exposure_ev");
		for (const canvas of this.list.querySelectorAll("canvas")) {
			canvas.width = exr.width;
			canvas.height = exr.height;
			const image = new ImageData(exr.width, exr.height);
			showLayer(exr, canvas.dataset.layer, ev === "auto" ? exr.header["stratus:exposure_ev"] : ev, this.scene.value("output.tone"), image.data);
			canvas.getContext("2d").putImageData(image, 0, 0);
		}
		this.list.classList.remove("stale");
		this.shownOf = query;
	}
}
