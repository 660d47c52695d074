/** The phase function of three bands against the angle, and around the droplet; fogbow and glory are marked where the green band has them. */
import { grid, line, scales, svg } from "./svg.js";

const WIDE = { width: 380, height: 190 };
const ROUND = 250;
const CLASSES = ["red", "green", "blue"];
/** Decades that are shown. */
const FROM = 1e-2;
const TO = 1e5;
const SUPERSCRIPT = { "-2": "10⁻²", 0: "1", 2: "10²", 4: "10⁴" };

const at = (angles, values, angle) => values[angles.findIndex((a) => a >= angle)];

/** Index of the largest value between two angles, where that is a bump and no end of the range; else -1. */
function findBow(angles, values) {
	let best = -1;
	for (let i = 0; i < angles.length; i++)
		if (angles[i] >= 125 && angles[i] <= 160 && (best < 0 || values[i] > values[best]))
			best = i;
	return values[best] > values[best - 1] && values[best] >= values[best + 1] ? best : -1;
}

/** Index of the first ring around the backward direction: of the first bump from there that stands out of the dip before it. */
function findRing(angles, values) {
	let lowest = Infinity;
	for (let i = angles.length - 2; angles[i] > 165; i--) {
		lowest = Math.min(lowest, values[i + 1]);
		if (values[i] >= values[i + 1] && values[i] > values[i - 1] && values[i] > 1.03 * lowest)
			return i;
	}
	return -1;
}

/** Where light comes back brightest: the bow by one reflection inside the droplets, and around the shadow of the viewer, where droplets of many sizes leave no ring. */
export function findMarks({ angle_deg: angles, value: [, green] }) {
	const bow = findBow(angles, green);
	const ring = findRing(angles, green);
	const last = angles.length - 1;
	const glory = ring >= 0 ? ring : green[last] > 1.5 * at(angles, green, 170) ? last : -1;
	return [["fogbow", bow], ["glory", glory]].filter(([, i]) => i >= 0).map(([name, i]) => ({ name, angle: angles[i], value: green[i] }));
}

const withAngle = ({ name, angle }) => `${name} ${Number(angle.toFixed(name === "glory" ? 1 : 0))}°`;

function drawBands(to, angles, value, place) {
	return value.map((values, band) => svg("path", { class: `band ${CLASSES[band]}`, d: line(angles.map((a, i) => [to.x(a), to.y(place(values[i]))])) }));
}

/** Vertical lines down to the curve, with their names left of them. */
function drawMarks(to, marks, text) {
	return marks.map((mark) => {
		const x = to.x(mark.angle);
		return svg("g", {}, svg("path", { class: "mark", d: `M${x.toFixed(1)} ${to.top}V${Math.max(to.y(mark.value) - 3, to.top).toFixed(1)}` }),
			svg("text", { class: "mark-text", x: x - 4, y: to.top + 8, "text-anchor": "end" }, text(mark)));
	});
}

/** All angles, logarithmic. */
export function drawAll(figure, phase) {
	const { angle_deg: angles, value } = phase;
	const to = scales(WIDE, { from: 0, to: 180 }, { from: FROM, to: TO, log: true });
	const lines = grid(to, [0, 30, 60, 90, 120, 150, 180].map((a) => [a, `${a}°`]), [-2, 0, 2, 4].map((p) => [10 ** p, SUPERSCRIPT[p]]));
	figure.replaceChildren(lines, ...drawBands(to, angles, value, (v) => Math.min(Math.max(v, FROM), TO)), ...drawMarks(to, findMarks(phase), ({ name }) => name));
}

/** The backward ones, linear. */
export function drawBack(figure, phase) {
	const first = phase.angle_deg.findIndex((a) => a >= 130);
	const angles = phase.angle_deg.slice(first);
	const value = phase.value.map((values) => values.slice(first));
	const most = Math.max(...value.flat());
	const top = [0.2, 0.5, 1, 2, 5, 10, 20, 50, 100].find((t) => t >= 1.12 * most) ?? most;
	const to = scales(WIDE, { from: 130, to: 180 }, { from: 0, to: top });
	const lines = grid(to, [130, 140, 150, 160, 170, 180].map((a) => [a, `${a}°`]), [0, top / 2, top].map((v) => [v, String(v)]));
	figure.replaceChildren(lines, ...drawBands(to, angles, value, (v) => v), ...drawMarks(to, findMarks(phase), withAngle));
}

export function drawPolar(figure, phase) {
	const { angle_deg: angles, value } = phase;
	const middle = { x: 168, y: ROUND / 2 };
	const radius = (v) => (112 * Math.log(Math.min(Math.max(v, FROM), TO) / FROM)) / Math.log(TO / FROM);
	const point = (angle, r) => [middle.x + r * Math.cos((angle * Math.PI) / 180), middle.y - r * Math.sin((angle * Math.PI) / 180)];
	const rings = [-1, 0, 1, 2, 3, 4, 5].map((p) => svg("circle", { cx: middle.x, cy: middle.y, r: radius(10 ** p).toFixed(1) }));
	const spokes = [0, 30, 60, 90, 120, 150].map((a) => line([point(a, 112), point(a + 180, 112)])).join("");
	const curves = value.map((values, band) => {
		const half = angles.map((a, i) => point(a, radius(values[i])));
		const other = angles.map((a, i) => point(-a, radius(values[i]))).reverse();
		return svg("path", { class: `band ${CLASSES[band]}`, d: `${line([...half, ...other])}Z` });
	});
	const marks = findMarks(phase).flatMap(({ name, angle, value: bright }) => {
		const green = radius(bright);
		const ends = name === "glory" ? [1] : [1, -1];
		return ends.map((sign, i) => {
			const [x, y] = point(sign * angle, green + 5);
			const [tx, ty] = point(sign * angle, green + (name === "glory" ? 12 : 16));
			const label = i === 0 ? [svg("text", { class: "mark-text", x: tx, y: ty + (name === "glory" ? 4 : 0), "text-anchor": "end" }, name)] : [];
			return svg("g", {}, svg("circle", { class: "dot", cx: x.toFixed(1), cy: y.toFixed(1), r: 2.5 }), ...label);
		});
	});
	figure.replaceChildren(
		svg("g", { class: "grid" }, ...rings, svg("path", { d: spokes })),
		...curves, ...marks,
		svg("text", { class: "axis", x: middle.x + 118, y: middle.y - 4 }, "onward"),
		svg("path", { class: "arrow", d: `M20 ${middle.y}h26m-5 -4l5 4l-5 4` }),
		svg("text", { class: "axis", x: 20, y: middle.y - 8 }, "light"),
	);
}
