/** Scenes to begin with, each with a small picture that the service draws when it is looked at and nothing else is in work. */
import { toQuery } from "../scene/address.js";
import { fetchBytes, fetchJson } from "../service/api.js";
import { element } from "./controls.js";

const SIZE = { width: 176, height: 110 };

/** The preset's address as a small picture; a panorama keeps its shape. */
function thumbnail({ camera = {}, output = {}, ...scene }) {
	const panorama = (camera.projection ?? "perspective") !== "perspective";
	const { exposure_ev, tone } = output;
	const size = panorama ? { width: camera.projection === "equirectangular" ? 2 * SIZE.height : SIZE.width } : SIZE;
	return `v1/render?${toQuery({ ...scene, camera, output: { ...size, ...(exposure_ev !== undefined && { exposure_ev }), ...(tone && { tone }) } })}`;
}

export class Presets {
	/** @type {{button: HTMLElement, scene: object}[]} whose pictures are wanted */
	#wanted = [];
	#drawing = false;

	/**
	 * @param {HTMLElement} list
	 * @param {(scene: object) => void} chosen
	 * @param {() => boolean} idle  nothing that matters more is in work
	 */
	constructor(list, chosen, idle) {
		this.list = list;
		this.chosen = chosen;
		this.idle = idle;
		this.watch = new IntersectionObserver((entries) => this.#seen(entries), { root: null, rootMargin: "0px 100px" });
	}

	async load() {
		const { presets } = await fetchJson("v1/presets");
		this.list.replaceChildren(...presets.map((preset) => this.#card(preset)));
	}

	#card({ name, title, description, scene }) {
		const button = element("button", { type: "button", title: description, "data-preset": name }, element("span", { class: "thumb" }), element("span", { class: "title" }, title));
		button.addEventListener("click", () => this.chosen(scene));
		button.scene = scene;
		this.watch.observe(button);
		return element("li", {}, button);
	}

	#seen(entries) {
		for (const { isIntersecting, target } of entries) {
			if (!isIntersecting)
				continue;
			this.watch.unobserve(target);
			this.#wanted.push(target);
		}
		this.draw();
	}

	/** Draws those that are wanted, one after the other, while nothing else is in work. Called again whenever the main picture is done. */
	async draw() {
		if (this.#drawing)
			return;
		this.#drawing = true;
		while (this.#wanted.length && this.idle()) {
			const button = this.#wanted.shift();
			await this.#picture(button).catch(() => button.classList.add("without"));
		}
		this.#drawing = false;
	}

	async #picture(button) {
		const { blob } = await fetchBytes(thumbnail(button.scene), { priority: "low" });
		const image = element("img", { alt: "", src: URL.createObjectURL(blob), draggable: "false" });
		await image.decode();
		URL.revokeObjectURL(image.src);
		button.querySelector(".thumb").replaceChildren(image);
	}
}
