/** The sky from above, the zenith in the middle: the sun to be dragged, what the camera sees, and the way of the sun over the day. */
import { line, svg } from "../figures/svg.js";
import { directionAt } from "../scene/direction.js";
import { compassPoint } from "../scene/words.js";

/** Radius of the horizon; a degree has the same length above and below it. */
const HORIZON = 100;
const DEEPEST = -18;
const rad = Math.PI / 180;

function place(azimuth, elevation) {
	const r = (HORIZON * (90 - Math.max(elevation, DEEPEST))) / 90;
	return [r * Math.sin(azimuth * rad), -r * Math.cos(azimuth * rad)];
}

function direction(x, y) {
	const azimuth = (Math.atan2(x, -y) / rad + 360) % 360;
	const elevation = 90 - (90 * Math.hypot(x, y)) / HORIZON;
	return { azimuth: Number(azimuth.toFixed(1)), elevation: Number(Math.max(elevation, DEEPEST).toFixed(1)) };
}

/** Edge of a perspective picture as directions. */
function edgeOf(scene) {
	const corners = [[-1, 1], [1, 1], [1, -1], [-1, -1], [-1, 1]];
	const points = corners.slice(1).flatMap((to, i) => Array.from({ length: 16 }, (_, k) => [0, 1].map((c) => corners[i][c] + ((to[c] - corners[i][c]) * k) / 16)));
	return points.map(([u, v]) => directionAt(scene, u, v));
}

export class Dome {
	/**
	 * @param {import("../scene/scene.js").Scene} scene
	 * @param {SVGSVGElement} figure
	 * @param {{hold: () => void, release: () => void}} loop
	 */
	constructor(scene, figure, loop) {
		this.scene = scene;
		this.figure = figure;
		this.loop = loop;
		this.sun = { azimuth: 0, elevation: 0 };
		this.view = svg("path", { class: "view" });
		this.way = svg("path", { class: "way" });
		this.hours = svg("g", { class: "hours" });
		this.handle = svg("g", { id: "sun-handle", class: "sun", tabindex: 0, role: "slider", "aria-label": "Sun", "aria-valuemin": DEEPEST, "aria-valuemax": 90 },
			svg("circle", { r: 15, class: "halo" }), svg("circle", { r: 7 }));
		figure.append(this.#sky(), this.view, this.way, this.hours, this.handle);
		figure.addEventListener("pointerdown", (event) => this.#down(event));
		figure.addEventListener("pointermove", (event) => figure.hasPointerCapture(event.pointerId) && this.#drag(event));
		figure.addEventListener("lostpointercapture", () => loop.release());
		this.handle.addEventListener("keydown", (event) => this.#key(event));
	}

	#sky() {
		const rings = [0, 30, 60].map((e) => svg("circle", { r: (HORIZON * (90 - e)) / 90, class: e ? "ring" : "horizon" }));
		const letters = ["N", "E", "S", "W"].map((letter, i) => {
			const [x, y] = place(90 * i, -9);
			return svg("text", { x, y: y + 4, "text-anchor": "middle" }, letter);
		});
		const numbers = [30, 60].map((e) => svg("text", { class: "small", x: 3, y: -(HORIZON * (90 - e)) / 90 - 2 }, `${e}°`));
		return svg("g", {}, svg("circle", { r: 120, class: "below" }), svg("circle", { r: HORIZON, class: "sky" }), ...rings, ...letters, ...numbers);
	}

	/** @param {{azimuth: number, elevation: number}} sun */
	show(sun) {
		this.sun = sun;
		const [x, y] = place(sun.azimuth, sun.elevation);
		this.handle.setAttribute("transform", `translate(${x.toFixed(1)} ${y.toFixed(1)})`);
		this.handle.setAttribute("aria-valuenow", sun.elevation.toFixed(1));
		this.handle.setAttribute("aria-valuetext", `elevation ${sun.elevation.toFixed(1)}°, azimuth ${sun.azimuth.toFixed(1)}°, ${compassPoint(sun.azimuth)}`);
		this.figure.dataset.light = sun.elevation > 12 ? "day" : sun.elevation > -3 ? "low" : "night";
	}

	/** What the camera sees. */
	follow() {
		const edge = this.scene.isPanorama ? [] : edgeOf(this.scene).map(({ azimuth, elevation }) => place(azimuth, elevation));
		this.view.setAttribute("d", edge.length ? `${line(edge)}Z` : "");
	}

	/** @param {{hour: number, azimuth: number, elevation: number}[]} day where the sun stands, hour by hour; empty: no day */
	showDay(day) {
		const above = day.map(({ azimuth, elevation }) => (elevation >= DEEPEST ? place(azimuth, elevation) : null));
		this.way.setAttribute("d", above.map((point, i) => point && `${above[i - 1] ? "L" : "M"}${point[0].toFixed(1)} ${point[1].toFixed(1)}`).filter(Boolean).join(""));
		const whole = day.filter(({ hour, elevation }) => Number.isInteger(hour) && hour < 24 && elevation > 0);
		this.hours.replaceChildren(...whole.map(({ azimuth, elevation }) => {
			const [cx, cy] = place(azimuth, elevation);
			return svg("circle", { cx: cx.toFixed(1), cy: cy.toFixed(1), r: 1.6 });
		}));
	}

	#down(event) {
		event.preventDefault();
		this.figure.setPointerCapture(event.pointerId);
		this.handle.focus({ preventScroll: true });
		this.loop.hold();
		this.#drag(event);
	}

	#drag(event) {
		const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(this.figure.getScreenCTM().inverse());
		this.#put(direction(point.x, point.y));
	}

	#put({ azimuth, elevation }) {
		this.scene.set({ "sun.time": undefined, "sun.azimuth_deg": azimuth, "sun.elevation_deg": elevation }, { moving: true });
	}

	#key(event) {
		const step = event.shiftKey ? 10 : 1;
		const [azimuth, elevation] = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] }[event.key] ?? [0, 0];
		if (!azimuth && !elevation)
			return;
		event.preventDefault();
		const to = { azimuth: (this.sun.azimuth + azimuth + 360) % 360, elevation: Math.min(Math.max(this.sun.elevation + elevation, DEEPEST), 90) };
		this.#put({ azimuth: Number(to.azimuth.toFixed(1)), elevation: Number(to.elevation.toFixed(1)) });
	}
}
