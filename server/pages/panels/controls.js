/** Controls of members: made where the page says <div data-fields="...">, kept like the scene, and marked when the service refuses. */
import { FIELDS } from "../scene/fields.js";

/** @typedef {import("../scene/fields.js").Field} Field */

const STEPS = 1000;

export function element(name, attributes = {}, ...children) {
	const made = document.createElement(name);
	for (const [key, value] of Object.entries(attributes))
		if (value !== undefined && value !== false)
			made.setAttribute(key, value === true ? "" : String(value));
	made.append(...children);
	return made;
}

/** @param {Field} field */
function sliderOf(field) {
	const low = field.low ?? field.min;
	const high = field.high ?? field.max;
	const toValue = (at) => (field.log ? low * (high / low) ** (at / STEPS) : low + ((high - low) * at) / STEPS);
	const toSlider = (value) => (STEPS * (field.log ? Math.log(Math.max(value, low) / low) / Math.log(high / low) : (value - low) / (high - low)));
	const round = (value) => {
		const step = field.log && value > 100 * field.step ? 10 ** Math.floor(Math.log10(value) - 1.99) : field.step;
		return Number(Math.min(Math.max(Math.round(value / step) * step, field.min), field.max).toFixed(6));
	};
	return { toValue: (at) => round(toValue(at)), toSlider };
}

export const idOf = (path) => `field-${path.replaceAll(/[._]/g, "-")}`;

export class Controls {
	/** @type {Map<string, {row: HTMLElement, show: (value: any) => void}>} */
	#rows = new Map();

	/** @param {import("../scene/scene.js").Scene} scene */
	constructor(scene) {
		this.scene = scene;
		for (const place of document.querySelectorAll("[data-fields]"))
			for (const path of place.dataset.fields.split(" "))
				place.append(this.#make(FIELDS.get(path)));
		scene.addEventListener("change", ({ detail }) => this.#follow(detail.paths));
		this.#follow(null);
	}

	#follow(paths) {
		for (const [path, { show }] of this.#rows)
			if (!paths || paths.has(path))
				show(this.scene.value(path));
	}

	/** @param {Field} field */
	#make(field) {
		const { row, show } = field.choices ? this.#choice(field) : typeof field.initial === "boolean" ? this.#flag(field) : this.#number(field);
		row.dataset.path = field.path;
		row.append(element("p", { class: "wrong", id: `${idOf(field.path)}-wrong`, hidden: true }));
		this.#rows.set(field.path, { row, show });
		return row;
	}

	#choice(field) {
		const select = element("select", { id: idOf(field.path) }, ...field.choices.map(([value, text]) => element("option", { value }, text)));
		select.addEventListener("change", () => this.scene.set({ [field.path]: select.value }));
		return { row: element("div", { class: "field" }, element("label", { for: select.id }, field.label), select), show: (value) => (select.value = value) };
	}

	#flag(field) {
		const box = element("input", { id: idOf(field.path), type: "checkbox" });
		box.addEventListener("change", () => this.scene.set({ [field.path]: box.checked }));
		return { row: element("div", { class: "field flag" }, box, element("label", { for: box.id }, field.label)), show: (value) => (box.checked = value) };
	}

	#number(field) {
		const id = idOf(field.path);
		const named = field.unit ? `${field.label} in ${field.unit}` : field.label;
		const number = element("input", { id, type: "number", min: field.min, max: field.max, step: "any", inputmode: "decimal", "aria-label": named });
		const slider = element("input", { type: "range", min: 0, max: STEPS, step: "any", id: `${id}-slider` });
		const { toValue, toSlider } = sliderOf(field);
		slider.addEventListener("input", () => this.scene.set({ [field.path]: toValue(Number(slider.value)) }, { moving: true }));
		slider.addEventListener("keydown", (event) => stepByKey(event, slider));
		const rounded = (value) => Number(value.toPrecision(7));
		number.addEventListener("change", () => {
			if (number.value === "")
				number.value = String(rounded(this.scene.value(field.path)));
			else
				this.scene.set({ [field.path]: Number(number.value) });
		});
		const show = (value) => {
			const shown = rounded(value);
			slider.value = String(toSlider(value));
			slider.setAttribute("aria-valuetext", `${shown} ${field.unit ?? ""}`.trim());
			if (document.activeElement !== number || Number(number.value) !== value)
				number.value = String(shown);
		};
		const label = element("label", { for: slider.id, title: field.hint }, field.label);
		const value = element("span", { class: "value" }, number, element("span", { class: "unit" }, field.unit ?? ""));
		return { row: element("div", { class: "field number" }, label, value, slider), show };
	}

	/** Marks the members that the service refuses; those without a control come back. @param {{pointer: string, detail: string}[]} errors */
	mark(errors) {
		for (const { row } of this.#rows.values())
			setWrong(row, "");
		const others = errors.filter(({ pointer, detail }) => {
			const path = pointer.slice(1).replaceAll("/", ".");
			const found = this.#rows.get(path) ?? [...this.#rows].find(([other]) => other.startsWith(`${path}.`))?.[1];
			if (found)
				setWrong(found.row, detail);
			return !found;
		});
		for (const panel of document.querySelectorAll("[role=tabpanel]"))
			document.querySelector(`[aria-controls=${panel.id}]`).classList.toggle("bad", panel.querySelector(".bad") !== null);
		return others;
	}
}

function setWrong(row, detail) {
	const line = row.querySelector(".wrong");
	line.textContent = detail;
	line.hidden = !detail;
	row.classList.toggle("bad", Boolean(detail));
	for (const input of row.querySelectorAll("input, select")) {
		input.setAttribute("aria-invalid", String(Boolean(detail)));
		if (detail)
			input.setAttribute("aria-describedby", line.id);
		else
			input.removeAttribute("aria-describedby");
	}
}

/** Sliders without steps would move by a thousandth with each key: a hundredth is of use. */
function stepByKey(event, slider) {
	const by = { ArrowLeft: -10, ArrowDown: -10, ArrowRight: 10, ArrowUp: 10, PageUp: 100, PageDown: -100 }[event.key];
	if (!by)
		return;
	event.preventDefault();
	slider.value = String(Number(slider.value) + by);
	slider.dispatchEvent(new Event("input"));
}
