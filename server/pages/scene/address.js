/** A scene in the form of a query: of the service's addresses, and of the page's own behind its #. */
import { faultOf } from "./faults.js";

const text = (value) => (Array.isArray(value) ? value.join(",") : String(value));

/** @param {Record<string, Record<string, any>>} members */
export function toQuery(members) {
	const pairs = Object.entries(members).flatMap(([section, inner]) => Object.entries(inner).map(([name, value]) => [`${section}.${name}`, text(value)]));
	return pairs.map(([name, value]) => `${name}=${encodeURIComponent(value).replaceAll("%2C", ",").replaceAll("%3A", ":")}`).join("&");
}

function read(value) {
	if (value === "true" || value === "false")
		return value === "true";
	return /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i.test(value) ? Number(value) : value;
}

const SECTIONS = new Set(["sun", "dsd", "clouds", "ground", "atmosphere", "camera", "radiosity", "model", "output"]);
const LISTS = new Set(["camera.position_m", "clouds.wind_mps", "ground.albedo", "model.paths", "output.layers"]);

/**
 * The members that a query says, as JSON. What is no dotted name is left out, and so is, in words, what is wrong.
 * @returns {{members: Record<string, Record<string, any>>, wrong: string[]}}
 */
export function fromQuery(query) {
	const members = Object.create(null);
	const wrong = [];
	for (const [path, text] of new URLSearchParams(query)) {
		const [section, name, more] = path.split(".");
		if (!name || more !== undefined)
			continue;
		const value = LISTS.has(path) ? text.split(",").map(read) : read(text);
		const fault = SECTIONS.has(section) ? faultOf(path, value) : "is no member of a scene";
		if (fault)
			wrong.push(`${path} ${fault}`);
		else
			(members[section] ??= Object.create(null))[name] = value;
	}
	return { members, wrong };
}
