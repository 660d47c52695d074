/**
 * When to draw: small and quick while something changes, at full size when it rests. A picture at full size is given up as soon as something changes; of
 * quick ones one is in work, and the next is of what holds then.
 */
import { latest } from "../service/latest.js";

const REST_MS = 220;

export class RenderLoop {
	#timer = 0;
	#held = false;
	/** What is shown is not yet the picture at full size of what holds. */
	#owing = true;
	#full;
	#quick;

	/** @param {{draw: (kind: "quick" | "full", signal: AbortSignal) => Promise<void>, failed: (error: Error) => void}} how */
	constructor({ draw, failed }) {
		this.#quick = latest(async (_, signal) => {
			await draw("quick", signal);
			this.#rest();
		}, failed);
		this.#full = latest(async (_, signal) => {
			await draw("full", signal);
			this.#owing = false;
		}, failed);
	}

	/** Whether the picture at full size is shown, and nothing is in work. */
	get rests() {
		return !this.#owing;
	}

	/** Something is different. @param {{afresh?: boolean}} [how] afresh: so much that what is in work is of no use */
	changed({ afresh = false } = {}) {
		this.#owing = true;
		clearTimeout(this.#timer);
		this.#full.drop();
		if (afresh)
			this.#quick.drop();
		this.#quick.want(null);
	}

	/** The picture is not of the size it should be. */
	outgrown() {
		this.#owing = true;
		this.#rest();
	}

	/** The picture at full size, unless something changes before a moment is over. */
	#rest() {
		clearTimeout(this.#timer);
		if (!this.#held && this.#owing)
			this.#timer = setTimeout(() => this.#quick.busy || this.#full.want(null), REST_MS);
	}

	/** While it is held nothing is drawn at full size. */
	hold() {
		this.#held = true;
		clearTimeout(this.#timer);
	}

	release() {
		this.#held = false;
		this.#rest();
	}
}
