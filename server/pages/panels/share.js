/** The scene to take away: as an address, as JSON, as a line for the shell or for a page, and as files. */
import { LAYERS } from "../picture/layers.js";
import { toQuery } from "../scene/address.js";
import { address, fetchBytes, key } from "../service/api.js";

const quoted = (text) => `'${text.replaceAll("'", "'\\''")}'`;

/** @type {Record<string, {name: string, change: (members: object) => object}>} */
const FILES = {
	png: { name: "sky.png", change: (m) => m },
	exr: { name: "sky.exr", change: (m) => ({ ...m, output: { ...m.output, format: "exr" } }) },
	layers: { name: "sky-layers.exr", change: (m) => ({ ...m, output: { ...m.output, format: "exr", layers: LAYERS.map(([layer]) => layer) } }) },
	hdri2k: { name: "sky-2k.exr", change: (m) => panorama(m, "equirectangular", 2048) },
	hdri4k: { name: "sky-4k.exr", change: (m) => panorama(m, "equirectangular", 4096) },
	cube: { name: "sky-cube.exr", change: (m) => panorama(m, "cubemap", 512) },
};

/** The sphere around the camera, as scene light. */
function panorama({ camera, output, ...members }, projection, width) {
	const { position_m } = camera ?? {};
	return { ...members, camera: { ...(position_m && { position_m }), projection }, output: { format: "exr", width } };
}

function save(blob, name) {
	const link = document.createElement("a");
	link.href = URL.createObjectURL(blob);
	link.download = name;
	link.click();
	setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

export class Share {
	/**
	 * @param {import("../scene/scene.js").Scene} scene
	 * @param {HTMLElement} panel
	 * @param {{say: (text: string) => void, failed: (error: Error) => void}} page
	 */
	constructor(scene, panel, page) {
		this.scene = scene;
		this.page = page;
		this.texts = Object.fromEntries(["address", "json", "curl", "img"].map((name) => [name, panel.querySelector(`#share-${name}`)]));
		for (const button of panel.querySelectorAll("[data-copy]"))
			button.addEventListener("click", () => this.#copy(button));
		for (const button of panel.querySelectorAll("[data-file]"))
			button.addEventListener("click", () => this.#download(button));
		this.follow();
	}

	follow() {
		const members = this.scene.members();
		const query = toQuery(members);
		const render = address("v1/render").href;
		const shown = key.get() ? ` -H "Authorization: Bearer $STRATUS_API_KEY"` : "";
		this.texts.address.value = `${location.origin}${location.pathname}#${query}`;
		this.texts.json.value = JSON.stringify(members, null, 2);
		this.texts.curl.value = `curl -o sky.png${shown} -H 'Content-Type: application/json' ${render} -d ${quoted(JSON.stringify(members))}`;
		this.texts.img.value = `<img src="${render}?${query.replaceAll("&", "&amp;")}" alt="A sky">`;
	}

	async #copy(button) {
		const box = this.texts[button.dataset.copy];
		box.select();
		const copied = await navigator.clipboard?.writeText(box.value).then(() => true, () => false);
		this.page.say(copied || document.execCommand("copy") ? "Copied." : "Selected: copy it by the keyboard.");
	}

	async #download(button) {
		const { name, change } = FILES[button.dataset.file];
		button.setAttribute("aria-busy", "true");
		button.disabled = true;
		try {
			const { blob } = await fetchBytes(`v1/render?${toQuery(change(this.scene.members()))}`);
			save(blob, name);
			this.page.say(`${name} is ready.`);
		} catch (error) {
			this.page.failed(error);
		}
		button.removeAttribute("aria-busy");
		button.disabled = false;
	}
}
