/** Over the night, whose sun is deeper than scenes have it, to the next dawn. */
import { FIELDS } from "../scene/fields.js";
import { Problem, fetchJson } from "../service/api.js";
import { later } from "./sun_place.js";

const DEEPEST = FIELDS.get("sun.elevation_deg").min;
const HOUR = 60;

/**
 * So many minutes after the scene's time; where the sun is too deep then, the first minute of the next dawn.
 * @param {import("../scene/scene.js").Scene} scene
 * @param {number} minutes
 * @param {AbortSignal} signal
 * @returns {Promise<string>} as sun.time; a Problem is thrown where there is no dawn within a day
 */
export async function nextSun(scene, minutes, signal) {
	const where = `latitude_deg=${scene.value("sun.latitude_deg")}&longitude_deg=${scene.value("sun.longitude_deg")}`;
	const isUp = async (time) => (await fetchJson(`v1/sun?time=${encodeURIComponent(time)}&${where}`, { signal })).elevation_deg >= DEEPEST;
	const next = later(scene.value("sun.time"), minutes);
	if (await isUp(next))
		return next;
	const hours = await Promise.all(Array.from({ length: 24 }, (_, hour) => isUp(later(next, HOUR * (hour + 1)))));
	const hour = hours.indexOf(true);
	if (hour < 0)
		throw new Problem({ title: "Night", detail: `The sun stays more than ${-DEEPEST}° below the horizon all of the next day.` });
	let [down, up] = [HOUR * hour, HOUR * (hour + 1)];
	while (up - down > 1) {
		const middle = Math.floor((down + up) / 2);
		if (await isUp(later(next, middle)))
			up = middle;
		else
			down = middle;
	}
	return later(next, up);
}
