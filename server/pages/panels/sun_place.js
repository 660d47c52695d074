/** The sun by date, time and place: /v1/sun says where it stands, now and over the day. */
import { FIELDS } from "../scene/fields.js";
import { fetchJson } from "../service/api.js";
import { latest } from "../service/latest.js";

/** @type {[string, number, number][]} */
const PLACES = [
	["Grenoble", 45.19, 5.72], ["Reykjavík", 64.15, -21.94], ["London", 51.51, -0.13], ["New York", 40.71, -74.01], ["Mauna Kea", 19.82, -155.47],
	["Quito", -0.18, -78.47], ["Nairobi", -1.29, 36.82], ["Tokyo", 35.68, 139.69], ["Sydney", -33.87, 151.21], ["Punta Arenas", -53.16, -70.91],
];

const two = (n) => String(Math.trunc(n)).padStart(2, "0");
const offsetText = (hours) => `${hours < 0 ? "-" : "+"}${two(Math.abs(hours))}:${two((Math.abs(hours) % 1) * 60)}`;
/** Whole hours that a clock at this longitude is ahead of universal time, were there no politics. */
const zoneOf = (longitude) => Math.round(longitude / 15);

/** "2026-06-21T14:30:00+01:00" as date, minutes and the offset in hours. */
export function splitTime(text) {
	const [, date, hours, minutes, zone] = text.match(/^(\d{4}-\d\d-\d\d)[Tt ](\d\d):(\d\d)(?::[\d.]+)?(.*)$/) ?? [];
	const [, sign, h, m] = zone?.match(/([-+])(\d\d):?(\d\d)/) ?? [];
	return { date, minutes: 60 * hours + Number(minutes), offset: sign ? Number(`${sign}1`) * (Number(h) + Number(m) / 60) : 0 };
}

export const joinTime = ({ date, minutes, offset }) => `${date}T${two(minutes / 60)}:${two(minutes % 60)}:00${offsetText(offset)}`;

const dayBefore = (date, days) => new Date(Date.parse(`${date}T00:00:00Z`) - days * 864e5).toISOString().slice(0, 10);

/** A time so many minutes later, over midnight too. */
export function later(text, minutes) {
	const time = splitTime(text);
	const total = time.minutes + minutes;
	return joinTime({ ...time, date: dayBefore(time.date, -Math.floor(total / 1440)), minutes: ((total % 1440) + 1440) % 1440 });
}

