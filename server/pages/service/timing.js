/**
 * @typedef {object} Stage
 * @property {string} name
 * @property {number} ms
 * @property {string} note
 */

/**
 * A Server-Timing header (W3C): metrics with dur and desc, of which the first of each counts.
 * @param {string} header
 * @returns {Stage[]}
 */
export function readTiming(header) {
	const stages = [];
	for (const [metric] of header.matchAll(/(?:[^,"]|"(?:[^"\\]|\\.)*")+/g)) {
		const [name, ...parameters] = metric.match(/(?:[^;"]|"(?:[^"\\]|\\.)*")+/g) ?? [];
		const said = new Map();
		for (const parameter of parameters) {
			const [, key, value] = parameter.match(/^\s*([^=\s]+)\s*=\s*(.*?)\s*$/) ?? [];
			if (key && !said.has(key))
				said.set(key, value.replace(/^"(.*)"$/, "$1"));
		}
		stages.push({ name: name.trim(), ms: Number(said.get("dur") ?? 0), note: said.get("desc") ?? "" });
	}
	return stages;
}
