/**
 * From scene light to what a screen shows: exposure, tone, sRGB, as the service develops its PNG. The functions and their constants are those of
 * shaders/lib/colour.glsl, where they are explained.
 */

const BALANCE = [0.93, 1.015, 1.1];
const FOG = 0.002;
/** Tables go by the upper bits of a float: its exponent and ten bits of its mantissa. */
const SHIFT = 13;
const float = new Float32Array(1);
const bits = new Uint32Array(float.buffer);

function tabulate(f) {
	const table = new Float32Array(1 << (31 - SHIFT));
	for (let i = 0; i < table.length; i++) {
		bits[0] = (i << SHIFT) | (1 << (SHIFT - 1));
		table[i] = Number.isFinite(float[0]) ? f(float[0]) : f(3e38);
	}
	return table;
}

function look(table, x) {
	float[0] = x > 0 ? x : 0;
	return table[bits[0] >>> SHIFT];
}

function filmic(x) {
	const z = 1 / Math.sqrt(1 + (1.25 / 1.5) * x ** 1.15);
	const rest = (1 - z) ** 2;
	return 1 - z * (z * z + 0.5 * rest * rest);
}

const srgb = (x) => 255 * Math.min(x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055, 1);

let tables;
const prepare = () => (tables ??= { film: tabulate(filmic), srgb: tabulate(srgb), noise: triangularNoise() });

/** One code either side, which hides the steps of eight bits in a smooth sky; the same at every exposure, so that nothing crawls. */
function triangularNoise() {
	let state = 1;
	const random = () => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32;
	return new Float32Array(128 * 128).map(() => random() + random() - 1);
}

function filmChannel(x, red, share) {
	const lack = red > 0 ? Math.max(1 - x / red, 0) : 0;
	return look(tables.film, x + FOG * red) * (1 - share * lack * (0.3 + 0.7 * lack * lack));
}

/**
 * @param {Float32Array[]} planes red, green, blue, 1 being 1000 cd/m2
 * @param {number} width
 * @param {number} ev exposure: light is multiplied by 2 to its power
 * @param {"filmic" | "linear"} tone
 * @param {Uint8ClampedArray} codes red, green, blue and alpha of each pixel
 */
export function develop(planes, width, ev, tone, codes) {
	prepare();
	const exposure = 2 ** ev;
	for (let i = 0; i < planes[0].length; i++) {
		let r = planes[0][i] * exposure;
		let g = planes[1][i] * exposure;
		let b = planes[2][i] * exposure;
		const lowest = Math.min(r, g, b);
		if (lowest < 0) {
			const luminance = Math.max(0.2126 * r + 0.7152 * g + 0.0722 * b, 0);
			const share = luminance / Math.max(luminance - lowest, 1e-9);
			r = luminance + share * (r - luminance);
			g = luminance + share * (g - luminance);
			b = luminance + share * (b - luminance);
		}
		if (tone === "filmic") {
			r *= BALANCE[0];
			const square = r * r;
			const share = (square * (0.85 + 0.0033 * r)) / ((square + 9) * (1 + 0.005 * r));
			g = filmChannel(g * BALANCE[1], r, share);
			b = filmChannel(b * BALANCE[2], r, share);
			r = look(tables.film, r + FOG * r);
		}
		const y = (i / width) | 0;
		const noise = tables.noise[((y & 127) << 7) | ((i - y * width) & 127)];
		codes[4 * i] = look(tables.srgb, r) + noise;
		codes[4 * i + 1] = look(tables.srgb, g) + noise;
		codes[4 * i + 2] = look(tables.srgb, b) + noise;
		codes[4 * i + 3] = 255;
	}
}
