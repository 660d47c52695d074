/** What figures are drawn of. */
const SPACE = "http://www.w3.org/2000/svg";

export function svg(name, attributes = {}, ...children) {
	const made = document.createElementNS(SPACE, name);
	for (const [key, value] of Object.entries(attributes))
		made.setAttribute(key, String(value));
	made.append(...children);
	return made;
}

/** A path through points. @param {[number, number][]} points */
export const line = (points) => points.map(([x, y], i) => `${i ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`).join("");

/**
 * Axes of a figure.
 * @param {{width: number, height: number, left?: number, right?: number, top?: number, bottom?: number}} box
 * @param {{from: number, to: number, log?: boolean}} horizontal
 * @param {{from: number, to: number, log?: boolean}} vertical
 */
export function scales({ width, height, left = 36, right = 14, top = 10, bottom = 24 }, horizontal, vertical) {
	const share = ({ from, to, log }, v) => (log ? Math.log(v / from) / Math.log(to / from) : (v - from) / (to - from));
	return {
		x: (v) => left + (width - left - right) * share(horizontal, v),
		y: (v) => height - bottom - (height - top - bottom) * share(vertical, v),
		left, right: width - right, top, bottom: height - bottom,
	};
}

/** Lines and numbers of axes. @param {[number, string][]} xs @param {[number, string][]} ys */
export function grid(to, xs, ys) {
	const across = ys.map(([v]) => `M${to.left} ${to.y(v).toFixed(1)}H${to.right}`);
	const up = xs.map(([v]) => `M${to.x(v).toFixed(1)} ${to.top}V${to.bottom}`);
	return svg(
		"g",
		{ class: "grid" },
		svg("path", { d: [...across, ...up].join("") }),
		...xs.map(([v, text]) => svg("text", { x: to.x(v), y: to.bottom + 14, "text-anchor": "middle" }, text)),
		...ys.map(([v, text]) => svg("text", { x: to.left - 5, y: to.y(v) + 3.5, "text-anchor": "end" }, text)),
	);
}
