/** The camera by dragging in the picture, by the wheel, by two fingers and by keys. */

const wrap = (azimuth) => ((azimuth % 360) + 360) % 360;
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
const round = (value, step) => Number((Math.round(value / step) * step).toFixed(3));

export class CameraHand {
	/** @type {Map<number, {x: number, y: number}>} fingers, or the mouse */
	#points = new Map();

	/**
	 * @param {import("../scene/scene.js").Scene} scene
	 * @param {import("./stage.js").Stage} stage
	 * @param {{hold: () => void, release: () => void}} loop
	 */
	constructor(scene, stage, loop) {
		this.scene = scene;
		this.stage = stage;
		this.loop = loop;
		const { element } = stage;
		element.addEventListener("pointerdown", (event) => this.#down(event));
		element.addEventListener("pointermove", (event) => this.#move(event));
		for (const end of ["pointerup", "pointercancel", "lostpointercapture"])
			element.addEventListener(end, (event) => this.#up(event));
		element.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
		element.addEventListener("keydown", (event) => this.#key(event));
	}

	turn(azimuth, elevation) {
		this.scene.set(
			{
				"camera.azimuth_deg": round(wrap(this.scene.value("camera.azimuth_deg") + azimuth), 0.01),
				"camera.elevation_deg": round(clamp(this.scene.value("camera.elevation_deg") + elevation, -90, 90), 0.01),
			},
			{ moving: true },
		);
	}

	zoom(factor) {
		this.scene.set({ "camera.vertical_fov_deg": round(clamp(this.scene.value("camera.vertical_fov_deg") * factor, 0.5, 150), 0.1) }, { moving: true });
	}

	/** Metres ahead and to the right, and by a factor up. */
	#walk(ahead, right, up) {
		const azimuth = (this.scene.value("camera.azimuth_deg") * Math.PI) / 180;
		const [x, y, z] = [0, 1, 2].map((i) => this.scene.value(`camera.position_m.${i}`));
		const stride = Math.max(z * 0.1, 20);
		this.scene.set(
			{
				"camera.position_m.0": round(clamp(x + stride * (ahead * Math.sin(azimuth) + right * Math.cos(azimuth)), -1e6, 1e6), 0.1),
				"camera.position_m.1": round(clamp(y + stride * (ahead * Math.cos(azimuth) - right * Math.sin(azimuth)), -1e6, 1e6), 0.1),
				"camera.position_m.2": round(clamp(z * up, 0.1, 30000), 0.1),
			},
			{ moving: true },
		);
	}

	#down(event) {
		if (event.button !== 0 || this.scene.isPanorama)
			return;
		this.stage.element.setPointerCapture(event.pointerId);
		this.#points.set(event.pointerId, { x: event.clientX, y: event.clientY });
		this.stage.element.classList.add("turning");
		this.loop.hold();
	}

	#move(event) {
		const from = this.#points.get(event.pointerId);
		if (!from)
			return;
		const to = { x: event.clientX, y: event.clientY };
		if (this.#points.size === 2) {
			const [other] = [...this.#points].filter(([id]) => id !== event.pointerId).map(([, point]) => point);
			this.zoom(Math.hypot(from.x - other.x, from.y - other.y) / Math.max(Math.hypot(to.x - other.x, to.y - other.y), 1));
		} else {
			const degrees = this.scene.value("camera.vertical_fov_deg") / this.stage.frame.height;
			const across = Math.max(Math.cos((this.scene.value("camera.elevation_deg") * Math.PI) / 180), 0.2);
			this.turn(((from.x - to.x) * degrees) / across, (to.y - from.y) * degrees);
		}
		this.#points.set(event.pointerId, to);
	}

	#up(event) {
		if (!this.#points.delete(event.pointerId) || this.#points.size)
			return;
		this.stage.element.classList.remove("turning");
		this.loop.release();
	}

	#wheel(event) {
		if (this.scene.isPanorama || !(event.ctrlKey || this.stage.element.matches(":focus-within")))
			return;
		event.preventDefault();
		this.zoom(1.0015 ** event.deltaY);
	}

	#key(event) {
		if (event.ctrlKey || event.altKey || event.metaKey || event.target !== this.stage.element)
			return;
		const step = event.shiftKey ? 10 : 2;
		const acts = {
			ArrowLeft: () => this.turn(-step, 0), ArrowRight: () => this.turn(step, 0), ArrowUp: () => this.turn(0, step), ArrowDown: () => this.turn(0, -step),
			"+": () => this.zoom(1 / 1.1), "=": () => this.zoom(1 / 1.1), "-": () => this.zoom(1.1),
			w: () => this.#walk(1, 0, 1), s: () => this.#walk(-1, 0, 1), d: () => this.#walk(0, 1, 1), a: () => this.#walk(0, -1, 1),
			r: () => this.#walk(0, 0, 1.25), f: () => this.#walk(0, 0, 1 / 1.25),
		};
		const turns = event.key.startsWith("Arrow") || "+=-".includes(event.key);
		const act = acts[event.key] ?? acts[event.key.toLowerCase()];
		if (!act || (turns && this.scene.isPanorama))
			return;
		event.preventDefault();
		act();
	}
}
