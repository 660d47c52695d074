/** How large pictures are asked for: what fits the screen and can be had in time. */

/** Widths of quick pictures; few, so that browsers and the service have them again. */
const QUICK_WIDTHS = [160, 240, 320, 400, 480, 640];
const QUICK_MS = 90;
/** Pixels at most of pictures at rest: a processor draws a million in half a second, a graphics card four in no time. */
const MOST_PIXELS = { software: 1e6, hardware: 4e6 };

export class Sizes {
	#pixelsPerMs = 500;
	#most = MOST_PIXELS.software;

	/** @param {() => {width: number, height: number}} box where the picture is shown, CSS pixels */
	constructor(box) {
		this.box = box;
	}

	set software(is) {
		this.#most = is ? MOST_PIXELS.software : MOST_PIXELS.hardware;
	}

	/** @param {number} pixels  @param {import("../service/timing.js").Stage[]} timing  what they took */
	learn(pixels, timing) {
		const ms = timing.filter(({ name }) => ["view", "readback", "encode"].includes(name)).reduce((sum, stage) => sum + stage.ms, 0);
		if (ms > 0.5)
			this.#pixelsPerMs += 0.3 * (pixels / ms - this.#pixelsPerMs);
	}

	/** Largest width of that shape that fits the box. */
	#fit(shape) {
		const { width, height } = this.box();
		return Math.min(width, height * shape) * Math.min(devicePixelRatio, 2);
	}

	/** @param {number} shape width over height  @param {"quick" | "full"} kind */
	width(shape, kind) {
		const pixels = kind === "quick" ? this.#pixelsPerMs * QUICK_MS : this.#most;
		const width = Math.min(this.#fit(shape), Math.sqrt(pixels * shape));
		if (kind === "quick")
			return Math.max(...QUICK_WIDTHS.filter((w) => w <= width), Math.min(160, 160 * shape));
		return Math.max(Math.round(width / 16) * 16, 16);
	}

	/** Members of output that ask for it. A panorama's height follows from its width. */
	output(scene, kind) {
		const width = Math.max(Math.round(this.width(scene.shape, kind)), 16);
		return scene.isPanorama ? { width, height: undefined } : { width, height: Math.max(Math.round(width / scene.shape), 16) };
	}
}
