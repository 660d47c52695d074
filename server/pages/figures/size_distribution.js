/** N(r), modified gamma, and where the light is scattered: its cross-section r^2 N(r). */
import { grid, line, scales, svg } from "./svg.js";

const BOX = { width: 380, height: 168 };
const RADII = Array.from({ length: 241 }, (_, i) => 0.5 * 120 ** (i / 240));
const TICKS = [0.5, 1, 2, 5, 10, 20, 50].map((r) => [r, String(r)]);

/** Logarithm of the gamma function for x >= 1, by Stirling's series after shifting to x >= 8. */
function logGamma(x) {
	let shift = 0;
	for (; x < 8; x++)
		shift += Math.log(x);
	return (x - 0.5) * Math.log(x) - x + 0.5 * Math.log(2 * Math.PI) + 1 / (12 * x) - 1 / (360 * x ** 3) - shift;
}

/** Droplets per cm3 and um of radius. @param {number} r um */
export function density(r, { n0, gamma, effective }) {
	const characteristic = effective / (gamma + 2);
	return Math.exp(Math.log(n0 / characteristic) - logGamma(gamma) + (gamma - 1) * Math.log(r / characteristic) - r / characteristic);
}

/** Liquid water, g/m3: the third moment of N(r). */
export function liquidWater({ n0, gamma, effective }) {
	const characteristic = effective / (gamma + 2);
	return n0 * ((4 / 3) * Math.PI) * characteristic ** 3 * gamma * (gamma + 1) * (gamma + 2) * 1e-6;
}

const short = (v) => (v >= 1000 ? `${v / 1000}k` : String(Number(v.toPrecision(2))));

/** A round number not below. */
function ceiling(value) {
	const power = 10 ** Math.floor(Math.log10(value));
	return power * [1, 2, 5, 10].find((m) => m * power >= value);
}

export function drawSizes(figure, dsd) {
	const values = RADII.map((r) => density(r, dsd));
	const top = ceiling(Math.max(...values.filter(Number.isFinite)));
	const to = scales(BOX, { from: 0.5, to: 60, log: true }, { from: 0, to: top });
	const cross = RADII.map((r, i) => r * r * values[i]);
	const most = Math.max(...cross);
	const curve = line(RADII.map((r, i) => [to.x(r), to.y(Math.min(values[i], top))]));
	const share = line(RADII.map((r, i) => [to.x(r), to.y((0.9 * top * cross[i]) / most)]));
	const x = to.x(dsd.effective);
	const left = x > BOX.width - 90;
	figure.replaceChildren(
		grid(to, TICKS, [0, top / 2, top].map((v) => [v, short(v)])),
		svg("path", { class: "cross", d: `${share}L${to.right} ${to.bottom}L${to.left} ${to.bottom}Z` }),
		svg("path", { class: "curve", d: curve }),
		svg("path", { class: "mark", d: `M${x.toFixed(1)} ${to.top}V${to.bottom}` }),
		svg("text", { class: "mark-text", x: x + (left ? -5 : 5), y: to.top + 9, "text-anchor": left ? "end" : "start" }, `re ${Number(dsd.effective.toPrecision(3))} µm`),
	);
}
