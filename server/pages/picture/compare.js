/** What stands beside the picture, and the divider between the two. */

const laid = (members, section, more) => ({ ...members, [section]: { ...members[section], ...more } });

/** @type {Record<string, {names: [string, string], change: (members: object) => object}>} */
const VARIANTS = {
	paper: { names: ["Solved", "Bouthors et al. 2006"], change: (m) => laid(m, "model", { shading: "paper" }) },
	radiosity: { names: ["With light from the ground", "Without"], change: (m) => laid(m, "radiosity", { enabled: false }) },
	clear: { names: ["Clouds", "Clear sky"], change: (m) => ({ ...m, clouds: { type: "none" } }) },
	reference: {
		names: ["Real time", "Reference, path traced"],
		change: (m) => {
			const width = Math.min(m.output.width, 320);
			const output = { ...m.output, width, ...(m.output.height && { height: Math.round((width * m.output.height) / m.output.width) }) };
			return { ...m, output, model: { name: "reference", samples: 32, partial: true }, radiosity: undefined };
		},
	},
};

/** Without what says nothing. */
const tidy = (members) => Object.fromEntries(Object.entries(members).filter(([, inner]) => inner !== undefined));

/** The scene as it is now, for later: of the size of the picture beside it, or, where its shape is another, of its own. */
function keep(scene, sizes) {
	const { shape, isPanorama } = scene;
	const members = scene.members();
	return (now, kind) => {
		const alike = scene.shape === shape && scene.isPanorama === isPanorama;
		return { ...members, output: alike ? now.output : tidy({ ...now.output, ...sizes.output({ shape, isPanorama }, kind) }) };
	};
}

export class Comparison {
	/**
	 * @param {import("./stage.js").Stage} stage
	 * @param {import("./viewer.js").Viewer} viewer
	 */
	constructor(stage, viewer) {
		this.stage = stage;
		this.viewer = viewer;
		this.#place(50);
		const { divider } = stage;
		divider.addEventListener("pointerdown", (event) => this.#grab(event));
		divider.addEventListener("pointermove", (event) => divider.hasPointerCapture(event.pointerId) && this.#drag(event));
		divider.addEventListener("keydown", (event) => this.#key(event));
	}

	/** @param {string} name a variant, "kept" for the scene that was kept, or "" for none  @param {import("../scene/scene.js").Scene} scene */
	choose(name, scene) {
		const variant = VARIANTS[name];
		if (!name)
			this.viewer.other = null;
		else
			this.viewer.other = variant ? (now) => tidy(variant.change(now)) : keep(scene, this.viewer.sizes);
		this.stage.compare(name ? (variant?.names ?? ["Now", "Kept"]) : null);
	}

	#place(percent) {
		this.percent = Math.min(Math.max(percent, 0), 100);
		this.stage.element.style.setProperty("--where", String(this.percent / 100));
		this.stage.divider.setAttribute("aria-valuenow", String(Math.round(this.percent)));
	}

	#grab(event) {
		event.stopPropagation();
		event.preventDefault();
		this.stage.divider.focus();
		this.stage.divider.setPointerCapture(event.pointerId);
	}

	#drag(event) {
		event.stopPropagation();
		const { width } = this.stage.frame;
		const box = this.stage.element.getBoundingClientRect();
		this.#place((100 * (event.clientX - box.left - (box.width - width) / 2)) / width);
	}

	#key(event) {
		const to = { ArrowLeft: this.percent - 2, ArrowRight: this.percent + 2, Home: 0, End: 100 }[event.key];
		if (to === undefined)
			return;
		event.preventDefault();
		event.stopPropagation();
		this.#place(to);
	}
}