export class SunPlace {
	/**
	 * @param {import("../scene/scene.js").Scene} scene
	 * @param {import("./dome.js").Dome} dome
	 * @param {HTMLElement} panel
	 */
	constructor(scene, dome, panel) {
		this.scene = scene;
		this.dome = dome;
		this.panel = panel;
		const find = (name) => panel.querySelector(`#${name}`);
		this.date = find("sun-date");
		this.clock = find("sun-clock");
		this.slider = find("sun-minutes");
		this.place = find("sun-place");
		this.stands = find("sun-stands");
		this.place.append(...PLACES.map(([name], i) => new Option(name, String(i))));
		for (const radio of panel.querySelectorAll("[name=sun-by]"))
			radio.addEventListener("change", () => this.#choose(radio.value));
		this.date.addEventListener("change", () => this.date.value && this.#put({ date: this.date.value }));
		this.clock.addEventListener("change", () => this.clock.value && this.#put({ minutes: splitTime(`2000-01-01T${this.clock.value}`).minutes }));
		this.slider.addEventListener("input", () => this.#put({ minutes: Number(this.slider.value) }, true));
		this.place.addEventListener("change", () => this.#go());
		find("sun-now").addEventListener("click", () => this.#now());
		const quiet = () => {};
		this.position = latest((query, signal) => this.#ask(query, signal), quiet);
		this.day = latest((query, signal) => this.#askDay(query, signal), quiet);
		scene.addEventListener("change", ({ detail }) => {
			if (!detail.paths || [...detail.paths].some((path) => path.startsWith("sun.")))
				this.follow();
		});
	}

	get time() {
		return splitTime(this.scene.value("sun.time"));
	}

	#put(change, moving = false) {
		this.scene.set({ "sun.time": joinTime({ ...this.time, ...change }) }, { moving });
	}

	#now() {
		const offset = zoneOf(this.scene.value("sun.longitude_deg"));
		const there = new Date(Date.now() + offset * 36e5).toISOString();
		this.#put({ date: there.slice(0, 10), minutes: splitTime(there).minutes, offset });
	}

	#go() {
		const [, latitude, longitude] = PLACES[Number(this.place.value)] ?? [];
		if (latitude !== undefined)
			this.scene.set({ "sun.latitude_deg": latitude, "sun.longitude_deg": longitude, "sun.time": joinTime({ ...this.time, offset: zoneOf(longitude) }) });
	}

	/** Where the place mode begins: today, in the middle of the morning. */
	begin() {
		if (!this.scene.isByPlace)
			this.scene.set({ "sun.time": joinTime({ date: new Date().toISOString().slice(0, 10), minutes: 600, offset: zoneOf(this.scene.value("sun.longitude_deg")) }) });
	}

	#choose(by) {
		if (by === "place")
			this.begin();
		else
			this.#takeOver();
	}

	/** The sun by hand from where it stands, or at night from as deep as scenes have it. */
	#takeOver() {
		const { elevation, azimuth } = this.dome.sun;
		this.scene.set({ "sun.time": undefined, "sun.elevation_deg": Math.max(elevation, FIELDS.get("sun.elevation_deg").min), "sun.azimuth_deg": azimuth });
	}

	follow() {
		const byPlace = this.scene.isByPlace;
		this.panel.querySelector(`[name=sun-by][value=${byPlace ? "place" : "hand"}]`).checked = true;
		this.panel.querySelector("#sun-by-place").hidden = !byPlace;
		this.panel.querySelector("#sun-by-hand").hidden = byPlace;
		if (!byPlace) {
			this.position.drop();
			this.day.drop();
			this.shown = "";
			this.dome.showDay([]);
			this.dome.show({ azimuth: this.scene.value("sun.azimuth_deg"), elevation: this.scene.value("sun.elevation_deg") });
			return;
		}
		const { date, minutes, offset } = this.time;
		this.date.value = date;
		this.clock.value = `${two(minutes / 60)}:${two(minutes % 60)}`;
		this.slider.value = String(minutes);
		this.slider.setAttribute("aria-valuetext", this.clock.value);
		this.panel.querySelector("#sun-zone").textContent = `UTC${offset ? offsetText(offset) : ""}`;
		const where = `latitude_deg=${this.scene.value("sun.latitude_deg")}&longitude_deg=${this.scene.value("sun.longitude_deg")}`;
		const at = PLACES.findIndex(([, latitude, longitude]) => where === `latitude_deg=${latitude}&longitude_deg=${longitude}`);
		this.place.value = at < 0 ? "" : String(at);
		this.position.want(`time=${encodeURIComponent(this.scene.value("sun.time"))}&${where}`);
		const day = JSON.stringify({ date, offset, where });
		if (day !== this.shown)
			this.day.want(day);
	}

	async #ask(query, signal) {
		const { elevation_deg: elevation, azimuth_deg: azimuth } = await fetchJson(`v1/sun?${query}`, { signal });
		signal.throwIfAborted();
		this.dome.show({ elevation: Number(elevation.toFixed(1)), azimuth: Number(azimuth.toFixed(1)) });
		this.stands.textContent = `The sun stands ${Math.abs(elevation).toFixed(1)}° ${elevation < 0 ? "below" : "above"} the horizon, at azimuth ${azimuth.toFixed(1)}°.`;
	}

	async #askDay(key, signal) {
		const { date, offset, where } = JSON.parse(key);
		const hours = Array.from({ length: 25 }, (_, hour) => hour);
		const day = await Promise.all(hours.map(async (hour) => {
			const time = joinTime({ date: dayBefore(date, -Math.floor(hour / 24)), minutes: 60 * (hour % 24), offset });
			const { elevation_deg, azimuth_deg } = await fetchJson(`v1/sun?time=${encodeURIComponent(time)}&${where}`, { signal, priority: "low" });
			return { hour, elevation: elevation_deg, azimuth: azimuth_deg };
		}));
		signal.throwIfAborted();
		this.shown = key;
		this.dome.showDay(day);
	}
}
