/** What droplets do with light, drawn while their sliders move: from /v1/optics, but for their sizes, which the page knows. */
import { drawAll, drawBack, drawPolar } from "../figures/phase_function.js";
import { drawSizes, liquidWater } from "../figures/size_distribution.js";
import { toQuery } from "../scene/address.js";
import { fetchJson } from "../service/api.js";
import { latest } from "../service/latest.js";

const mean = (values) => values.reduce((sum, v) => sum + v, 0) / values.length;
const digits = (value, n = 3) => Number(value.toPrecision(n)).toLocaleString("en");

export class Droplets {
	/** @param {import("../scene/scene.js").Scene} scene  @param {HTMLElement} panel */
	constructor(scene, panel) {
		this.scene = scene;
		this.figures = Object.fromEntries(["sizes", "all", "back", "polar"].map((name) => [name, panel.querySelector(`#figure-${name}`)]));
		this.facts = panel.querySelector("#droplet-facts");
		this.panel = panel;
		this.optics = latest(
			(query, signal) => this.#fetch(query, signal),
			() => panel.classList.add("stale"),
		);
		scene.addEventListener("change", ({ detail }) => {
			const paths = detail.paths;
			if (!paths || [...paths].some((path) => /^(dsd|model\.optics|clouds\.thickness_m)/.test(path)))
				this.follow();
		});
	}

	follow() {
		const dsd = { n0: this.scene.value("dsd.n0_per_cm3"), gamma: this.scene.value("dsd.gamma"), effective: this.scene.value("dsd.effective_radius_um") };
		/* Else there is no such distribution, which the service will say. */
		if (Object.values(dsd).every((value) => value > 0)) {
			drawSizes(this.figures.sizes, dsd);
			this.#tell({ "Liquid water": `${digits(liquidWater(dsd))} g/m³` });
		}
		const { dsd: members, model } = this.scene.members();
		this.optics.want(toQuery({ ...(members && { dsd: members }), ...(model?.optics && { model: { optics: model.optics } }) }));
	}

	async #fetch(query, signal) {
		const optics = await fetchJson(`v1/optics${query && `?${query}`}`, { signal });
		this.panel.classList.remove("stale");
		drawAll(this.figures.all, optics.phase_function);
		drawBack(this.figures.back, optics.phase_function);
		drawPolar(this.figures.polar, optics.phase_function);
		const [, extinction] = optics.extinction_per_m;
		this.#tell({
			"Free path": `${digits(1 / extinction)} m`,
			"Asymmetry g": digits(mean(optics.asymmetry)),
			"Forward peak": `${digits(100 * mean(optics.forward_peak_fraction))} %`,
			"Thickest cloud": `τ = ${digits(extinction * this.scene.value("clouds.thickness_m"))}`,
		});
	}

	#tell(facts) {
		for (const [name, value] of Object.entries(facts))
			this.facts.querySelector(`[data-fact="${name}"]`).textContent = value;
	}
}
