/** A scene in the form of a query: of the service's addresses, and of the page's own behind its #. */

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

const LISTS = new Set(["camera.position_m", "clouds.wind_mps", "ground.albedo", "model.paths", "output.layers"]);

/** The members that a query says, as JSON; what is no dotted name is left out. */
export function fromQuery(query) {
	/** @type {Record<string, Record<string, any>>} */
	const members = {};
	for (const [path, value] of new URLSearchParams(query)) {
		const [section, name, more] = path.split(".");
		if (!name || more !== undefined || section === "__proto__")
			continue;
		(members[section] ??= {})[name] = LISTS.has(path) ? value.split(",").map(read) : read(value);
	}
	return members;
}
