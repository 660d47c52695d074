/** Where the time of a picture went, stage by stage, as a bar. */
import { element } from "./controls.js";

const TITLES = {
	queue: "Queue", optics: "Optics", sky: "Sky", field: "Clouds", radiosity: "Radiosity", view: "View", readback: "Read-back", encode: "Encoding", cache: "Cache",
	shared: "Shared", transfer: "Transfer", show: "Decoding",
};

/** @param {number} ms */
const text = (ms) => `${ms < 9.95 ? ms.toFixed(1) : Math.round(ms)} ms`;

/** The service's stages, and what the way and this browser took beside them. */
function stagesOf({ timing, took, shown }) {
	const total = timing.find(({ name }) => name === "total")?.ms ?? 0;
	const stages = timing.filter(({ name }) => name !== "total" && name in TITLES);
	return [...stages, { name: "transfer", ms: Math.max(took - total, 0), note: "" }, { name: "show", ms: shown, note: "" }];
}

/** Faster here than at the service: the browser had it. */
function howLong({ timing, took, shown }) {
	const total = timing.find(({ name }) => name === "total")?.ms ?? 0;
	return took < 0.9 * total ? `kept by the browser; drawn in ${text(total)} then` : `in ${text(took + shown)}`;
}

export class TimingBar {
	/** @param {HTMLElement} panel */
	constructor(panel) {
		this.bar = panel.querySelector("#timing-bar");
		this.list = panel.querySelector("#timing-list");
		this.sum = panel.querySelector("#timing-sum");
	}

	/** @param {{timing: import("../service/timing.js").Stage[], took: number, shown: number, width: number, height: number, bytes: number}} drawn */
	show(drawn) {
		const stages = stagesOf(drawn);
		const shown = stages.filter(({ ms }) => ms >= 0.05);
		this.bar.replaceChildren(...shown.map(({ name, ms }) => {
			const part = element("span", { class: `stage-${name}`, title: `${TITLES[name]} ${text(ms)}` });
			part.style.flexGrow = String(ms);
			return part;
		}));
		this.list.replaceChildren(...stages.filter(({ name, ms }) => ms >= 0.05 || !["cache", "shared", "queue"].includes(name)).map(({ name, ms, note }) =>
			element("li", { class: `stage-${name}`, title: note || undefined }, element("i"), TITLES[name], " ", element("b", {}, note === "reused" ? "kept" : text(ms)))));
		this.sum.textContent = `${drawn.width} × ${drawn.height}, ${Math.round(drawn.bytes / 1024)} kB ${howLong(drawn)}`;
	}
}
