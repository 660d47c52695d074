/**
 * Runs one piece of work at a time, always for the newest wish: what comes meanwhile takes the place of what waits, so that nothing queues.
 *
 * @template T
 * @param {(wish: T, signal: AbortSignal) => Promise<void>} work
 * @param {(error: Error) => void} failed
 * @returns {{want: (wish: T) => void, drop: () => void, readonly busy: boolean}} drop gives up what runs and what waits
 */
export function latest(work, failed) {
	/** @type {{wish: T} | null} */
	let waiting = null;
	/** @type {AbortController | null} */
	let running = null;

	async function run() {
		while (waiting) {
			const { wish } = waiting;
			const controller = (running = new AbortController());
			waiting = null;
			try {
				await work(wish, controller.signal);
			} catch (error) {
				if (!controller.signal.aborted)
					failed(error);
			}
		}
		running = null;
	}

	return {
		get busy() {
			return running !== null;
		},
		want(wish) {
			waiting = { wish };
			if (!running)
				run();
		},
		drop() {
			waiting = null;
			running?.abort();
		},
	};
}
