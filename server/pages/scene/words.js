/** A scene in words, for those who do not see its picture. */
import { FIELDS } from "./fields.js";

const POINTS = ["north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west"];

/** @param {number} azimuth degrees clockwise from north */
export const compassPoint = (azimuth) => POINTS[Math.round(azimuth / 45) % 8];

const choice = (scene, path) => new Map(FIELDS.get(path).choices).get(scene.value(path))?.toLowerCase() ?? scene.value(path);

/** @param {import("./scene.js").Scene} scene  @param {{azimuth: number, elevation: number}} sun */
export function inWords(scene, sun) {
	const clouds = scene.value("clouds.type") === "none" ? "A clear sky" : `Clouds, ${choice(scene, "clouds.type")}, over ${Math.round(100 * scene.value("clouds.coverage"))} % of the sky`;
	const light = sun.elevation < 0 ? `the sun ${-sun.elevation}° below the horizon` : `the sun ${sun.elevation}° high`;
	const view = scene.isPanorama ? "seen all around" : `seen towards the ${compassPoint(scene.value("camera.azimuth_deg"))}`;
	return `${clouds}, ${light} in the ${compassPoint(sun.azimuth)}; ground: ${choice(scene, "ground.type")}; ${view}.`;
}
